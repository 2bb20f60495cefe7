"""Drives of several legs as results: what decides, and where a trailer folds."""

from __future__ import annotations

from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure
from PIL import Image, ImageSequence
from pypdf import PdfReader

from hdvplan.answers import NO
from hdvplan.errors import OptionError
from hdvplan.judging.bodies import corners, placed
from hdvplan.judging.legs import LegsResult, jackknife_of
from hdvplan.judging.result import Result
from hdvplan.report.leg_files import summary_of_legs
from hdvplan.report.leg_plots import draw_ground, legs_film_bytes, points_shown, stops_of
from hdvplan.report.leg_sheet import legs_sheet_bytes
from hdvplan.report.paper import SheetOptions
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.limits import About
from hdvplan.road.regions import Edge, Kind, Region
from hdvplan.vehicle.kinematics import critical_angles
from tests.report.pdf import strokes


def legs_of(*results: Result) -> LegsResult:
    """Return results as legs, every other one driven backwards."""
    legs = tuple(Leg(result.drive.road, number % 2 == 1) for number, result in enumerate(results))
    return LegsResult(Legs("yard", legs), results)


def folded(result: Result, angle: float, at: int) -> Result:
    """Return a result one of whose poses has another articulation."""
    poses = result.drive.poses_z.copy()
    poses[at, 2] = angle
    return replace(result, drive=replace(result.drive, poses_z=poses))


def test_the_leg_with_the_least_room_decides(straight: Result, bus: Result) -> None:
    driven = legs_of(straight, bus)
    spares = [verdict.spare for verdict in driven.verdicts]
    assert driven.worst == int(np.argmin(np.array(spares, dtype=float)))
    assert f" of leg {driven.worst + 1} (" in driven.text
    assert driven.fits is all(verdict.fits for verdict in driven.verdicts)


def test_an_articulation_beyond_the_critical_one_is_a_no_with_its_place(trailer: Result) -> None:
    (critical,) = critical_angles(trailer.drive.vehicle)
    assert jackknife_of(trailer.drive) is None
    assert jackknife_of(folded(trailer, -float(critical), 40).drive) is None
    broken = folded(trailer, -float(critical) - np.deg2rad(2.0), 40)
    found = jackknife_of(broken.drive)
    assert found is not None
    assert found.coupling == 0
    assert found.s == pytest.approx(broken.drive.poses_s[40])
    assert found.angle - found.critical == pytest.approx(np.deg2rad(2.0), abs=1e-12)
    coupling = placed(broken.drive, np.array([40]))[0, 1]
    assert found.x == pytest.approx(float(coupling["coupling_x"]))
    assert found.y == pytest.approx(float(coupling["coupling_y"]))
    driven = legs_of(trailer, broken)
    assert (driven.worst, driven.word, driven.fits) == (1, NO, False)
    degrees = float(np.degrees(critical))
    answer = f"{degrees + 2.0:.0f} degrees, beyond {degrees:.1f} no steering helps"
    assert driven.text == f"NO: jack-knife at s = {found.s:.1f} m of leg 2 (backward): {answer}"
    assert len(driven.text) <= 100
    assert repr(driven) == f"<LegsResult of {driven.name}: {driven.text}>"  # what a notebook shows
    assert driven.details.startswith("between the tractor and the trailer, at x ")
    summary = summary_of_legs(driven)
    assert [leg["status"] for leg in summary["legs"]] == [trailer.status, "jack-knife"]
    assert summary["verdict"]["jackknife"]["coupling"] == 1


def test_it_is_told_how_far_off_its_line_the_vehicle_stands_at_last(straight: Result) -> None:
    states = straight.drive.poses_z.copy()
    states[0, :2] = 0.2, np.deg2rad(-5.0)  # where the second leg, driven backwards, ends
    driven = legs_of(straight, replace(straight, drive=replace(straight.drive, poses_z=states)))
    assert driven.details.endswith("; it ends 0.20 m and 5 degrees off its line")
    last = summary_of_legs(driven)["legs"][1]
    assert (last["off_line_end_m"], last["off_line_end_deg"]) == pytest.approx((0.2, -5.0))
    assert "off its line" not in legs_of(straight, straight).details


def test_articulations_at_the_ends_are_in_the_order_of_driving(trailer: Result) -> None:
    driven = legs_of(trailer, trailer)
    low, high = trailer.drive.z[[0, -1], 2]
    for at, ends in enumerate(((low, high), (high, low))):
        assert [float(angles[0]) for angles in driven.articulation(at)] == list(ends)


def test_what_is_swept_includes_what_lies_beyond_the_ends_of_the_line(straight: Result) -> None:
    (area,) = straight.swept
    vehicle, path = straight.drive.vehicle, straight.drive.road.path
    last = float(straight.drive.poses_s[-1])
    x, y = path.to_plane(0.0, 0.0)
    length = vehicle.lead.length + last  # a bus on a straight sweeps a rectangle
    assert area.area == pytest.approx(length * vehicle.width, rel=1e-3)
    assert area.bounds[0] == pytest.approx(float(x) - vehicle.reach_behind, abs=0.01)
    assert float(y) == pytest.approx(0.0, abs=1e-9)


def test_the_vehicle_stands_where_one_leg_ends_and_the_next_begins(trailer: Result) -> None:
    start, cusp, end = stops_of(legs_of(trailer, trailer))
    betas = np.degrees(trailer.drive.z[:, 2])
    assert [stop.name for stop in (start, cusp, end)] == ["start", "cusp 1", "end"]
    poses = corners(trailer.drive, np.array([0, len(trailer.drive.poses_s) - 1, 0]))
    np.testing.assert_array_equal([stop.outlines for stop in (start, cusp, end)], poses)
    np.testing.assert_allclose([stop.angles[0] for stop in (start, cusp, end)], betas[[0, -1, 0]])
    assert cusp.text == f"cusp 1: articulation {round(float(betas[-1])) + 0:+d}°"


def test_a_map_shows_the_wall_behind_a_dock_and_the_drawn_line_but_no_wall_far_away(straight: Result) -> None:
    swept = shapely.box(*straight.swept[0].bounds)
    walls = [shapely.box(swept.bounds[0] - gap - 0.5, -2.0, swept.bounds[0] - gap, 2.0) for gap in (2.0, 9.0)]
    driven = legs_of(straight)
    points = points_shown(replace(driven, legs=replace(driven.legs, regions=tuple(Region(Kind.OBSTACLE, wall, "wall") for wall in walls))))
    assert points[:, 0].min() == pytest.approx(swept.bounds[0] - 2.5)
    axes, road = Figure().add_subplot(), straight.drive.road
    drawn = Leg(replace(road, about=About.smooth(road.path)), backward=False)
    draw_ground(axes, replace(driven, legs=Legs("yard", (drawn,))))
    assert "line as drawn" in [line.get_label() for line in axes.lines]


@pytest.mark.slow
def test_the_film_goes_forwards_and_back_and_waits_at_the_cusp(straight: Result) -> None:
    film = Image.open(BytesIO(legs_film_bytes(legs_of(straight, straight))))
    frames = [(np.asarray(frame.convert("RGB"), dtype=float), frame.info["duration"]) for frame in ImageSequence.Iterator(film)]
    waits = [wait for _, wait in frames]
    assert [wait for wait in waits if wait != 50] == [900, 1500]
    assert waits.index(900) == pytest.approx(0.5 * len(frames), abs=1.0)

    def front(image: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> float:
        """Return the mean place of the bus's outline along the picture, in its middle half, off the legend."""
        blue = np.max(np.abs(image[150:450] - np.array((0, 114, 178))), axis=-1) < 30.0
        return float(np.mean(np.nonzero(blue)[1]))

    middle = waits.index(900)
    there = [front(frames[number][0]) for number in (0, middle // 2, middle)]
    back = [front(frames[number][0]) for number in (middle, middle + middle // 2, len(frames) - 1)]
    assert there[0] < there[1] < there[2]
    assert back[0] > back[1] > back[2]


def test_edges_are_drawn_as_surveyed_and_obstacles_are_named(straight: Result) -> None:
    kerb, car = shapely.LineString([(0.0, 4.0), (80.0, 4.0), (80.0, 9.0)]), shapely.box(30.0, 2.2, 34.0, 3.9)
    behind = Region(Kind.OBSTACLE, shapely.box(0.0, 4.0, 80.0, 20.0), "kerb", edges=(Edge("kerb", kerb),))
    driven = legs_of(straight, straight)
    axes = Figure().add_subplot()
    draw_ground(axes, replace(driven, legs=replace(driven.legs, regions=(behind, behind, Region(Kind.OBSTACLE, car, "parked car")))))
    handles = dict(zip(*reversed(axes.get_legend_handles_labels()), strict=True))
    assert handles["kerb or wall"].get_xydata().tolist() == shapely.get_coordinates(kerb).tolist()
    assert "parked car" in handles
    (drawn,) = axes.patches
    assert drawn.get_path().get_extents().bounds == pytest.approx((30.0, 2.2, 4.0, 1.7))


@pytest.mark.slow
def test_the_sheet_has_all_legs_to_scale_the_tightest_place_and_the_cusps(kerbed: Result) -> None:
    driven = legs_of(kerbed, kerbed)
    (page,) = PdfReader(BytesIO(legs_sheet_bytes(driven, SheetOptions("a2", 500)))).pages
    level = [line for line in strokes(page) if len(line) == 2 and line[0, 1] == line[1, 1]]
    bar = min(level, key=lambda line: abs(line[1, 0] - line[0, 0] - 100.0))  # 50 m
    assert bar[1, 0] - bar[0, 0] == pytest.approx(100.0, abs=1e-3)  # written to 1e-6 points
    text = " ".join(page.extract_text().split())
    length = kerbed.drive.road.path.length
    for words in (
        "1:500", "50 m", f"A: {driven.called(driven.worst)}", "cusp 1", "swept forward", "swept backward", "yard",
        f"forward {length:.1f} m, backward {length:.1f} m", "judged by simulation",
    ):  # fmt: skip
        assert words in text
    with pytest.raises(OptionError, match="at 1:50 the sheet has no room for the whole drive"):
        legs_sheet_bytes(driven, SheetOptions("a4", 50))


def test_what_is_swept_in_a_bend_comes_no_nearer_to_its_centre_than_bodies_do(bus: Result) -> None:
    drive, path = bus.drive, bus.drive.road.path
    (area,) = bus.swept
    here = path.at(0.5 * path.length)  # in the middle of the U-turn
    radius = 1.0 / float(here.curvature)
    centre = shapely.Point(float(here.x) - radius * np.sin(float(here.heading)), float(here.y) + radius * np.cos(float(here.heading)))
    bodies = shapely.polygons(corners(drive, np.arange(len(drive.poses_s)))[:, 0])
    # Between poses 0.25 m apart a side turns by 15 mrad about its axle: it comes nearer by less than a millimetre.
    assert shapely.distance(area, centre) == pytest.approx(float(np.min(shapely.distance(bodies, centre))), abs=1e-3)
