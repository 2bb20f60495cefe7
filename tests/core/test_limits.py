import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.start import approach_to
from hdvplan.errors import OptionError, RoadError
from hdvplan.judging.balance import balance_of
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath, from_samples
from hdvplan.road.road import Road, part_of
from hdvplan.vehicle.load import load_vehicle
from tests.core.chains import arc

S = np.array([0.0, 10.0, 30.0])
WIDE = np.array([3.0, 2.5, 3.0])


def test_limits_are_linear_between_and_held_beyond() -> None:
    table = Limits(S, WIDE, -WIDE, WIDE + 1.0, -WIDE - 0.5).table(np.array([-5.0, 5.0, 10.0, 20.0, 99.0]))
    reach = np.array([3.0, 2.75, 2.5, 2.75, 3.0])
    assert np.allclose(table, [reach, -reach, reach + 1.0, -reach - 0.5], rtol=0.0, atol=1e-12)


def ring(length: float = 30.0) -> ReferencePath:
    turned = np.linspace(0.0, 2.0 * np.pi, 101)
    radius = length / (2.0 * np.pi)
    x, y, curvature = radius * np.sin(turned), radius * (1.0 - np.cos(turned)), np.full(101, 1.0 / radius)
    return from_samples(x, y, turned, curvature, length / 100, closed=True)


def test_what_lies_beyond_the_road_s_end_does_not_push_the_plan_over_a_limit_on_the_road() -> None:
    # The lane leaves the line to the left by one in eight: a front that follows it comes 1.2 m further to the left beyond the end.
    s = np.array([0.0, 40.0, 55.0, 70.0])
    left, right = np.array([3.0, 3.0, 3.375, 5.25]), np.array([-3.0, -3.0, 0.375, 2.25])
    slanted = Road("slanted", arc(0.0, 70.0), Limits(s, left, right, left, right))
    found = balance_of(drive_case(Case(slanted, load_vehicle("bus"), settings=PlannerSettings(horizon=50.0))))
    assert found.breaches == ()


def test_what_comes_to_the_start_of_a_closed_road_keeps_the_limits_of_the_lap_s_end() -> None:
    end = np.array([0.0, 28.0, 29.0, 30.0])
    narrow = Limits(end, np.array([4.0, 4.0, 2.0, 4.0]), np.full(4, -4.0), np.array([4.0, 4.0, 2.0, 4.0]), np.full(4, -4.0))
    vehicle, settings = load_vehicle("bus"), PlannerSettings(horizon=20.0)
    way = approach_to(Road("ring", ring(), narrow), vehicle, settings)
    part = part_of(Road("ring", ring(), narrow), 0.0, 15.0, 20.0, 20.0)
    for road, start in ((way, way.path.length), (part, 0.0)):
        assert road.given is not None
        (left,) = (kerb for kerb in road.given.unrolled(start - 2.0, start) if kerb.left)
        at = int(np.argmin(np.abs(left.s - (start - 1.0))))
        here = road.path.extended(20.0, 20.0).at(float(left.s[at]))
        assert np.hypot(left.points[at, 0] - here.x, left.points[at, 1] - here.y) == pytest.approx(2.0, abs=1e-3)  # in chords of 0.25 m


def changed(values: FloatArray, by: float) -> FloatArray:
    out = values.copy()
    out[1] += by
    return out


@pytest.mark.parametrize(
    ("left", "right", "left_sweep", "right_sweep", "word"),
    [
        (WIDE, -WIDE, changed(WIDE, -0.1), -WIDE, "less room than wheels on the left"),
        (WIDE, -WIDE, WIDE, changed(-WIDE, 0.1), "less room than wheels on the right"),
    ],
)
def test_limits_that_contradict_each_other_are_refused_with_their_place(
    left: FloatArray, right: FloatArray, left_sweep: FloatArray, right_sweep: FloatArray, word: str
) -> None:
    with pytest.raises(RoadError, match=word) as caught:
        Limits(S, left, right, left_sweep, right_sweep)
    assert caught.value.s_m == 10.0


@pytest.mark.parametrize(
    ("left", "right", "named"),
    [
        (0.0, 3.0, "left limit"),
        (np.nan, 3.0, "left limit"),
        (3.0, -2.0, "right limit"),
        (3.0, np.inf, "right limit"),
        (-3.0, -3.0, "half width"),
    ],
)
def test_a_constant_limit_is_a_positive_number_of_metres(left: float, right: float, named: str) -> None:
    with pytest.raises(OptionError, match=f"the {named} must be a positive number"):
        Limits.constant(left, right, 100.0)


@pytest.mark.parametrize(("left", "right", "named"), [(3750.0, 3750.0, "half width"), (3.0, 250.1, "right limit")])
def test_a_constant_limit_that_no_street_has_is_refused(left: float, right: float, named: str) -> None:
    with pytest.raises(OptionError, match=f"the {named} must be at most 250 m, not {right:g}") as caught:
        Limits.constant(left, right, 100.0)
    assert caught.value.hint == "is it in metres?"
    assert Limits.constant(250.0, 250.0, 100.0).right[0] == -250.0
