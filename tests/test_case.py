"""A run as a value: its key, its way to another process, and what is written of it."""

from __future__ import annotations

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

import hdvplan
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.errors import RoadError
from hdvplan.machine import commit, software
from hdvplan.planning.bias import Bias
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import Discretisation, PlannerSettings, Scheme
from hdvplan.record import command, record_of, write_record
from hdvplan.road.limits import Limits
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import ReferencePath
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.nightly import nightly

ROOT = Path(__file__).parents[1]
PLAIN = Case(load_road("uturn"), load_vehicle("bus"))
BRIEF = PlannerSettings(horizon=50.0)
CSV = "x,y,left,right\n" + "".join(f"{500000 + 10 * i},{6400000 + 0.4 * i**2},3.5,4\n" for i in range(13))


def straight() -> Case:
    """Return a case whose numbers are exact in binary: every platform makes the same one."""
    table = np.zeros((200, 12))
    table[:, 0], table[:, 1] = 0.5 * np.arange(200), 1.0
    road = Road("straight", ReferencePath(table, 0.0, 0.5, 100.0, closed=False)).with_limits(3.0, 2.5)
    return Case(road, Vehicle("van", (Unit(3.0, 1.0, 1.0, 2.0, max_steering_angle=0.5),), 0.125, 0.125))


def bits(result: hdvplan.Result) -> list[FloatArray]:
    """Return everything planned, driven and swept."""
    drive = result.drive
    planned = [array for plan in drive.plans for array in (plan.z, plan.kappa)]
    return [drive.z, drive.kappa, drive.poses_z, result.envelope.left, result.envelope.right, *planned]


def from_csv(folder: Path) -> Case:
    (folder / "bend.csv").write_text(CSV, encoding="utf-8")
    road = load_road(folder / "bend.csv", RoadOptions(crs="EPSG:3006"))
    bias = Bias(np.array([0.0, 60.0, 120.0]), np.array([0.0, 0.2, 0.0]))
    return Case(road, load_vehicle("semitrailer-active"), settings=BRIEF, bias=bias)


def with_regions(_folder: Path) -> Case:
    road = load_road("parked_van", RoadOptions(offset=-0.25))
    return Case(road, load_vehicle("bus"), "art-weighted:0.45", "piqp", replace(BRIEF, scheme=Scheme.SQP))


def steered_by_law(_folder: Path) -> Case:
    road = load_road("sturn").with_limits(4.0, 4.5)
    return Case(road, load_vehicle("semitrailer-steered"), "balanced", settings=BRIEF, bias=Bias.constant(-0.1))


@pytest.mark.slow
@pytest.mark.parametrize("make", [from_csv, *map(nightly, (with_regions, steered_by_law))])
def test_a_case_that_another_process_unpickles_has_the_same_key_and_gives_the_identical_plan(
    make: Callable[[Path], Case], tmp_path: Path
) -> None:
    case = make(tmp_path)
    (tmp_path / "case.pickle").write_bytes(pickle.dumps(case))
    there = (
        "import pickle, sys, hdvplan; from pathlib import Path; case = pickle.loads(Path('case.pickle').read_bytes()); print(case.key); "
        "Path('result.pickle').write_bytes(pickle.dumps(hdvplan.plan(case)))"
    )
    ended = subprocess.run([sys.executable, "-c", there], cwd=tmp_path, capture_output=True, text=True, check=True)  # noqa: S603 - our own
    theirs = pickle.loads((tmp_path / "result.pickle").read_bytes())  # noqa: S301 - our own bytes
    ours = hdvplan.plan(case)
    assert ended.stdout.strip() == case.key == theirs.case.key
    for mine, other in zip(bits(ours), bits(theirs), strict=True):
        np.testing.assert_array_equal(mine, other)
    assert theirs.status == ours.status
    for name in ("max_left", "max_right", "mean_abs_imbalance", *vars(ours.balance).keys() - {"envelope"}):  # whose arrays are the bits
        np.testing.assert_equal(getattr(theirs.balance, name), getattr(ours.balance, name))
    assert hdvplan.summary_of(theirs).keys() == hdvplan.summary_of(ours).keys()


@pytest.mark.slow
def test_the_key_depends_on_nothing_but_the_content() -> None:
    show = "from tests.test_case import straight; print(straight().key)"
    for seed in ("1", "2"):
        environment = os.environ | {"PYTHONHASHSEED": seed}
        ended = subprocess.run([sys.executable, "-c", show], cwd=ROOT, env=environment, capture_output=True, text=True, check=True)  # noqa: S603 - our own
        # As computed on x86-64 by Python 3.11. One setting more makes it another key; the same content in another form, another FORMAT.
        assert ended.stdout.strip() == "edd204afbc469d0f2e72a13d24dc8b1f"


def test_the_key_of_a_road_with_obstacles_is_what_it_was() -> None:
    case = straight()
    regions = (Region(Kind.OBSTACLE, shapely.box(40.0, 1.0, 44.0, 3.0), "a van"), Region(Kind.SWEEPABLE, shapely.box(60.0, 2.0, 70.0, 5.0)))
    road = replace(case.road, regions=regions, notes=("a note",), notice="© somebody").within(case.road.limits)
    key = replace(case, road=road, objective="balanced", bias=Bias.constant(0.25)).key
    assert key == "55c1eb3f7d49feaaed16a47454b6b37d"  # as computed on x86-64 by Python 3.11, FORMAT 2: with drawn kerbs


@dataclass(frozen=True)
class Options:
    """What somebody's objective may be made with: fields that are called as others here that decide nothing."""

    name: str = "wide"
    source: float = 1.0
    edges: tuple[float, ...] = (1.0, 2.0)
    notes: str = ""


@pytest.mark.parametrize("change", [{"name": "narrow"}, {"source": 2.0}, {"edges": (1.0, 3.0)}, {"notes": "x"}])
def test_only_fields_that_say_so_decide_nothing(change: dict[str, Any]) -> None:
    one, other = (replace(PLAIN, objective=partial(geometric, options=options)) for options in (Options(), Options(**change)))  # type: ignore[call-arg] # never called
    assert one.key != other.key


@pytest.mark.parametrize(
    "change",
    [
        lambda case: replace(case, objective="balanced"),
        lambda case: replace(case, solver="piqp"),
        lambda case: replace(case, settings=PlannerSettings(step=0.25)),
        lambda case: replace(case, bias=Bias.constant(0.1)),
        lambda case: replace(case, vehicle=replace(case.vehicle, max_curvature=0.09)),
        lambda case: replace(case, vehicle=load_vehicle("rigid-truck")),
        lambda case: replace(case, road=replace(case.road, limits=None)),
        lambda case: replace(case, road=case.road.with_limits(3.0, 3.1)),
        lambda case: replace(case, road=load_road("sturn")),
        lambda case: replace(case, road=replace(case.road, regions=load_road("street_corner").regions)),
    ],
)
def test_whatever_changes_the_plan_changes_the_key(change: Callable[[Case], Case]) -> None:
    assert change(PLAIN).key != PLAIN.key
    assert change(PLAIN) != PLAIN
    assert change(PLAIN) == change(PLAIN)


def test_names_and_places_of_files_are_not_in_the_key(tmp_path: Path) -> None:
    (tmp_path / "elsewhere").mkdir()
    one, other = from_csv(tmp_path), replace(from_csv(tmp_path / "elsewhere"))
    renamed = replace(
        other,
        road=replace(other.road, name="another", notice="© somebody"),
        vehicle=replace(other.vehicle, name="mine", source="a brochure", units=tuple(replace(u, name="x") for u in other.vehicle.units)),
    )
    assert one.key == other.key == renamed.key
    assert {one, other, renamed} == {one}


def test_numbers_count_by_their_value_alone() -> None:
    limits = PLAIN.road.limits
    assert limits is not None
    again = replace(
        PLAIN,
        settings=PlannerSettings(horizon=100, smoothness=1000),
        bias=Bias.constant(-0.0),
        road=replace(PLAIN.road, limits=Limits(limits.s, limits.left, limits.right, limits.left_sweep.copy(), limits.right_sweep)),
    )
    assert again.key == PLAIN.key


def test_a_case_is_not_equal_to_anything_else() -> None:
    assert PLAIN.key != PLAIN


def test_a_case_cannot_hold_what_has_no_content() -> None:
    with pytest.raises(TypeError, match="a case cannot hold a set"):
        _ = replace(PLAIN, objective={"geometric"}).key  # type: ignore[arg-type] # that is the point


def test_a_key_is_not_carried_into_another_version() -> None:
    assert PLAIN.key
    assert "key" not in pickle.loads(pickle.dumps(PLAIN)).__dict__  # noqa: S301 - our own bytes


def test_a_case_describes_itself_to_readers(tmp_path: Path) -> None:
    case = from_csv(tmp_path)
    told = json.loads(json.dumps(case.described(), allow_nan=False))
    assert told["key"] == case.key
    assert told["road"]["name"] == "bend"
    assert told["road"]["length_m"] == case.road.path.length
    assert [unit["wheelbase"] for unit in told["vehicle"]["units"]] == [unit.wheelbase for unit in case.vehicle.units]
    assert (told["objective"], told["solver"], told["settings"]["horizon"]) == ("geometric", "riccati", 50.0)
    assert told["bias_m"]["most"] == 0.2
    assert str(tmp_path) not in json.dumps(told)
    assert case.brief()["settings"] == {"horizon": 50.0}
    assert "settings" not in PLAIN.brief()
    assert PLAIN.described()["bias_m"] == 0.0


def test_a_record_says_what_was_run_with_what_where_and_when(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["/somewhere/bin/hdvplan", "plan", "uturn"])
    write_record(tmp_path, [PLAIN, replace(PLAIN)])
    record = json.loads((tmp_path / "run.json").read_text(encoding="utf-8"))
    assert record["cases"] == [json.loads(json.dumps(PLAIN.described()))]  # once, and whole
    assert record["command"] == ["hdvplan", "plan", "uturn"]
    assert record["commit"] == commit()
    assert record["software"] == software(("riccati",))
    assert record["software"]["packages"]["numpy"] == np.__version__
    assert record["machine"]["python"].split()[1] == sys.version.split()[0]
    assert record["date"].endswith("+00:00")
    several = record_of([PLAIN, replace(PLAIN, solver="piqp")])["cases"]
    assert isinstance(several, list)
    assert [case["solver"] for case in several] == ["riccati", "piqp"]


def test_a_script_s_command_is_recorded_without_its_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.argv", ["/home/somebody/benchmarks/horizon.py", "--rounds", "1"])
    assert command() == ["horizon.py", "--rounds", "1"]


@pytest.mark.parametrize(("left", "right", "side"), [(1e8, 3.0, "left"), (3.0, 1e8, "right"), (1e308, 1e308, "left")])
def test_a_limit_beyond_all_projections_is_refused(left: float, right: float, side: str) -> None:
    """No longitude lies 100,000 km beside a road: what is swept could not be written."""

    def between(left: float, right: float) -> Case:
        ends = np.ones(2)
        return replace(PLAIN, road=PLAIN.road.within(Limits(np.array([0.0, 9.0]), left * ends, -right * ends, left * ends, -right * ends)))

    with pytest.raises(RoadError, match=rf"the {side} limit at s = 0\.0 m is 1e\+\d+ m away; at most 100 km"):
        between(left, right)
    assert between(9999.0, 9999.0).key


def test_a_scheme_and_a_rule_may_be_given_by_their_words() -> None:
    settings = hdvplan.PlannerSettings(scheme="sqp", discretisation="euler")  # type: ignore[arg-type] # as people write it
    assert settings.scheme is Scheme.SQP
    assert settings.discretisation is Discretisation.EULER
