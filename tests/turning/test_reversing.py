"""Manoeuvres of forward and backward legs: kinematics, distances, closed forms, and what was found before by others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st
from matplotlib.text import Annotation

from hdvplan.errors import OptionError, TurnError
from hdvplan.report.layers import leg_area
from hdvplan.report.manoeuvre_plots import reversal_figure
from hdvplan.report.manoeuvres import reversal_json, reversal_tables
from hdvplan.turning.reversing.answer import Answer, reversing
from hdvplan.turning.reversing.legs import driven, posed, wheels_at_stop
from hdvplan.turning.reversing.options import SiteOptions, Template
from hdvplan.turning.reversing.search import half_turn
from hdvplan.turning.reversing.sites import Block, Outline, bodies_of, site_of, wall
from hdvplan.turning.reversing.words import closed_form, details, verdict
from hdvplan.vehicle.kinematics import corners_at, critical_angles
from hdvplan.vehicle.load import load_vehicle, parse_vehicle
from tests.nightly import nightly
from tests.turning.reversals import refuse, towed

_VIEW = shapely.box(-200.0, -200.0, 200.0, 200.0)
_ANGLES = st.floats(-np.pi, np.pi)
_RADII = st.sampled_from([0.0, 0.5, 3.0, 8.0])
_PLACES = st.floats(-15.0, 15.0)


@pytest.fixture(scope="module")
def dock() -> Answer:
    return reversing(load_vehicle("tractor-semitrailer"), Template.DOCK_90, SiteOptions(), starts=1)


@given(x=_PLACES, y=_PLACES, heading=_ANGLES, first=_ANGLES, opening=st.floats(0.0, 3.0), radius=_RADII)
def test_the_gap_to_a_block_is_the_distance_in_the_plane(
    x: float, y: float, heading: float, first: float, opening: float, radius: float
) -> None:
    block = Block("block", ((1.0, -2.0),), first, first + opening, radius)
    vehicle = refuse()
    poses = posed(vehicle, np.array([[x, y, heading]]))
    outline = Outline(np.array([7.35]), np.array([3.85]), np.array([1.275]))
    gap, body = float(block.gaps(poses, outline)[0, 0]), shapely.Polygon(corners_at(vehicle, poses)[0, 0])
    apart = shapely.distance(block.area(_VIEW), body)
    # 64 chords a quarter lie up to 8 (1 - cos(pi / 256)) = 0.6 mm within the rounding
    assert max(gap, 0.0) == pytest.approx(apart, abs=1e-3)
    if gap < -1e-3:
        assert shapely.intersection(block.area(_VIEW), body).area > 0.0


@given(opening=st.sampled_from([0.0, 0.5, 1.5, 2.5]), radius=_RADII, depth=st.sampled_from([0.0, 0.2, 1.0, 5.0]))
def test_an_eroded_block_is_what_lies_deep_enough_within(opening: float, radius: float, depth: float) -> None:
    block = Block("block", ((0.0, 0.0),), 0.3, 0.3 + opening, radius)
    inside, edge = block.eroded(depth).area(shapely.box(-30.0, -30.0, 30.0, 30.0)), shapely.boundary(block.area(_VIEW))
    # chords of both roundings: 8 (1 - cos(pi / 256)) = 0.6 mm; the view's own edge is 170 m away
    assert shapely.distance(inside, edge) == pytest.approx(depth, abs=1e-3)


def test_a_rigid_vehicle_sweeps_backwards_what_it_sweeps_forwards(dock: Answer) -> None:
    vehicle, pieces = refuse(), [(8.0, 1.0 / 6.23), (4.0, 0.0), (5.0, -1.0 / 6.23)]
    forwards = driven(vehicle, np.array([3.0, -1.0, 0.7]), pieces, 0.05)
    back = driven(vehicle, forwards.lead[-1], pieces[::-1], 0.05, backward=True)
    assert np.allclose(back.lead[-1], forwards.lead[0], atol=1e-12)  # closed forms: rounding
    there, again = (leg_area(dock, leg, 0) for leg in (replace(forwards), replace(back)))
    assert shapely.hausdorff_distance(there, again, densify=0.05) < 2e-3


def test_a_backward_leg_is_a_forward_drive_played_in_reverse(dock: Answer) -> None:
    leg = dock.chosen.manoeuvre.legs[1]
    out = leg.reversed()
    begin = np.array([*out.lead[0], out.lead[0, 2] - out.beta[0, 0]])
    told = towed(dock.vehicle, begin, out.s, out.kappa, 1.0)
    assert np.abs(told[:, :2] - out.lead[:, :2]).max() < 2e-3  # demanded
    axles = np.column_stack([out.poses["x"][:, 1], out.poses["y"][:, 1]])
    assert np.abs(_trailer_axles(dock, told) - axles).max() < 2e-3


def test_backed_as_told_the_trailer_ends_at_the_door(dock: Answer) -> None:
    leg = dock.chosen.manoeuvre.legs[1]
    begin = np.array([*leg.lead[0], leg.lead[0, 2] - leg.beta[0, 0]])
    told = towed(dock.vehicle, begin, leg.s, leg.kappa, -1.0)
    # backwards an error grows by exp(60 m / 7.7 m), 2400 times: 1e-12 rad at the cusp are far below 2 mm
    assert np.abs(told[-1, :2] - leg.lead[-1, :2]).max() < 2e-3
    rear = _trailer_axles(dock, told)[-1] - dock.vehicle.units[1].rear_overhang * np.array([np.cos(told[-1, 3]), np.sin(told[-1, 3])])
    assert np.abs(rear).max() < 2e-3


def _trailer_axles(answer: Answer, told: np.ndarray) -> np.ndarray:
    lead, trailer = answer.vehicle.units
    cos, sin = np.cos(told[:, 2:]), np.sin(told[:, 2:])
    x = told[:, 0] - lead.hitch_offset * cos[:, 0] - trailer.wheelbase * cos[:, 1]
    return np.column_stack([x, told[:, 1] - lead.hitch_offset * sin[:, 0] - trailer.wheelbase * sin[:, 1]])


def test_the_legs_meet_at_the_cusps_stretched_at_the_dock(dock: Answer) -> None:
    ahead, back = dock.chosen.manoeuvre.legs
    assert (ahead.backward, back.backward) == (False, True)
    assert np.allclose(ahead.lead[-1], back.lead[0], atol=1e-12)
    assert abs(back.beta[0, 0]) < 1e-8  # the settled pull-out is found to 1e-10 rad of steering
    assert back.beta[-1, 0] == 0.0


def test_no_articulation_passes_the_one_from_which_no_steering_brings_back(dock: Answer) -> None:
    lead, trailer = dock.vehicle.units
    most, kappa = max(np.abs(leg.beta).max() for leg in dock.chosen.manoeuvre.legs), dock.vehicle.max_curvature
    critical = float(critical_angles(dock.vehicle)[0])
    assert np.rad2deg(critical) == pytest.approx(46.8, abs=0.05)  # known to this digit
    assert np.sin(critical) - lead.hitch_offset * kappa * np.cos(critical) == pytest.approx(kappa * trailer.wheelbase, abs=1e-12)
    assert np.deg2rad(30.0) < most < critical  # it is used, and not passed


def test_one_move_without_swinging_out_takes_the_circles_of_front_and_tail() -> None:
    vehicle = refuse()
    family, site = half_turn(Template.THREE_POINT, vehicle, 1), site_of(Template.THREE_POINT, SiteOptions(), vehicle)
    lead = family.strokes(np.zeros((4, 1))).lead(wheels_at_stop(vehicle), 2000)
    reaches = site.reaches(vehicle, posed(vehicle, lead.reshape(-1, 3))).max(axis=0)
    outer = 6.23 + 1.275
    assert reaches.sum() == pytest.approx(np.hypot(outer, 7.35) + np.hypot(outer, 3.85), abs=1e-4)  # 2000 poses bow out by 3e-6


def test_a_wide_street_takes_one_move_within_the_circles() -> None:
    found = reversing(refuse(), Template.THREE_POINT, SiteOptions(width=19.0), starts=1)
    formula = closed_form(found.vehicle, found.template, found.chosen)
    assert formula is not None
    assert (found.fits, found.chosen.legs) == (True, 1)
    assert found.chosen.manoeuvre.size < formula + 1e-3  # what bows out between poses is added


def test_a_point_turns_in_three_legs_in_two_thirds_of_its_radius() -> None:
    # Legs from 0 to a, a to b, b to 180 degrees: the first reaches R (1 - cos a), which is least where the second ends on the near side
    # and the third just reaches the far one: cos a = 1/3, cos b = -1/3. A body within 0.71 m of its axle adds at most twice that.
    point = parse_vehicle("[[unit]]\nwheelbase = 0.5\nwidth = 0.5\nmax_curvature = 0.01", default_name="point")
    found = reversing(point, Template.THREE_POINT, SiteOptions(), starts=1).chosen.manoeuvre.size
    assert 200.0 / 3.0 < found < 200.0 / 3.0 + 2.0 * 0.71


def test_no_pose_enters_what_stands_and_a_smaller_place_would_be_entered(dock: Answer) -> None:
    for size, entered in ((dock.chosen.manoeuvre.size, False), (dock.chosen.manoeuvre.size - 0.02, True)):
        manoeuvre = dock.chosen.manoeuvre
        blocks = (*manoeuvre.site.blocks, *manoeuvre.site.closed(manoeuvre.reaches, size))
        bodies = np.concatenate([corners_at(dock.vehicle, leg.poses).reshape(-1, 4, 2) for leg in dock.chosen.manoeuvre.legs])
        swept = shapely.union_all(shapely.polygons(bodies))
        assert any(shapely.intersection(block.area(_VIEW), swept).area > 1e-6 for block in blocks) is entered
    walls = dock.chosen.manoeuvre.site.closed(dock.chosen.manoeuvre.reaches, dock.chosen.manoeuvre.size)
    assert dock.chosen.manoeuvre.room(walls).min() > -1e-9  # what bows out between poses has room, too: rounding


@pytest.mark.slow
@pytest.mark.parametrize(
    ("template", "vehicle", "polish"),
    [
        (Template.DOCK_90, "tractor-semitrailer", True),
        nightly(Template.DOCK_90, "tractor-semitrailer", False),
        (Template.THREE_POINT, "bus", True),
    ],
)
def test_a_clearance_is_kept_from_all_that_stands_and_no_more(template: Template, vehicle: str, polish: bool) -> None:
    found = reversing(load_vehicle(vehicle), template, SiteOptions(clearance=0.5), starts=1, polish=polish)
    manoeuvre = found.chosen.manoeuvre
    blocks = (*manoeuvre.site.blocks, *manoeuvre.site.closed(manoeuvre.reaches, manoeuvre.size))
    bodies = np.concatenate([corners_at(found.vehicle, leg.poses).reshape(-1, 4, 2) for leg in manoeuvre.legs])
    swept = shapely.union_all(shapely.polygons(bodies))
    apart, told = (min(shapely.distance(block.area(_VIEW), swept) for block in some) for some in (blocks, found.blocks))
    assert 0.5 - 1e-6 < apart < 0.5 + 0.005  # rounding; what bows out between poses, and is kept from neighbours, is no room
    assert reversal_json(found)["least_room_m"] == pytest.approx(told, abs=0.005)
    assert "; 0.50 m of clearance are kept" in details(found)
    formula = closed_form(found.vehicle, found.template, found.chosen)
    assert formula is None or manoeuvre.size == pytest.approx(formula, abs=0.01)


def test_what_a_place_has_to_spare_lies_at_its_end() -> None:
    site = site_of(Template.SIDE_HEAD, SiteOptions(), refuse())
    (tip,) = site.closed(np.array([10.0]), site.base + 10.4)
    assert tip.tips[0] == pytest.approx((10.4, 0.0))


@pytest.mark.slow
def test_a_head_tells_its_arms_and_the_length_that_does_with_equal_ones() -> None:
    """A head of 14 m was said to do whose road lay 2.6 m off its middle; one with equal arms would have been entered."""
    found = reversing(refuse(), Template.HAMMERHEAD, SiteOptions(arm=25.0), starts=1, polish=False)
    told, manoeuvre = reversal_json(found), found.chosen.manoeuvre
    (left, right), equal = told["arms_m"].values(), told["equal_arms_fit_with_m"]
    assert left + right == pytest.approx(25.0)
    assert [tip.tips[0][0] for tip in found.walls] == pytest.approx([-left, right])

    def room(half: float) -> float:
        return float(manoeuvre.room((wall("left", np.pi, half), wall("right", 0.0, half))).min())

    assert room(0.5 * equal) > -1e-6 > room(0.5 * equal - 0.03)
    arms = f"{left:.2f} m left and {right:.2f} m right of the road's axis"
    assert details(found).startswith(f"arms of {arms}; with equal arms this drive takes {equal:.2f} m; the best of ")
    assert arms in str(reversal_tables(found, "")[0].caption)
    (axes,) = reversal_figure(found).axes
    words = [text.get_text() for text in axes.texts]
    for length in (left, right):
        arrow = axes.texts[words.index(f"arm {length:.2f} m") - 1]
        assert isinstance(arrow, Annotation)
        assert np.hypot(*np.subtract(arrow.xy, arrow.xyann)) == pytest.approx(length)


def test_the_same_question_has_the_same_answer() -> None:
    one, other = (reversing(refuse(), Template.THREE_POINT, SiteOptions(), starts=1) for _ in range(2))
    assert reversal_json(one) == reversal_json(other)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("template", "options", "most"),
    [
        (Template.THREE_POINT, SiteOptions(), 13.9),
        nightly(Template.THREE_POINT, SiteOptions(overhang=0.5), 12.9),
        (Template.HAMMERHEAD, SiteOptions(), 22.4),
    ],
    ids=["walls", "kerbs", "head"],
)
def test_the_refuse_vehicle_turns_in_the_room_that_others_found(template: Template, options: SiteOptions, most: float) -> None:
    assert reversing(refuse(), template, options, starts=3).chosen.manoeuvre.size <= most


@pytest.mark.slow
@pytest.mark.parametrize(
    ("rig", "polish"),
    [*map(nightly, ("tractor-semitrailer", "WB-62"), (False, False)), ("WB-62", True)],
    ids=["preset", "WB-62", "WB-62-polished"],
)
def test_an_apron_falls_with_the_spacing_of_doors(rig: str, polish: bool) -> None:
    # Kingsley's table: 36.5, 35.5, 34.5, 33.6, 32.8 m at these spacings, which falls by 1.6 to 2.0 m a metre
    spacings = np.array([3.5, 4.0, 4.5, 5.0, 5.5])
    aprons = np.array([_apron(rig, spacing, polish=polish) for spacing in spacings])
    assert np.all(np.diff(aprons) < 0.0)
    assert 1.3 < (aprons[0] - aprons[-1]) / (spacings[-1] - spacings[0]) < 2.2


@pytest.mark.slow
def test_an_apron_grows_with_the_rig() -> None:
    for polish in (False, True):
        rigs = [_apron(name, 4.0, polish=polish) for name in ("rigid-truck", "WB-40", "WB-62", "WB-67")]
        assert np.all(np.diff(rigs) > 0.0)


def _apron(vehicle: str, spacing: float, *, polish: bool) -> float:
    options = SiteOptions(door_spacing=spacing)
    return reversing(load_vehicle(vehicle), Template.DOCK_90, options, starts=1, polish=polish).chosen.manoeuvre.size


def test_trailers_are_refused_where_the_manoeuvre_is_not_made_for_them() -> None:
    with pytest.raises(TurnError, match="three-point is made for a vehicle without trailers; the tractor-semitrailer has 1"):
        reversing(load_vehicle("tractor-semitrailer"), Template.THREE_POINT, SiteOptions(), starts=1)
    with pytest.raises(TurnError, match="at most one trailer"):
        reversing(load_vehicle("a-double"), Template.DOCK_90, SiteOptions(), starts=1)


@pytest.mark.parametrize(
    ("template", "options", "words"),
    [
        (Template.THREE_POINT, SiteOptions(door_spacing=4.0), "--door-spacing means nothing for three-point"),
        (Template.HAMMERHEAD, SiteOptions(width=2.0), "the carriageway is 2 m wide"),
        (Template.DOCK_90, SiteOptions(door_spacing=2.5), "leave no room between vehicles"),
    ],
)
def test_no_place_is_refused(template: Template, options: SiteOptions, words: str) -> None:
    with pytest.raises(OptionError, match=words):
        reversing(refuse(), template, options, starts=1)


def test_a_corner_of_a_row_of_neighbours_is_a_block_with_two_tips() -> None:
    block = Block("row", ((2.0, 1.0), (0.0, 0.0)), 0.5 * np.pi, 1.2 * np.pi)
    vehicle = refuse()
    rng = np.random.default_rng(0)
    for x, y, heading in rng.uniform([-12.0, -12.0, -3.0], [18.0, 14.0, 3.0], (200, 3)):
        poses = posed(vehicle, np.array([[x, y, heading]]))
        body, area = shapely.Polygon(corners_at(vehicle, poses)[0, 0]), block.area(_VIEW)
        gap = float(block.gaps(poses, bodies_of(vehicle))[0, 0])
        assert max(gap, 0.0) == pytest.approx(shapely.distance(area, body), abs=1e-9)  # of polygons: rounding
        assert (gap < 0.0) == (shapely.intersection(area, body).area > 0.0)


def test_a_dock_s_apron_is_its_straight_and_the_circle_of_the_front_corner() -> None:
    dock = reversing(load_vehicle("tractor-semitrailer"), Template.DOCK_90, SiteOptions(), starts=1, polish=False)
    formula = closed_form(dock.vehicle, dock.template, dock.chosen)
    assert formula is not None
    assert dock.chosen.manoeuvre.size == pytest.approx(formula, abs=1e-3)  # what bows out is added: less than a millimetre
    assert f"{formula:.2f} m by formula" in details(dock)


def test_a_hint_names_options_of_the_template_alone() -> None:
    assert Template.HAMMERHEAD.others == ("--width", "--kerb-radius", "--overhang")
    assert Template.DOCK_90.others == ("--door-spacing",)


def test_a_long_name_does_not_make_a_long_verdict() -> None:
    found = reversing(replace(refuse(), name="refuse vehicle " * 8), Template.THREE_POINT, SiteOptions(width=19.0), starts=1)
    assert len(verdict(found)) <= 100
