"""The contract that authors hold their solvers to: ours keep it, and each lie breaks the rule that is about it."""

# ruff: noqa: ARG002, D101, D102 - every lie is told all that there is to lie about, and said in its name

import json
import re
from threading import Event

import numpy as np
import pytest

from hdvplan.bench import contract
from hdvplan.bench.contract import CONTRACT, Rule, samples
from hdvplan.bench.measuring.recording import LIMITS
from hdvplan.cli import console
from hdvplan.cli.app import run
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status, WorkspaceMaker
from hdvplan.solvers import guards
from hdvplan.solvers.registry import solver_named
from tests.bench.test_referee import AnswersForTheLastProgram, Careless, Sleeps, WritesAfterwards, WritesIntoTheGuess, WrongNowAndThen
from tests.fakes import Fake


def test_the_samples_have_every_role_of_limits() -> None:
    roles = [each.limits for each in samples()]
    assert all(roles.count(role) >= 6 for role in LIMITS)


@pytest.mark.parametrize("rule", CONTRACT, ids=lambda rule: rule.__name__)
@pytest.mark.parametrize("name", ["riccati", "piqp"])
def test_ours_keep_every_rule(name: str, rule: Rule) -> None:
    finding = rule(solver_named(name), samples())
    assert finding.kept, finding.said


@pytest.mark.slow
# OSQP calls few of the unkeepable programs solved since they have rows between stations: their multipliers are larger.
@pytest.mark.parametrize(
    "name",
    ["clarabel", pytest.param("osqp", marks=[pytest.mark.nightly, pytest.mark.xfail(strict=True, reason="unkeepable limits")])],
)
def test_the_slower_ones_keep_every_rule(name: str) -> None:
    broken = [finding for finding in contract.checked(solver_named(name)) if not finding.kept]
    assert not broken


class FollowsTheGuess(Careless):
    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        result = super().solve(qp, None)
        if guess is not None:
            result.point.copy_from(guess)
        return result


class BreaksBounds(Careless):
    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        result.point.u[:] *= 1.5
        return result


class ClearsThePrograms(Careless):
    def after(self, qp: StageQp, result: QpResult) -> QpResult:
        qp.q[:] = 0.0  # which shows once only
        return result


class TakesNan(Careless):
    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        qp.buffer[~np.isfinite(qp.buffer)] = 0.0
        return qp


# Solvers that the referee of benchmarks knows, too; they call everything solved.
LIES: list[tuple[WorkspaceMaker, Rule]] = [
    (WrongNowAndThen, contract.same_optimum), (Fake("without multipliers"), contract.honest_status),
    (Careless, contract.unsolvable_is_said), (WritesAfterwards, contract.data_are_left_alone),
    (WritesIntoTheGuess, contract.guess_changes_only_the_way), (FollowsTheGuess, contract.guess_changes_only_the_way),
    (AnswersForTheLastProgram, contract.update_equals_fresh),
    (BreaksBounds, contract.bounds_are_kept), (Sleeps, contract.times_are_true), (TakesNan, contract.bad_data_is_refused),
]  # fmt: skip


@pytest.mark.parametrize(("lie", "rule"), LIES, ids=lambda value: getattr(value, "__name__", "fake"))
def test_each_lie_breaks_the_rule_that_is_about_it(lie: WorkspaceMaker, rule: Rule) -> None:
    assert not rule(lie, samples()).kept


def test_a_broken_rule_says_what_is_allowed_and_which_program_is_the_worst() -> None:
    finding = contract.same_optimum(WrongNowAndThen, samples())
    assert re.search(r"\(allowed 0\.001 m, rad or 1/m; most in samples\(\)\[\d+\], limits \w+\)$", finding.said)


class GivesUpAtOne(Careless):
    """Says of one program that it has no solution, and of the others what is true."""

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        result = super().solve(qp, guess)
        if np.array_equal(qp.buffer, samples()[7].qp.buffer):
            result.point.x[:] = np.nan
            return result._replace(status=Status.FAILED)
        return result


def test_a_program_that_is_said_to_be_unsolved_breaks_no_other_rule() -> None:
    findings = {rule: rule(GivesUpAtOne, samples()) for rule in CONTRACT if rule is not contract.times_are_true}
    careless = [contract.unsolvable_is_said]  # which it calls solved, as all lies do
    assert [rule for rule, finding in findings.items() if not finding.kept] == careless
    assert findings[contract.honest_status].said.endswith(f"; not solved: 1 with limits {samples()[7].limits}, first samples()[7]")
    assert "most in" not in findings[contract.unsolvable_is_said].said


class ForgetsAfterTheFirst(Careless):
    """Solves one program, and then says of all that it cannot."""

    solved = False

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        result = super().solve(qp, guess)
        status, self.solved = Status.FAILED if self.solved else result.status, True
        result.point.x[:] += 1.0 * (status is Status.FAILED)
        return result._replace(status=status)


@pytest.mark.parametrize("rule", [contract.same_optimum, contract.update_equals_fresh, contract.guess_changes_only_the_way])
def test_what_a_new_workspace_solves_an_old_one_must_solve(rule: Rule) -> None:
    assert not rule(ForgetsAfterTheFirst, samples()).kept


def test_a_solver_that_clears_its_programs_is_found_whatever_rules_came_before() -> None:
    findings = contract.checked(ClearsThePrograms)
    (written,) = (finding for finding in findings if finding.rule.startswith("The program is not written to"))
    assert not written.kept
    assert contract.same_optimum(solver_named("riccati"), samples()).kept  # who comes next meets none of the spoiled programs


def test_the_command_prints_every_rule_and_fails_with_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solvers", "--check", "riccati"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("ok ") for line in lines) == len(CONTRACT)
    assert run(["solvers", "--check", "tests.bench.test_contract:Late", "--json"]) == 1
    findings = json.loads(capsys.readouterr().out)
    said = "SolverError: solver 'tests.bench.test_contract:Late' raises ZeroDivisionError: late (test_contract.py, line "
    assert sum(finding["said"].startswith(said) for finding in findings) > 1
    assert run(["solvers", "--check", "tests.bench.test_contract:Late"]) == 1
    captured = capsys.readouterr()
    assert captured.out.count("raises ZeroDivisionError: late") == 1  # of rules that it breaks alike, the first says how
    assert "docs/extending.md" in captured.err
    assert run(["solvers", "--check", "nosuch"]) == 2


def test_a_solver_that_is_late_once_is_not_asked_again(capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    contract.checked(solver_named("riccati"))  # counts what rules ask for, once, without the limit
    monkeypatch.setattr(guards, "LIMIT_S", 0.2)
    monkeypatch.setattr(console, "_TELL_S", 0.0)
    assert run(["solvers", "--check", "tests.bench.test_contract:Stuck"]) == 1
    told = capsys.readouterr()
    assert told.out.count("LateError: no answer within 0.2 s after 3 programs") == 1
    assert told.out.count(": the same as of rule 1") == len(CONTRACT) - 1
    assert f"checking rule 1 of {len(CONTRACT)}: " in told.err


def test_every_program_that_a_rule_asks_for_is_the_same_progress() -> None:
    """A rule that asks three times for each stood at its end after a third, and the time that was left did not shrink."""
    shares: list[float] = []
    contract.checked(solver_named("riccati"), on_progress=shares.append)
    assert shares[-1] < 1.0
    assert np.allclose(np.diff(shares), shares[0], rtol=1e-9)  # to rounding


class Stuck(Careless):
    """A solver that answers three times."""

    asked = 0

    def before(self, qp: StageQp, guess: StageSolution | None) -> StageQp:
        Stuck.asked += 1
        if Stuck.asked > 3:
            Event().wait(60.0)
        return super().before(qp, guess)


def test_a_solver_that_cannot_be_made_is_refused_before_anything_compiles(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contract, "samples", lambda: pytest.fail("programs were planned"))
    assert run(["solvers", "--check", "tests.bench.test_contract:Unmade"]) == 2
    assert "no licence" in capsys.readouterr().err


class Unmade:
    """A solver that cannot be made."""

    name, starts_warm = "unmade", False

    def __init__(self, shape: StageShape) -> None:
        """Refuse."""
        msg = "no licence"
        raise OSError(msg)


class Late:
    """A solver that raises."""

    name, starts_warm = "late", False

    def __init__(self, shape: StageShape) -> None:
        """Do nothing."""

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Raise."""
        raise ZeroDivisionError("late")  # noqa: EM101 - an author's own way


def test_the_times_of_another_s_solver_are_not_said_to_be_true() -> None:
    finding = contract.times_are_true(solver_named(Sleeps), contract.samples()[:1])
    assert finding.kept
    assert finding.said == "not asked of it: hdvplan times its calls"
