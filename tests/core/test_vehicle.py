from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.errors import VehicleError, refused_in
from hdvplan.vehicle.kinematics import POINTS_PER_EDGE, edge_points
from hdvplan.vehicle.load import load_vehicle, parse_vehicle, preset_groups, preset_names, preset_text, read_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import few, three_units, vehicles

PUBLISHED = {  # L1, L1f, L1r, W, M1, L2, L2r
    "bus": (6.00, 3.34, 2.66, 2.54, 0.0, None, None),
    "tractor-trailer": (3.47, 1.16, 1.34, 2.54, -0.30, 9.40, 3.03),
    "tractor-trailer-24m": (3.78, 1.46, 1.64, 2.54, -0.30, 13.97, 4.50),
    "tractor-trailer-paper": (3.70, 0.00, 1.34, 2.54, 0.60, 7.70, 3.03),
}
BUS = """
[[unit]]
wheelbase = 6.0
front_overhang = 2.5
rear_overhang = 3.0
width = 2.5
"""


@pytest.mark.parametrize("name", sorted(PUBLISHED))
def test_a_preset_has_the_published_dimensions(name: str) -> None:
    wheelbase, front, rear, width, hitch, trailer, trailer_rear = PUBLISHED[name]
    vehicle = load_vehicle(name)
    assert vehicle.name == name
    assert vehicle.source
    assert vehicle.units[0] == Unit(wheelbase, front, rear, width, hitch)
    assert (vehicle.max_curvature, vehicle.max_curvature_rate) == (0.1, 0.1)
    if trailer is None or trailer_rear is None:
        assert len(vehicle.units) == 1
    else:
        assert vehicle.units[1:] == (Unit(trailer, 0.0, trailer_rear, width),)


LENGTHS = {  # overall, as named in each preset's description; the laws' and the makers' numbers
    "a-double": 32.0,
    "articulated-bus": 18.125,
    "b-double": 25.25,
    "citaro": 11.95,
    "citaro-k": 10.533,
    "citaro-le-mu": 13.187,
    "citaro-le-u": 12.17,
    "double-articulated-bus": 24.0,
    "rear-steered-bus": 12.0,
    "rigid-truck": 10.0,
    "road-train": 18.75,
    "tractor-semitrailer": 16.5,
    "semitrailer-active": 16.5,
    "semitrailer-steered": 16.5,
    "truck-dolly-semitrailer": 25.25,
}


FEET = {  # overall length and width of the AASHTO design vehicles, as the Green Book's tables print them
    "A-BUS": (60.0, 8.5),
    "BUS-40": (40.5, 8.5),
    "CITY-BUS": (40.0, 8.5),
    "P": (19.0, 7.0),
    "S-BUS-36": (35.8, 8.0),
    "S-BUS-40": (40.0, 8.0),
    "SU-30": (30.0, 8.0),
    "SU-40": (39.5, 8.0),
    "WB-40": (45.5, 8.0),
    "WB-62": (69.0, 8.5),
    "WB-67": (73.5, 8.5),
    "WB-67D": (72.3, 8.5),
}


@pytest.mark.parametrize("name", sorted(FEET))
def test_a_design_vehicle_is_as_long_and_wide_as_the_standard_says(name: str) -> None:
    vehicle, (length, width) = load_vehicle(name), FEET[name]
    assert vehicle.reach_ahead + vehicle.reach_behind == pytest.approx(length * 0.3048, abs=1e-9)  # rounding of the sum
    assert vehicle.width == width * 0.3048


def test_presets_are_grouped_by_where_they_come_from() -> None:
    assert preset_groups() == {"papers": sorted(PUBLISHED), "europe": sorted(LENGTHS), "aashto": sorted(FEET)}


def test_capitals_do_not_matter_in_a_preset_s_name() -> None:
    assert load_vehicle("wb-62") == load_vehicle("WB-62")
    with pytest.raises(VehicleError) as caught:
        load_vehicle("WB-6")
    assert caught.value.hint is not None
    assert "did you mean 'WB-6" in caught.value.hint


def test_a_file_in_feet_says_the_same_as_one_in_metres() -> None:
    feet = parse_vehicle('length_unit = "ft"' + BUS + "turning_radius = 10\nmax_curvature_rate = 0.2", default_name="x")
    assert feet.lead == Unit(6.0 * 0.3048, 2.5 * 0.3048, 3.0 * 0.3048, 2.5 * 0.3048)
    assert feet.max_curvature == pytest.approx(1.0 / np.sqrt((10.0 * 0.3048) ** 2 - (6.0 * 0.3048) ** 2), rel=1e-15)
    assert feet.max_curvature_rate == 0.2  # a rate is not a length


def test_the_turning_circle_between_walls_is_that_of_the_outer_front_corner() -> None:
    bus = parse_vehicle(BUS + "turning_circle = 22.0", default_name="x")
    corner = np.hypot(1.0 / bus.max_curvature + 0.5 * bus.lead.width, bus.lead.wheelbase + bus.lead.front_overhang)
    assert 2.0 * corner == pytest.approx(22.0, rel=1e-12)
    feet = parse_vehicle('length_unit = "ft"' + BUS + "turning_circle = 22.0", default_name="x")
    assert feet.max_curvature == pytest.approx(bus.max_curvature / 0.3048, rel=1e-12)


@pytest.mark.parametrize(("ratio", "angle"), [(0.2, 0.7), (1.0, 0.7), (0.6, 0.1)])
def test_the_turning_circle_of_a_steered_rear_axle_is_that_of_a_drive(ratio: float, angle: float) -> None:
    text = BUS + f"steering_ratio = {ratio}\nmax_steering_angle = {angle}\n"
    for way, size, ahead in (("turning_circle", 22.0, (-3.0, 8.5)), ("turning_radius", 11.0, (6.0,))):
        bus = parse_vehicle(text + f"{way} = {size}", default_name="x")
        front = np.arctan(bus.max_curvature * bus.lead.wheelbase)
        rear = min(ratio * front, angle)
        yaw = (np.tan(front) + np.tan(rear)) / bus.lead.wheelbase  # for each metre that the rear axle goes ahead
        out = 1.25 if way == "turning_circle" else 0.0  # beside the axis, and away from the centre
        drawn = max(float(np.hypot(1.0 + yaw * out, yaw * x - np.tan(rear))) / yaw for x in ahead)  # speed over yaw rate
        assert drawn * (2.0 if way == "turning_circle" else 1.0) == pytest.approx(size, rel=1e-9)


@pytest.mark.parametrize("size", ["17.0", "inf", "-3.0"])
def test_a_turning_circle_that_no_steered_rear_axle_makes_is_refused(size: str) -> None:
    with pytest.raises(VehicleError, match="for these axles"):
        parse_vehicle(BUS + f"steering_ratio = 0.01\nturning_circle = {size}", default_name="x")


def test_a_decimal_comma_is_told() -> None:
    with pytest.raises(VehicleError) as caught:
        parse_vehicle(BUS + "rear_overhang = 3,4 # m", default_name="x")
    assert caught.value.hint == "decimal numbers have a point: 6.9, not 6,9"


def test_a_steering_limit_that_is_assumed_is_told(tmp_path: Path) -> None:
    (tmp_path / "bus.toml").write_text(BUS, encoding="utf-8")
    _, remark = read_vehicle(tmp_path / "bus.toml")
    assert remark == "bus: no turning_circle or max_curvature is given: the rear axle's least radius is assumed to be 10.0 m"
    assert read_vehicle("citaro")[1] is read_vehicle("WB-62")[1] is None


def test_every_preset_names_its_source_and_its_text_parses_to_it() -> None:
    assert preset_names() == sorted([*PUBLISHED, *LENGTHS, *FEET])
    for name in preset_names():
        vehicle = load_vehicle(name)
        assert vehicle.source
        assert parse_vehicle(preset_text(name), default_name="other") == vehicle


@pytest.mark.parametrize("name", sorted(LENGTHS))
def test_a_preset_is_as_long_as_the_law_or_its_maker_says_and_no_wider_than_2_55_metres(name: str) -> None:
    vehicle = load_vehicle(name)
    assert vehicle.reach_ahead + vehicle.reach_behind == pytest.approx(LENGTHS[name], abs=1e-9)
    assert vehicle.width == 2.55


def test_semitrailers_keep_to_the_directive_about_their_kingpins() -> None:
    for name in ("tractor-semitrailer", "truck-dolly-semitrailer", "b-double", "a-double"):
        last = load_vehicle(name).units[-1]
        assert last.wheelbase + last.rear_overhang == pytest.approx(12.0, abs=1e-9)
        assert np.hypot(last.front_overhang, 0.5 * last.width) <= 2.04


def test_a_steered_axle_is_read_whether_or_not_it_is_called_so() -> None:
    for word in ("", "steered = true\n"):
        rear, trailer = parse_vehicle(
            BUS + "steering_ratio = 0.2\nhitch_offset = 0\n" + BUS + word + "steering_ratio = 0.5\nmax_steering_angle = 0.3",
            default_name="x",
        ).units
        assert (rear.steering_ratio, trailer.steering_ratio, trailer.max_steering_angle) == (0.2, 0.5, 0.3)


def test_a_body_may_begin_behind_its_bare_drawbar() -> None:
    dolly = load_vehicle("truck-dolly-semitrailer").units[1]
    assert dolly.front < dolly.wheelbase
    points = edge_points(load_vehicle("truck-dolly-semitrailer"))["ahead"][1]
    assert (points.min(), points.max()) == (-dolly.rear_overhang, pytest.approx(dolly.front))


def test_a_trailer_that_overtakes_its_lead_counts_as_reach_ahead() -> None:
    vehicle = Vehicle("pushed", (Unit(3.0, 0.5, 1.0, 2.5, -1.0), Unit(4.0, 6.0, 1.0, 2.5)))
    # its axle is 3.0 m behind the lead's, its front 10.0 m ahead of that
    assert vehicle.reach_ahead == pytest.approx(7.0, abs=1e-12)


def test_lengths_and_reaches_add_up_along_the_chain() -> None:
    vehicle = three_units()
    assert vehicle.states == 4
    assert vehicle.width == 2.6
    assert vehicle.reach_ahead == pytest.approx(6.2, abs=1e-12)
    assert vehicle.reach_behind == pytest.approx(0.7 + 5.5 - 0.2 + 8.1 + 3.3, abs=1e-12)
    assert vehicle.lead.length == pytest.approx(7.3, abs=1e-12)
    dolly = [float(vehicle.table()[name][1]) for name in ("wheelbase", "hitch_offset", "front", "rear_overhang", "half_width")]
    assert np.allclose(dolly, [5.5, -0.2, 5.8, 0.6, 1.2], rtol=0.0, atol=1e-12)


def test_a_long_rear_overhang_may_reach_further_back_than_the_trailer() -> None:
    vehicle = Vehicle("odd", (Unit(4.0, 1.0, 6.0, 2.5, -1.0), Unit(2.0, 0.0, 0.5, 2.5)))
    assert vehicle.reach_behind == 6.0


def test_a_length_stands_for_the_rear_overhang() -> None:
    text = BUS.replace("rear_overhang = 3.0", "length = 11.5")
    assert parse_vehicle(text, default_name="x").lead.rear_overhang == pytest.approx(3.0, abs=1e-12)


def test_a_file_is_read_and_named_after_itself(tmp_path: Path) -> None:
    file = tmp_path / "night-bus.toml"
    file.write_text(BUS, encoding="utf-8")
    assert load_vehicle(file).name == "night-bus"
    assert load_vehicle(str(file)).lead == Unit(6.0, 2.5, 3.0, 2.5)


def test_more_units_than_the_core_has_room_for_are_refused_however_they_come() -> None:
    lead, trailer = load_vehicle("tractor-trailer").units
    assert len(Vehicle("train", (lead, *[trailer] * 15)).units) == 16
    with pytest.raises(VehicleError, match="vehicle 'train' has 17 units; at most 16 are planned"):
        Vehicle("train", (lead, *[trailer] * 16))


@given(
    field=st.sampled_from(["wheelbase", "front_overhang", "rear_overhang", "width", "hitch_offset"]),
    wrong=st.one_of(st.floats(max_value=-50.0), st.floats(min_value=50.1), st.just(float("nan"))),
    unit=st.integers(0, 2),
)
@few
def test_an_impossible_dimension_is_refused_by_name_where_it_is_given(field: str, wrong: float, unit: int) -> None:
    with pytest.raises(VehicleError) as caught, refused_in("here"):
        replace(three_units().units[unit], **{field: wrong})  # type: ignore[arg-type] # of these fields, all are numbers
    assert caught.value.field == field
    assert str(caught.value).startswith(f"here: {field} = ")
    assert caught.value.hint == "dimensions are in metres"


@given(value=st.one_of(st.floats(max_value=0.0), st.floats(min_value=1.0, exclude_min=True), st.just(float("nan"))), rate=st.booleans())
@few
def test_impossible_steering_is_refused_by_name(value: float, rate: bool) -> None:
    field = "max_curvature_rate" if rate else "max_curvature"
    steering = (0.1, value) if rate else (value, 0.1)
    with pytest.raises(VehicleError) as caught:
        Vehicle("drawn", three_units().units, *steering)
    assert caught.value.field == field


@given(vehicle=vehicles())
@few
def test_sampled_edge_points_hold_corners_and_axles_and_know_their_overhangs(vehicle: Vehicle) -> None:
    points = edge_points(vehicle)
    assert points.shape == (len(vehicle.units), POINTS_PER_EDGE)
    for unit, row in zip(vehicle.units, points, strict=True):
        ahead, overhang = row["ahead"], row["overhang"]
        assert np.all(np.diff(ahead) > 0.0)
        for wanted in (-unit.rear_overhang, 0.0, unit.wheelbase, unit.front):
            assert np.min(np.abs(ahead - wanted)) < 2e-6  # points closer than this count as one
        inner = (ahead >= -1e-6) & (ahead <= unit.wheelbase + 1e-6)
        assert np.array_equal(overhang == 0, inner)
