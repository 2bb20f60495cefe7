from __future__ import annotations

from pathlib import Path

import pytest

from hdvplan.bench.suite import Suite, read_suite, suite_of, visits
from hdvplan.errors import OptionError
from hdvplan.planning.objectives import OBJECTIVES
from hdvplan.planning.settings import Scheme
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


def test_the_order_is_the_same_in_every_session() -> None:
    assert visits(7, 4, 3) == visits(7, 4, 3)


def test_cells_are_all_combinations_with_those_of_a_course_together() -> None:
    cells = Suite(roads=("a", "b"), vehicles=("bus",), solvers=("riccati", "osqp")).cells()
    assert len(cells) == 8
    assert {cell.road for cell in cells[:4]} == {"a"}
    assert [(cell.scheme, cell.solver) for cell in cells[:4]] == [
        (Scheme.RTI, "riccati"), (Scheme.RTI, "osqp"), (Scheme.SQP, "riccati"), (Scheme.SQP, "osqp")
    ]  # fmt: skip


def test_a_suite_survives_writing_and_reading() -> None:
    suite = Suite(roads=("uturn",), pinch=1.5, rounds=1)
    assert suite_of({name: value for name, value in suite.to_dict().items() if value is not None}) == suite
    assert suite_of(suite.to_dict()) == suite


def test_a_suite_is_read_from_toml(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('roads = ["uturn"]\nschemes = ["rti"]\nrounds = 5\nhalf_width = 3\n', encoding="utf-8")
    suite = suite_of(read_suite(file))
    assert (suite.roads, suite.schemes, suite.rounds, suite.half_width) == (("uturn",), ("rti",), 5, 3.0)
    assert suite.solvers == Suite().solvers


def test_the_committed_suites_are_valid_and_name_what_ships() -> None:
    folder = Path(__file__).parents[2] / "benchmarks"
    for name in ("suite", "headline", "inactive", "pinch", "solvers", "counters"):
        suite = suite_of(read_suite(folder / f"{name}.toml"))
        for road in suite.roads:
            find_road(road)  # reads the file; smoothing it is for tests of roads
        for vehicle in suite.vehicles:
            load_vehicle(vehicle)
        for solver in suite.solvers:
            check_solver(solver)


@pytest.mark.parametrize(
    ("entries", "words"),
    [
        ({"raods": ["uturn"]}, "unknown entry 'raods'"),
        ({"roads": []}, "at least one"),
        ({"roads": "uturn"}, "a list of names"),
        ({"solvers": ["osqp", "osqp"]}, "none twice"),
        ({"schemes": ["fast"]}, "unknown scheme 'fast'"),
        ({"rounds": 0}, "rounds must be a positive number"),
        ({"rounds": 1.5}, "rounds must be a whole number"),
        ({"budget": -1}, "budget must be a positive number"),
        ({"budget": float("nan")}, "budget must be a positive number"),
        ({"slack": -0.1}, "slack must be zero or a positive number"),
        ({"limits": 1}, "true or false"),
        ({"limits": False, "pinch": 1.0}, "without limits"),
        ({"horizon": 7.3}, "not a whole number of steps"),
    ],
)  # fmt: skip
def test_a_suite_that_cannot_be_measured_is_refused(entries: dict[str, object], words: str) -> None:
    with pytest.raises(OptionError, match=words):
        suite_of(entries)


def test_a_file_that_is_no_suite_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="cannot be read"):
        read_suite(tmp_path / "none.toml")
    (tmp_path / "bad.toml").write_text("roads = [", encoding="utf-8")
    with pytest.raises(OptionError, match="not valid TOML"):
        read_suite(tmp_path / "bad.toml")


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


@pytest.mark.parametrize("text", ["rounds = " + "9" * 5000, "roads = " + "[" * 5000], ids=["too many digits", "too deep"])
def test_toml_that_python_itself_gives_up_on_is_refused_in_a_line(tmp_path: Path, text: str) -> None:
    (tmp_path / "suite.toml").write_text(text, encoding="utf-8")
    with pytest.raises(OptionError, match=r"^suite .*suite\.toml is not valid TOML: "):
        read_suite(tmp_path / "suite.toml")
