"""The figures of manoeuvres: published ones, closed forms, measured outlines, and relations between them."""

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.turning.follow import Followed, follow
from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre
from hdvplan.turning.swept import band_of, figures_of
from hdvplan.turning.turn import load_template, turn
from hdvplan.vehicle.load import load_vehicle, preset_groups
from hdvplan.vehicle.model import Unit, Vehicle

CANNOT = {"a-double", "b-double"}  # drive a circle of 12.5 m
FAIL = {"citaro-le-mu", "double-articulated-bus", "truck-dolly-semitrailer"}  # to keep 5.30 m inside it


@pytest.mark.parametrize(("wheelbase", "overhang", "swing"), [(4.5, 3.7, 0.300), (6.0, 7.0, 1.246), (6.0, 3.7, 0.261)])
def test_tail_swing_in_the_australian_turn_is_as_published(wheelbase: float, overhang: float, swing: float) -> None:
    rigid = Vehicle("rigid", (Unit(wheelbase, 1.2, overhang, 2.5),), max_curvature=0.2)
    assert turn(rigid, load_template("pbs-90")).figures.tail_swing[0] == pytest.approx(swing, abs=0.005)  # demanded


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(preset_groups()["europe"]) - CANNOT))
def test_a_european_preset_in_the_european_circle_keeps_the_radii_of_its_outline(name: str) -> None:
    found = turn(load_vehicle(name), load_template("eu-circle"))
    inside, outside = radii(found.driven, np.array([5.0, 12.5]))
    assert found.figures.bodies.inside == pytest.approx(inside, abs=1e-5)  # what is left to settle, and 1 cm between points
    assert found.figures.bodies.outside == pytest.approx(outside, abs=1e-5)
    assert outside == pytest.approx(12.5, abs=1e-5)  # each can steer into the circle, and its guided corner is the outermost point
    assert found.complies == (inside >= 5.30) == (name not in FAIL)


def radii(driven: Followed, centre: FloatArray) -> tuple[float, float]:
    """Return inside and outside radius of the last pose from points of the outline 1 cm apart on the inner sides, and all corners."""
    inside, outside = [], []
    for number, unit in enumerate(driven.vehicle.units):
        ahead, ends = np.arange(-unit.rear_overhang, unit.front, 0.01), np.array([-unit.rear_overhang, unit.front])
        inside.append(np.hypot(*(driven.points(number, ahead, np.full(len(ahead), 0.5 * unit.width))[-1] - centre).T).min())
        outside.append(np.hypot(*(driven.points(number, ends, np.full(2, -0.5 * unit.width))[-1] - centre).T).max())
    return float(min(inside)), float(max(outside))


@pytest.mark.parametrize("ramp", [0.0, 4.0])
def test_off_tracking_of_the_front_axle_s_own_track_is_measured_across_it(ramp: float) -> None:
    """A very short vehicle tracks its front axle; a long one is inside by what the closed form says."""
    figures = figures_of(follow(Vehicle("long", (Unit(6.0, 0.0, 1.0, 2.5),), max_curvature=0.5), Manoeuvre(15.0, 2.0 * np.pi, ramp=ramp)))
    assert figures.off_tracking[0] == pytest.approx(15.0 - np.sqrt(15.0**2 - 36.0), abs=1e-4)  # a whole turn all but settles
    figures = figures_of(follow(Vehicle("short", (Unit(0.5, 0.0, 0.0, 0.5),), max_curvature=0.5), Manoeuvre(15.0, np.pi, ramp=ramp)))
    assert figures.off_tracking[0] < 0.01


def test_a_front_corner_on_the_line_never_swings_beyond_it_and_a_front_axle_lets_it() -> None:
    bus = load_vehicle("bus")
    assert figures_of(follow(bus, Manoeuvre(15.0, 1.5, GuidePoint.FRONT_CORNER))).frontal_swing == pytest.approx(0.0, abs=1e-9)  # rounding
    swing = figures_of(follow(bus, Manoeuvre(15.0, 1.5))).frontal_swing
    assert swing is not None
    assert 0.3 < swing < bus.lead.front_overhang * np.sin(np.arctan(bus.lead.wheelbase * bus.max_curvature))
    assert figures_of(follow(bus, Manoeuvre(15.0, None))).frontal_swing is None


def test_an_inside_radius_is_negative_where_the_body_reaches_over_the_centre() -> None:
    needle = Vehicle("needle", (Unit(5.0, 0.0, 0.5, 2.5),), max_curvature=1.0)
    figures = figures_of(follow(needle, Manoeuvre(5.2, None)))
    assert figures.bodies.inside == pytest.approx(np.sqrt(5.2**2 - 25.0) - 1.25, abs=1e-6)  # settled to 1e-10 rad


def test_the_band_s_error_falls_with_the_square_of_the_distance_between_poses() -> None:
    vehicle = load_vehicle("WB-62")
    manoeuvre = load_template("aashto-180").manoeuvre(vehicle)
    exact, errors = band_of(follow(vehicle, manoeuvre, spacing=0.025)), {}
    t = exact.t[(exact.t >= 0.0) & (exact.t <= manoeuvre.radius * np.pi)]
    for spacing in (0.1, 0.25, 1.0):
        band = band_of(follow(vehicle, manoeuvre, spacing=spacing))
        edges = ((getattr(band, name), getattr(exact, name)) for name in ("inner", "outer"))
        errors[spacing] = max(float(np.max(np.abs(np.interp(t, band.t, one) - np.interp(t, exact.t, true)))) for one, true in edges)
    assert errors[0.1] < 0.5e-3  # measured 0.2 mm; AutoTURN states 2 to 3 mm at this distance
    assert errors[1.0] / errors[0.25] > 8.0  # 16 times, but for where stations happen to lie
