"""What a suite's entries say, and the roads with limits that they ask for."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely

from hdvplan.api import drive_case
from hdvplan.bench.comparing.work import placed
from hdvplan.bench.measuring.courses import PINCH_LENGTH_M, PINCH_RAMP_M, cases_of, with_limits
from hdvplan.bench.suite import GIVEN, Cell, Suite, read_suite, suite_of, visits
from hdvplan.case import Case
from hdvplan.errors import OptionError, RoadError, SolverError
from hdvplan.planning.objectives import OBJECTIVES
from hdvplan.road.limits import Limits
from hdvplan.road.load import find_road, load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.registry import check_solver, tolerance_of
from hdvplan.vehicle.load import load_vehicle


def test_every_cell_is_visited_once_a_round() -> None:
    order = visits(courses=5, cells=8, rounds=3)
    assert [round_ for round_, _ in order] == [0] * 40 + [1] * 40 + [2] * 40
    for round_ in range(3):
        assert sorted(cell for visited, cell in order if visited == round_) == list(range(40))


def test_what_is_compared_lies_side_by_side_and_nothing_always_comes_first() -> None:
    order = visits(courses=5, cells=8, rounds=4)
    blocks = [[cell for _, cell in order[start : start + 8]] for start in range(0, len(order), 8)]
    assert all(len({cell // 8 for cell in block}) == 1 for block in blocks)  # one road and vehicle at a time
    of_first_course = [tuple(block) for block in blocks if block[0] < 8]
    assert len(set(of_first_course)) == 4  # in another order each round
    assert len({block[0] // 8 for block in blocks[::5]}) > 1  # and rounds begin on different courses


def test_a_suite_survives_writing_and_reading() -> None:
    suite = Suite(roads=("uturn",), pinch=1.5, rounds=1)
    assert suite_of({name: value for name, value in suite.to_dict().items() if value is not None}) == suite
    assert suite_of(suite.to_dict()) == suite


def test_the_committed_suites_are_valid_and_name_what_ships() -> None:
    folder = Path(__file__).parents[2] / "benchmarks"
    for name in ("suite", "headline", "inactive", "pinch", "solvers", "counters"):
        suite = suite_of(read_suite(folder / f"{name}.toml"))
        for road in suite.roads:
            find_road(road)  # reads the file; smoothing it is for tests of roads
        for vehicle in suite.vehicles:
            load_vehicle(vehicle)
        for solver in suite.solvers:
            try:
                check_solver(solver)
            except SolverError as error:  # of a suite that needs an extra
                assert str(error) == f"solver {solver!r} is not installed"  # noqa: PT017 - where there is none it is installed


def test_every_native_solver_tells_the_tolerance_it_runs_with() -> None:
    assert all((tolerance_of(name) or 1.0) <= 1e-5 for name in Suite().solvers)
    assert tolerance_of("qpsolvers/daqp") is None  # at its own default


@pytest.mark.parametrize("name", [*OBJECTIVES, "art-weighted:0.45"])
def test_a_suite_has_any_one_objective(name: str) -> None:
    assert suite_of({"objective": name}).objective == name


def test_a_suite_refuses_an_objective_that_nobody_knows() -> None:
    with pytest.raises(OptionError, match="unknown objective"):
        Suite(objective="balance")
    with pytest.raises(OptionError, match="must be words in quotes"):
        suite_of({"objective": 3})


def test_files_of_a_suite_lie_beside_it_or_in_the_working_directory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "suites"
    folder.mkdir()
    (folder / "own.geojson").touch()
    (tmp_path / "here.geojson").touch()
    (folder / "suite.toml").write_text('roads = ["own.geojson", "here.geojson", "uturn"]\n', encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    suite = suite_of(read_suite(folder / "suite.toml"))
    assert suite.roads == ("own.geojson", "here.geojson", "uturn")  # the names of cells, from wherever it is read
    assert [suite.file(road) for road in suite.roads] == [folder / "own.geojson", Path("here.geojson"), None]
    assert "files" not in suite.to_dict()  # they differ by the folder in which a benchmark starts
    assert placed(suite).roads == (str(folder / "own.geojson"), str(tmp_path / "here.geojson"), "uturn")
    (folder / "told.toml").write_text('roads = ["uturn"]\nfiles = {uturn = "own.geojson"}\n', encoding="utf-8")
    with pytest.raises(OptionError, match="unknown entry 'files'"):
        read_suite(folder / "told.toml")
    (tmp_path / "own.geojson").touch()
    assert suite_of(read_suite(folder / "suite.toml", {"roads": ["own.geojson"]})).file("own.geojson") == Path("own.geojson")


BUS = load_vehicle("bus")
SUITE = Suite(roads=("uturn",), vehicles=("bus",))


def limits(road: Road, suite: Suite) -> Limits:
    found = with_limits(road, BUS, suite).limits
    assert found is not None
    return found


def test_limits_lie_beyond_the_geometric_half_width_of_the_tightest_bend() -> None:
    found = limits(SCENARIOS["uturn"](), replace(SUITE, slack=0.4))
    # 2.486 m is the published geometric expectation of this U-turn, to its printed millimetre.
    np.testing.assert_allclose(found.left, 2.486 + 0.4, atol=1e-3)
    np.testing.assert_array_equal(found.right, -found.left)


def test_roads_of_a_junction_are_chosen_as_in_plan() -> None:
    (case,) = cases_of(suite_of({"roads": ["neuweiler"], "vehicles": ["bus"], "schemes": ["rti"], "solvers": ["piqp"], "road_ids": "0,5"}))
    assert case.road.path.length == load_road("neuweiler", RoadOptions(road_ids="0,5")).path.length
    with pytest.raises(RoadError, match=r"has no use for --road-ids|has no road ids"):
        cases_of(replace(SUITE, road_ids="0,5"))


def test_limits_beyond_the_half_width_bind_nowhere_however_far_smoothing_moves_the_line(tmp_path: Path) -> None:
    """Beside the line as given they would lie 0.6 m within the room of a bus that follows a curve of 25 m for a corner."""
    (tmp_path / "corner.csv").write_text("x,y\n0,0\n60,0\n60,60\n", encoding="utf-8")
    road = load_road(tmp_path / "corner.csv", RoadOptions(smooth=5.0, max_curvature=0.04))
    assert road.smoothing is not None
    assert road.smoothing.max_deviation > 2.0 * SUITE.slack
    drive = drive_case(Case(with_limits(road, BUS, SUITE), BUS))
    assert all(plan.merit is None for plan in drive.plans)


def test_a_road_keeps_its_own_limits_and_obstacles_where_these_are_asked_for() -> None:
    road = load_road("parked_van")
    assert with_limits(road, BUS, SUITE, GIVEN) is road
    with pytest.raises(RoadError, match="sturn has no limits of its own"):
        with_limits(SCENARIOS["sturn"](), BUS, SUITE, GIVEN)


def test_without_limits_a_road_loses_its_own() -> None:
    road = SCENARIOS["uturn"]()
    assert road.limits is not None
    assert with_limits(road, BUS, replace(SUITE, limits=False)).limits is None


@pytest.mark.parametrize("turn", [1.0, -1.0])
def test_a_pinch_narrows_the_outer_side_in_the_middle_of_the_tightest_bend(turn: float) -> None:
    profile = np.array([0.0, 30.0, 40.0, 70.0, 80.0, 110.0]), turn * np.array([0.0, 0.0, 0.05, 0.05, 0.0, 0.0])
    found = limits(Road("bend", from_curvature(*profile)), replace(SUITE, half_width=3.0, pinch=1.25))
    outer, inner = (-found.right, found.left) if turn > 0 else (found.left, -found.right)
    assert set(inner) == {3.0}
    assert outer.min() == 1.75
    deep = found.s[outer == outer.min()]
    # The middle of the constant part is at 55 m; limits are sampled every 0.25 m, and its ends are found to two samples.
    assert deep.mean() == pytest.approx(55.0, abs=0.5)
    assert np.ptp(deep) == pytest.approx(PINCH_LENGTH_M, abs=0.5)
    touched = found.s[outer < 3.0]
    assert np.ptp(touched) == pytest.approx(PINCH_LENGTH_M + 2 * PINCH_RAMP_M, abs=1.0)


def test_obstacles_cut_pinched_limits_too() -> None:
    road = replace(SCENARIOS["uturn"](), regions=(Region(Kind.OBSTACLE, shapely.box(20.0, 1.5, 25.0, 4.0)),))
    for pinch in (None, 1.0):
        found = with_limits(road, BUS, replace(SUITE, half_width=3.0, pinch=pinch)).passable
        assert found is not None
        assert found.table(np.array([22.0]))[0, 0] == pytest.approx(1.5, abs=1e-6)  # a foot on a quintic is exact to 1e-9 m


def test_a_pinch_that_closes_the_road_is_refused() -> None:
    with pytest.raises(RoadError, match=r"closes uturn, whose limits are 5\.97 m apart"):
        with_limits(SCENARIOS["uturn"](), BUS, replace(SUITE, pinch=6.0))


def test_cases_come_in_the_order_of_the_suite_s_cells() -> None:
    suite = Suite(roads=("uturn", "sturn"), vehicles=("tractor-trailer", "bus"), objective="balanced", horizon=30.0)
    found = [Cell(case.road.name, case.vehicle.name, case.settings.scheme, case.solver_name) for case in cases_of(suite)]
    assert found == suite.cells()
    assert {(case.objective, case.settings.horizon) for case in cases_of(suite)} == {("balanced", 30.0)}
