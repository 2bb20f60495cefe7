"""Where the middle of the swept envelope should lie: constant, along s, between the limits."""

from pathlib import Path

import numpy as np
import pytest

from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.drive import Drive, drive
from hdvplan.errors import OptionError
from hdvplan.judging.envelope import Envelope
from hdvplan.planning.bias import Bias, bias_named, shifted
from hdvplan.planning.objectives import Objective, balanced, body_max, geometric, geometric_fixed, lead_axle
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.limits import Limits
from hdvplan.road.road import Road
from hdvplan.road.scenarios import Scenario
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle

each_vehicle = pytest.mark.parametrize("name", ["bus", "tractor-trailer"])
MIDDLE = slice(240, 360)  # 60 to 90 m of 150 m, every 0.25 m


def constant_road(curvature: float) -> Road:
    return Scenario("constant", ((0.0, 150.0), (curvature, curvature)))()


def run(road: Road, name: str, bias: Bias, objective: Objective = geometric) -> tuple[Drive, Envelope]:
    driven = drive(road, load_vehicle(name), objective, RiccatiWorkspace, PlannerSettings(), bias=bias)
    return driven, Envelope(driven)


@each_vehicle
@pytest.mark.parametrize("objective", [geometric, geometric_fixed, lead_axle, balanced])
def test_on_a_straight_both_reaches_move_by_the_bias(name: str, objective: Objective) -> None:
    _, before = run(constant_road(0.0), name, Bias.constant(0.0), objective)
    for bias in (0.3, -0.4):
        _, after = run(constant_road(0.0), name, Bias.constant(bias), objective)
        assert np.max(np.abs(after.reach_left - before.reach_left - bias)) < 1e-6  # nothing but the frame has moved
        assert np.max(np.abs(after.reach_right - before.reach_right - bias)) < 1e-6


@each_vehicle
def test_a_vehicle_about_a_biased_circle_drives_the_circle_of_that_radius(name: str) -> None:
    curvature, bias = 0.04, 0.5
    driven, envelope = run(constant_road(curvature), name, Bias.constant(bias))
    circle = CentringTable.of(load_vehicle(name)).at(np.array([1.0 / (1.0 / curvature - bias)]))
    at = slice(120, 180)
    assert np.max(np.abs(driven.kappa[at] - circle.kappa[0])) < 1e-6
    assert np.max(np.abs(driven.z[at, 0] - (circle.e_y[0] + bias))) < 1e-5  # the table's interpolation
    assert np.max(np.abs(envelope.reach_left[MIDDLE] - (bias + circle.half_width[0]))) < 0.003  # the envelope's chords
    assert np.max(np.abs(envelope.reach_right[MIDDLE] - (bias - circle.half_width[0]))) < 0.003


@each_vehicle
def test_a_bias_along_s_is_followed(name: str) -> None:
    bias = Bias(np.array([30.0, 60.0, 90.0, 120.0]), np.array([0.0, 0.6, 0.6, 0.0]))
    _, envelope = run(constant_road(0.0), name, bias, balanced)
    middle = 0.5 * (envelope.reach_left + envelope.reach_right)
    assert np.max(np.abs(middle[300:340] - 0.6)) < 0.02  # 75 to 85 m
    assert np.max(np.abs(middle - bias.at(envelope.s))) < 0.1  # the corners of the ramps are rounded


def test_the_middle_of_the_limits_leaves_the_same_clearance_on_both_sides() -> None:
    limits = Limits.constant(2.6, 3.4, 150.0)
    road = Road("asymmetric", constant_road(0.02).path, limits)
    _, envelope = run(road, "tractor-trailer", bias_named("centre", limits))
    left, right = 2.6 - envelope.reach_left[MIDDLE], envelope.reach_right[MIDDLE] + 3.4
    assert np.max(np.abs(left - right)) < 0.002  # the envelope's chords
    assert np.min(left) > 0.3


def test_a_bias_is_read_from_a_file(tmp_path: Path) -> None:
    file = tmp_path / "bias.csv"
    file.write_text("# metres\ns,bias\n0,0.1\n50, -0.2\n", encoding="utf-8")
    bias = bias_named(str(file), None)
    assert bias.at(np.array([-1.0, 0.0, 25.0, 99.0])).tolist() == pytest.approx([0.1, 0.1, -0.05, -0.2])


@pytest.mark.parametrize(
    "content",
    [
        "s;bias\n0;0,1\n50;-0,2\n",
        "\ufeffs [m]\tBias\tnote\r\n0\t0.1\tkerb\r\n50\t-0.2\t\r\n",
        "sep=|\ns_m|bias_m\n0|0,1\n# half-way\n50|-0,2\n",
    ],
    ids=["semicolons and commas", "tabs", "bars"],
)
def test_a_bias_file_may_be_written_as_a_road_file_may(tmp_path: Path, content: str) -> None:
    file = tmp_path / "bias.csv"
    file.write_text(content, encoding="utf-8")
    assert bias_named(str(file), None).at(np.array([0.0, 25.0])).tolist() == pytest.approx([0.1, -0.05])


def test_a_bias_is_a_number() -> None:
    assert bias_named("-0.25", None).at(np.zeros(2)).tolist() == [-0.25, -0.25]


@pytest.mark.parametrize("text", ["missing.csv", "center", "nan", "inf", "1e400", "-" + 400 * "1", "a\0b", 5000 * "x", "."])
def test_what_is_no_bias_is_refused(text: str) -> None:
    with pytest.raises(OptionError):
        bias_named(text, None)


def test_the_centre_needs_limits() -> None:
    with pytest.raises(OptionError, match="needs limits"):
        bias_named("centre", None)


def test_a_bias_beyond_the_centre_of_curvature_is_refused_with_its_place() -> None:
    with pytest.raises(OptionError, match=r"s = 5\.0 m"):
        shifted(np.array([0.0, 0.1]), np.array([9.5, 9.5]), np.array([0.0, 5.0]))
    assert shifted(np.array([-0.1]), np.array([10.0]), np.array([0.0])).tolist() == pytest.approx([-0.05])


def test_the_largest_reach_has_no_bias() -> None:
    with pytest.raises(OptionError, match="largest reach"):
        run(constant_road(0.0), "bus", Bias.constant(0.3), body_max)
