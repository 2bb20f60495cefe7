"""Driving a manoeuvre exactly: against closed forms and against the geometry of rolling."""

import numpy as np
import pytest

from hdvplan.errors import OptionError, TurnError
from hdvplan.turning.follow import follow, tightest
from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre, guide_offsets
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle

POINTS = [GuidePoint.FRONT_AXLE, GuidePoint.OUTER_FRONT_WHEEL, GuidePoint.FRONT_CORNER]


def chain(*wheelbases: float, hitches: tuple[float, ...] = ()) -> Vehicle:
    offsets = (*hitches, *[0.0] * (len(wheelbases) - len(hitches)))
    units = tuple(Unit(length, 0.0, 1.0, 2.5, offset) for length, offset in zip(wheelbases, offsets, strict=True))
    return Vehicle("chain", units, max_curvature=1.0)


@pytest.mark.parametrize(("radius", "wheelbase"), [(41.0 * 0.3048, 19.5 * 0.3048), (12.5, 6.0), (6.4, 3.35), (50.0, 2.0)])
def test_the_transient_of_one_unit_meets_its_closed_form(radius: float, wheelbase: float) -> None:
    driven = follow(chain(wheelbase), Manoeuvre(radius, 2.0 * np.pi, lead_in=0.0, lead_out=0.0))
    k = radius / wheelbase
    w, faded = np.sqrt(k**2 - 1.0), np.exp(-driven.s / radius * np.sqrt(k**2 - 1.0))
    phi = 2.0 * np.arctan2(1.0 - faded, (k + w) - (k - w) * faded)
    assert np.max(np.abs(driven.guide[:, 2] - driven.headings[:, 0] - phi)) < 1e-9  # demanded [rad]


@pytest.mark.parametrize(
    ("wheelbases", "hitches"), [((6.0,), ()), ((3.7, 7.7), ()), ((3.7, 7.7), (-0.6,)), ((5.3, 4.6, 7.7), (1.95, 0.0)), ((4.0,) * 5, ())]
)
def test_steady_off_tracking_of_a_chain_meets_its_closed_form(wheelbases: tuple[float, ...], hitches: tuple[float, ...]) -> None:
    radius = 20.0
    driven = follow(chain(*wheelbases, hitches=hitches), Manoeuvre(radius, None))
    centre = np.array([5.0, radius])  # after 5 m of straight
    radii = np.hypot(driven.poses["x"][-1] - centre[0], driven.poses["y"][-1] - centre[1])
    lengths, offsets = np.square(wheelbases), np.square([*hitches, *[0.0] * (len(wheelbases) - len(hitches))])
    expected = np.sqrt(radius**2 - np.cumsum(lengths) + np.append(0.0, np.cumsum(offsets)[:-1]))
    np.testing.assert_allclose(radii, expected, atol=1e-9)  # demanded [m]


@pytest.mark.parametrize("point", POINTS)
def test_the_guided_point_stays_on_its_path(point: GuidePoint) -> None:
    vehicle = load_vehicle("rear-steered-bus")
    driven = follow(vehicle, Manoeuvre(15.0, 2.0, point, ramp=6.0))
    ahead, left = guide_offsets(point, vehicle)
    moved = np.diff(driven.points(0, np.array([ahead]), np.array([left]))[:, 0], axis=0)
    middle = 0.5 * (driven.guide[1:, 2] + driven.guide[:-1, 2])
    across = moved[:, 1] * np.cos(middle) - moved[:, 0] * np.sin(middle)
    assert np.max(np.abs(across)) < 1e-6  # a ramp's chord of 0.05 m turns off the mean heading by 0.05^2 / 12 * k' = 2e-6 rad


@pytest.mark.parametrize(
    ("name", "point", "radius"),
    [
        ("truck-dolly-semitrailer", GuidePoint.FRONT_AXLE, 13.0),
        ("semitrailer-steered", GuidePoint.FRONT_CORNER, 12.5),
        ("rear-steered-bus", GuidePoint.FRONT_CORNER, 12.5),
        ("tractor-semitrailer", GuidePoint.KINGPIN, 12.0),
    ],
)
def test_no_wheel_slides_and_every_coupling_holds(name: str, point: GuidePoint, radius: float) -> None:
    """Written from the geometry of rolling alone: an axle moves along its wheels, which a law turns off its body."""
    vehicle = load_vehicle(name)
    driven = follow(vehicle, Manoeuvre(radius, 0.75 * np.pi, point, lead_in=3.0, lead_out=20.0), spacing=0.0125)
    axles, ahead = (
        np.stack([driven.poses["x"], driven.poses["y"]], axis=-1),
        np.stack([np.cos(driven.headings), np.sin(driven.headings)], -1),
    )
    rolling = [(axles[:, 0] + vehicle.lead.wheelbase * ahead[:, 0], driven.headings[:, 0] + driven.steering)]
    for number, unit in enumerate(vehicle.units):
        angle = driven.headings[:, number - 1] - driven.headings[:, number] if number else driven.steering
        turned = np.clip(unit.steering_ratio * angle, -unit.max_steering_angle, unit.max_steering_angle)
        rolling.append((axles[:, number], driven.headings[:, number] - turned))
        if number:
            coupling = axles[:, number - 1] - vehicle.units[number - 1].hitch_offset * ahead[:, number - 1]
            np.testing.assert_allclose(axles[:, number] + unit.wheelbase * ahead[:, number], coupling, atol=1e-9)  # rounding
    for points, direction in rolling:
        moved, middle = np.diff(points, axis=0), 0.5 * (direction[1:] + direction[:-1])
        across = moved[:, 1] * np.cos(middle) - moved[:, 0] * np.sin(middle)
        assert np.max(np.abs(across)) < 5e-6  # a law's stop is a corner: 0.2 rad/m times 0.0125^2 / 8 m^2 in the step that holds it


def test_from_standstill_the_lead_unit_is_in_its_circle_at_once() -> None:
    vehicle = load_vehicle("citaro-le-u")
    driven = follow(vehicle, Manoeuvre(12.5, 0.5 * np.pi, GuidePoint.FRONT_CORNER, standstill=True, lead_out=0.0))
    assert np.ptp(driven.kappa) < 1e-9  # steady from the first pose
    assert driven.headings[0, 0] == 0.0
    ahead, left = guide_offsets(GuidePoint.FRONT_CORNER, vehicle)
    np.testing.assert_allclose(driven.points(0, np.array([ahead]), np.array([left]))[0, 0], [0.0, 0.0], atol=1e-12)


def test_a_radius_beyond_the_steering_is_refused_with_the_least_one_that_can_be_driven() -> None:
    bus = load_vehicle("bus")
    with pytest.raises(TurnError, match="front wheels turn to 31") as caught:
        follow(bus, Manoeuvre(8.0, None))
    least = caught.value.least_radius_m
    assert least == pytest.approx(tightest(bus, (6.0, 0.0)), abs=0.01)  # given in whole centimetres, rounded up
    assert least is not None
    follow(bus, Manoeuvre(least, None))
    with pytest.raises(TurnError):
        follow(bus, Manoeuvre(least - 0.02, None))


@pytest.mark.parametrize(
    ("manoeuvre", "options"),
    [
        (Manoeuvre(4.0, 0.5 * np.pi, ramp=1.0), "--angle 90 --guide front-axle --ramp 1"),
        (Manoeuvre(8.0, None, standstill=True), "--angle steady --guide front-axle --standstill"),
    ],
)
def test_the_hint_has_all_options_of_a_turn_that_can_be_driven(manoeuvre: Manoeuvre, options: str) -> None:
    with pytest.raises(TurnError) as caught:
        follow(load_vehicle("bus"), manoeuvre)
    assert caught.value.hint == f"it can drive: --radius {caught.value.least_radius_m:.2f} {options}"


def test_a_trailer_that_would_be_pushed_backwards_is_refused_with_the_radius_at_which_it_just_follows() -> None:
    vehicle = chain(3.0, 10.0)
    with pytest.raises(TurnError, match="unit 2 would be pushed backwards") as caught:
        follow(vehicle, Manoeuvre(8.0, None))
    assert caught.value.least_radius_m == pytest.approx(np.hypot(3.0, 10.0), abs=0.03)  # closer to it, settling takes over 64 rounds


def test_a_kingpin_behind_the_axle_or_missing_cannot_guide() -> None:
    for name in ("bus", "truck-dolly-semitrailer"):
        with pytest.raises(TurnError, match="kingpin"):
            guide_offsets(GuidePoint.KINGPIN, load_vehicle(name))


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"radius": 0.0}, "above 0"),
        ({"radius": float("nan")}, "radius = nan"),
        ({"angle": 0.0}, "above 0"),
        ({"angle": 0.5 * np.pi, "ramp": 16.0}, "15.70 m long"),  # 15.708 m: what is said can be given
        ({"ramp": 1.0, "standstill": True}, "standstill"),
    ],
)
def test_what_is_no_turn_is_refused(values: dict[str, float], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        Manoeuvre(**({"radius": 10.0, "angle": 1.0} | values))  # type: ignore[arg-type] # mypy takes the floats for the Boolean too
