"""No careless or dishonest solver is ranked, and every one is named with the reason."""

# ruff: noqa: ARG002, D101, D102, D105 - solvers that look at some of what they are given, and say in their names what they do

import threading
import time
from collections.abc import Callable
from copy import deepcopy
from dataclasses import replace
from functools import cache
from typing import Any, ClassVar

import numpy as np
import pytest

from hdvplan.arrays import Records
from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.measuring.measure import Bench
from hdvplan.bench.measuring.ranking import findings_of, load_of, ranked_times
from hdvplan.bench.measuring.referee import changed_clocks, remembers
from hdvplan.bench.measuring.samples import NUMBERS, Measurement
from hdvplan.bench.measuring.stats import Tables, tables_of
from hdvplan.bench.suite import Cell, Suite
from hdvplan.planning import planner
from hdvplan.planning.settings import Scheme
from hdvplan.qp import workspace
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status
from hdvplan.solvers.registry import SolverMaker
from hdvplan.solvers.riccati import RiccatiWorkspace
from tests.bench.conftest import made_up
from tests.fakes import Fake, Fault

Measured = Callable[[Callable[[StageShape], QpWorkspace]], Tables]
HIDDEN_S = 5e-3  # that a solver takes and does not tell
PAUSE_S = 5e-3
ROUNDS = 2  # a solver that remembers shows in the second


class Careless:
    """Solves by riccati; what it does before and after is what it is here for."""

    starts_warm = False

    def __init__(self, shape: StageShape) -> None:
        self.name = type(self).__name__
        self._honest, self._solved = RiccatiWorkspace(shape), 0

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        """Return the program that is solved."""
        return qp

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        """Return what is told of the result."""
        return result

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """See ``QpWorkspace``."""
        self._solved += 1
        return self.after(qp, self._honest.solve(self.before(qp, guess), None))._replace(status=Status.SOLVED)


def own(qp: StageQp) -> StageQp:
    return qp.copy()


class WritesOnce(Careless):
    """Writes in the ninth program alone, and least of all: one bit of one number that nobody reads."""

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        if self._solved == 9:
            qp.stages["u_low"][-1] = -0.0
        return qp


class WritesAfterwards(Careless):
    """Restores nothing: writes when the answer is already there."""

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        qp.Q[:] *= 0.5
        return result


class WritesIntoTheGuess(Careless):
    starts_warm = True

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        if guess is not None:
            guess.x[:] += 1.0
        return qp


class DropsRowsOfItsOwnCopy(Careless):
    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        mine = own(qp)
        mine.h[:] = 100.0
        return mine


class CoversRowsWithSlack(Careless):
    """Drops rows, and calls what it breaks elastic."""

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        mine = own(qp)
        mine.h[:] = 100.0
        return mine

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        result.point.sigma[:] = np.maximum(0.0, np.einsum("ijk,ik->ij", qp.G, result.point.x[1:]) - qp.h)
        return result


class WrongNowAndThen(Careless):
    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        if self._solved % 5:
            return qp
        mine = own(qp)
        mine.R[:] *= 300.0
        return mine


class AnswersForTheLastProgram(Careless):
    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        last, self._last = getattr(self, "_last", result.point), deepcopy(result.point)
        return result._replace(point=last)


class AnswersLate(Careless):
    """Returns at once, and lets a thread write the answer where it has promised it."""

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        point, mine = StageSolution.empty(qp.shape), own(qp)

        def answer() -> None:
            time.sleep(2e-3)
            point.copy_from(self._honest.solve(mine, None).point)

        threading.Thread(target=answer).start()
        return QpResult(Status.SOLVED, point, 1, 0.0, 0.0)


class StopsTheClock(Careless):
    """Changes the clock by which steps are timed, for good."""

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        stopped = time.perf_counter()
        planner.perf_counter = time.perf_counter = lambda: stopped  # type: ignore[attr-defined]
        return qp


class SlowsProcessorTime(Careless):
    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        workspace.process_time = lambda: 1e-3 * time.process_time()  # type: ignore[attr-defined]
        return qp


class Sleeps(Careless):
    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        time.sleep(2e-3)
        return qp


class SleepsNowAndThen(Careless):
    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        if self._solved % 5 == 0:
            time.sleep(PAUSE_S)
        return qp


class Remembers(Careless):
    """Keeps every answer that it has found with much work, and looks programs up."""

    known: ClassVar[dict[bytes, StageSolution]] = {}

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        key = qp.buffer.tobytes()
        if key not in self.known:
            for _ in range(60):
                self._honest.solve(qp, None)
            self.known[key] = deepcopy(self._honest.solve(qp, None).point)
        return QpResult(Status.SOLVED, self.known[key], 1, 0.0, 0.0)


class RemembersFromBefore(Careless):
    """Has the answers that another run has kept, and takes its time for what is not among them."""

    kept: ClassVar[dict[bytes, StageSolution]] = {}
    knows: ClassVar[bool] = False

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        key = qp.buffer.tobytes()
        if not (self.knows and key in self.kept):
            for _ in range(60):
                self._honest.solve(qp, None)
            self.kept[key] = deepcopy(self._honest.solve(qp, None).point)
        return QpResult(Status.SOLVED, self.kept[key], 1, 0.0, 0.0)


class RefusesNewPrograms(Careless):
    """Refuses what it was not asked while it was timed."""

    asked: ClassVar[set[bytes]] = set()
    made: ClassVar[list[int]] = []

    def __init__(self, shape: StageShape) -> None:
        super().__init__(shape)
        self.made.append(0)

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        key = qp.buffer.tobytes()
        if len(self.made) > 2 and key not in self.asked:
            msg = "no such answer"
            raise RuntimeError(msg)
        self.asked.add(key)
        return qp


class FairWhenWatched(Careless):
    """Sees by the number of its workspaces whether the reference stands beside it, and does not come then."""

    made: ClassVar[list[int]] = []

    def __init__(self, shape: StageShape) -> None:
        super().__init__(shape)
        self.made.append(0)

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        if len(self.made) == 2:
            msg = "no licence for two"
            raise RuntimeError(msg)
        return qp


class InflatesMultipliers(Careless):
    """Makes residuals small beside its multipliers."""

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        result.point.dynamics[:] = 1e9
        return result


class Rounds(Careless):
    """Prints its answer with three decimals, and reads it back."""

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        result.point.x[:], result.point.u[:] = result.point.x.round(3), result.point.u.round(3)
        return result


class InventsAStatus(Careless):
    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        return self._honest.solve(qp, None)._replace(status="fine")  # type: ignore[arg-type]


class HasNoIterations(Careless):
    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        return result._replace(iterations=None)  # type: ignore[arg-type]


def busy() -> None:
    end = time.process_time() + HIDDEN_S
    while time.process_time() < end:  # who sleeps is not ranked
        pass


class SaysLessTime(Careless):
    """Takes longer, and calls most of it no part of the step."""

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        busy()
        return result._replace(update_time=0.0, solve_time=-1.0, time_aside=1e-3)


class Unread:
    """An array that is computed when anything of it is first asked for."""

    def __init__(self, work: Callable[[], Records]) -> None:
        self._array = cache(work)

    def __array__(self, *_: object, **__: object) -> Records:
        return self._array()

    def __len__(self) -> int:
        return len(self._array())

    def __getattr__(self, name: str) -> object:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._array(), name)


class UnreadPoint(StageSolution):
    """A point that is computed when anything of it is first asked for."""

    def __getattribute__(self, name: str) -> Any:  # noqa: ANN401 - whatever is asked for
        own = object.__getattribute__(self, "__dict__")
        if "work" in own and not name.startswith("__"):
            own.pop("work")()
        return super().__getattribute__(name)


class SolvesWhenRead(Careless):
    """Returns at once, and solves when somebody reads the answer."""

    def found(self, qp: StageQp) -> StageSolution:
        busy()
        return self._honest.solve(qp, None).point

    def answer(self, qp: StageQp) -> StageSolution:
        point = UnreadPoint(*vars(StageSolution.empty(qp.shape)).values())
        vars(point)["work"] = lambda: point.copy_from(self.found(qp))
        return point

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        return QpResult(Status.SOLVED, self.answer(qp), 1, 0.0, 0.0)


class SolvesWhenAnArrayIsRead(SolvesWhenRead):
    def answer(self, qp: StageQp) -> StageSolution:
        return StageSolution(Unread(lambda: self.found(qp).stages), Unread(lambda: self.found(qp).row_points))  # type: ignore[arg-type]


class ChangesItsPoint(Careless):
    """Writes over its last point, which it has kept, when the next program comes."""

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        if hasattr(self, "_kept"):
            self._kept.x[:] = np.nan
        return qp

    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        self._kept = deepcopy(result.point)
        return result._replace(point=self._kept)


WRITES = "writes into the program that it is given"
CARELESS: dict[type[Careless] | Fault, tuple[str, str]] = {  # what it does: its status, and words of the reason
    WritesOnce: ("failed", WRITES),
    WritesAfterwards: ("failed", WRITES),
    WritesIntoTheGuess: ("failed", "writes into the program or the guess that it is given"),
    DropsRowsOfItsOwnCopy: ("failed", "DropsRowsOfItsOwnCopy says solved, primal residual 0.02"),
    CoversRowsWithSlack: ("wrong optimum", "from the reference's"),
    WrongNowAndThen: ("wrong optimum", "from the reference's"),
    AnswersForTheLastProgram: ("some steps not solved", "break their program"),
    AnswersLate: ("failed", "primal residual"),
    StopsTheClock: ("unfair", "changes clocks: hdvplan.planning.planner.perf_counter, time.perf_counter"),
    SlowsProcessorTime: ("unfair", "changes clocks: hdvplan.qp.workspace.process_time"),
    Sleeps: ("unfair", "waits instead of working"),
    Remembers: ("unfair", "remembers answers"),
    RefusesNewPrograms: ("unfair", "fails at programs that are new to it: solver"),
    FairWhenWatched: ("failed", "driven again beside the reference it ends after 0 of"),
    InflatesMultipliers: ("some steps not accepted", "dual residual"),
    Rounds: ("failed", "Rounds says solved, primal residual 0.00"),
    InventsAStatus: ("failed", "'fine' is not a valid Status"),
    HasNoIterations: ("failed", "iterations that are none"),
    "without multipliers": ("some steps not accepted", "dual residual"),
    "raising": ("failed", "no licence"),
    "not a number": ("some steps not solved", "break their program"),
    "nothing": ("failed", "NoneType, not a QpResult"),
    "leaving": ("failed", "SystemExit"),
    "panicking": ("failed", "index out of bounds"),
    "another shape": ("failed", "a point of another shape"),
}
LATER: set[Fault] = {"raising", "not a number", "nothing", "leaving", "panicking", "another shape"}


@pytest.fixture(autouse=True)
def _clocks_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, name in ((planner, "perf_counter"), (workspace, "process_time"), (time, "perf_counter")):
        monkeypatch.setattr(module, name, getattr(module, name))  # set back afterwards
    FairWhenWatched.made.clear()
    Remembers.known.clear()
    RemembersFromBefore.kept.clear()
    RefusesNewPrograms.made.clear()


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Measured:
    """Return what measures a solver, in whose place piqp stands, beside riccati, which is measured once."""
    road = tmp_path_factory.mktemp("road") / "short.csv"
    road.write_text("s,kappa\n0,0\n20,0\n30,0.03\n40,0\n60,0\n", encoding="utf-8")
    suite = Suite(roads=(str(road),), vehicles=("bus",), solvers=("riccati", "piqp"), schemes=("rti",), rounds=ROUNDS, horizon=30.0)
    suite = replace(suite, half_width=1.68)  # limits bind: only then is there anything to drop
    cases = cases_of(suite)

    def rounds(cell: int, solver: Callable[[StageShape], QpWorkspace] | str) -> list[Measurement]:
        measure = Bench(suite, cases, {suite.solvers[cell]: SolverMaker(solver)}, lambda _: None)
        return [measure(cell, judged=number == 0) for number in range(ROUNDS)]

    reference = rounds(0, "riccati")
    return lambda solver: tables_of(suite.cells(), [reference, rounds(1, solver)])


def ranked(tables: Tables) -> set[str]:
    return set(tables.summary.loc[tables.summary["proved"].astype(bool), "solver"])


def test_a_memory_that_another_run_has_filled_is_told_by_programs_that_nobody_can_know(
    bench: Measured, monkeypatch: pytest.MonkeyPatch
) -> None:
    tables = bench(RemembersFromBefore)
    assert ranked(tables) == {"riccati", "piqp"}, tables.timing["message"]  # slow, and honest
    monkeypatch.setattr(RemembersFromBefore, "knows", True)
    tables = bench(RemembersFromBefore)
    row = tables.timing.set_index("solver").loc["piqp"]
    assert (row["status"], "remembers answers: programs that are new to it" in row["message"]) == ("unfair", True), row["message"]
    assert ranked(tables) == {"riccati"}


@pytest.mark.parametrize("who", CARELESS, ids=lambda who: who if isinstance(who, str) else who.__name__)
def test_no_careless_or_dishonest_solver_is_ranked_and_its_row_says_why(
    bench: Measured, who: type[Careless] | Fault, monkeypatch: pytest.MonkeyPatch
) -> None:
    status, words = CARELESS[who]
    if status != "unfair":  # on a busy machine one that has threads waits, too
        monkeypatch.setattr("hdvplan.bench.measuring.referee._WAITS", np.inf)
    tables = bench(Fake(who, honest=8 if who in LATER else 0) if isinstance(who, str) else who)
    row = tables.timing.set_index("solver").loc["piqp"]
    assert (row["status"], words in row["message"]) == (status, True), row["message"]
    assert ranked(tables) == {"riccati"}
    (finding,) = findings_of(tables.summary, load_of(tables.summary, [], None, None, ""))
    assert "; not ranked with it: piqp" in finding.text


@pytest.mark.parametrize("who", [SaysLessTime, SolvesWhenRead, SolvesWhenAnArrayIsRead])
def test_a_solver_that_hides_its_time_is_told_by_the_clock(bench: Measured, who: type[Careless], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.bench.measuring.referee._WAITS", np.inf)  # on a busy machine all do
    told = bench(who)
    assert ranked(told) == {"riccati", "piqp"}
    assert told.timing.set_index("solver")["solve_ms"]["piqp"] >= 1e3 * HIDDEN_S  # the honest one takes some 0.1 ms


def test_processor_time_is_that_of_the_processor_whatever_the_clock_says(bench: Measured) -> None:
    steps = bench(SleepsNowAndThen).samples.query("solver == 'piqp'")
    waited = steps["total_s"] - steps["cpu_s"]
    assert waited.max() > 0.9 * PAUSE_S  # the processor's clock ticks apart from the other
    assert (steps["cpu_s"] > 0.0).all()
    assert (steps.loc[waited > 0.5 * PAUSE_S, "waits"] > 0).any()  # another may be a busy machine's
    assert ranked_times(steps)["ms"].max() > 0.9e3 * PAUSE_S  # in every round the same steps
    ours = bench(SleepsNowAndThen).samples.query("solver == 'riccati'")
    assert ours["waits"].median() == 0.0  # neighbours on the same core are none of its own


def test_a_point_that_changes_after_it_was_returned_changes_nothing(bench: Measured) -> None:
    assert ranked(bench(ChangesItsPoint)) == {"riccati", "piqp"}


def test_a_path_apart_from_the_reference_s_is_not_ok_however_good_its_steps_look() -> None:
    cells, rounds = [Cell("road", "bus", Scheme.RTI, name) for name in ("riccati", "piqp")], [made_up([0.1, 0.01, 0.01])]
    for shift, status in ((9e-4, "ok"), (1.1e-3, "wrong path")):  # a millimetre is the limit
        tables = tables_of(cells, [rounds, [made_up([0.1, 0.01, 0.01], shift=shift)]])
        assert tables.timing.set_index("solver").loc["piqp", "status"] == status
    assert "its path lies up to 1.1e-03 m from that of riccati" in set(tables.timing["message"])


def test_memory_is_told_by_time_only_where_there_is_enough_of_it() -> None:
    def steps(*seconds: float) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        table = np.zeros((len(seconds), len(NUMBERS)))
        table[:, NUMBERS.index("cpu_s")] = seconds
        return table

    assert remembers([steps(5.0, 5.0, 5.0, 5.0), steps(1.0, 1.0, 1.0, 1.0)])
    assert not remembers([steps(2.0, 2.0, 2.0, 2.0), steps(1.0, 1.0, 1.0, 1.0)])  # a machine that was busy in the first round
    assert not remembers([steps(5.0, 1.0, 1.0, 1.0), steps(1.0, 1.0, 1.0, 1.0)])  # a solver that sets up
    assert not remembers([steps(5.0, 5.0, 5.0, 5.0)])
    assert not remembers([steps(5.0), steps(1.0)])


def test_the_clocks_of_this_process_are_the_system_s() -> None:
    assert changed_clocks() == []
