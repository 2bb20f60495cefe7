from __future__ import annotations

from pathlib import Path

import pytest

from hdvplan.bench.comparing.work import placed
from hdvplan.bench.suite import Suite, read_suite, suite_of, visits
from hdvplan.errors import OptionError, SolverError
from hdvplan.planning.objectives import OBJECTIVES
from hdvplan.road.load import find_road
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
