"""The contract that authors hold their solvers to: ours keep it, and each lie breaks the rule that is about it."""

# ruff: noqa: ARG001, ARG002 - every lie is told all that there is to lie about

import json
import time
from collections.abc import Callable

import numpy as np
import pytest

from hdvplan.bench import contract
from hdvplan.bench.contract import CONTRACT, Rule, samples
from hdvplan.bench.measuring.recording import LIMITS
from hdvplan.cli.app import run
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status
from hdvplan.solvers.registry import solver_named


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
@pytest.mark.parametrize("name", ["clarabel", pytest.param("osqp", marks=pytest.mark.xfail(strict=True, reason="unkeepable limits"))])
def test_the_slower_ones_keep_every_rule(name: str) -> None:
    broken = [finding for finding in contract.checked(solver_named(name)) if not finding.kept]
    assert not broken


class Liar:
    """The default solver, whose results are bent."""

    name, starts_warm = "liar", False

    def __init__(self, shape: StageShape, bend: Callable[["Liar", StageQp, StageSolution | None, QpResult], QpResult]) -> None:
        """Keep the solver and the lie."""
        self.own, self.bend = solver_named("riccati")(shape), bend
        self.last: QpResult | None = None

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve, and lie."""
        result = self.own.solve(qp, guess)
        return self.bend(self, qp, guess, result)


def wrong_optimum(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    result.point.u[:] += 0.01
    return result


def no_multipliers(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    result.point.dynamics[:] = 0.0
    return result


def always_solved(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    return result._replace(status=Status.SOLVED)


def writes_to_the_program(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    qp.buffer[0] += 1.0
    return result


def clears_the_program(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    qp.q[:] = 0.0  # which shows once only
    return result


def writes_to_the_guess(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    if guess is not None:
        guess.x[:] += 1.0
    return result


def follows_the_guess(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    if guess is not None:
        result.point.copy_from(guess)
    return result


def repeats_itself(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    liar.last = liar.last or result._replace(point=StageSolution(result.point.stages.copy(), result.point.row_points.copy()))
    return liar.last


def breaks_bounds(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    result.point.u[:] *= 1.5
    return result


def hides_time(liar: Liar, qp: StageQp, guess: StageSolution | None, result: QpResult) -> QpResult:
    time.sleep(0.002)
    return result


LIES = [
    (wrong_optimum, contract.same_optimum), (no_multipliers, contract.honest_status), (always_solved, contract.unsolvable_is_said),
    (writes_to_the_program, contract.data_are_left_alone), (writes_to_the_guess, contract.guess_changes_only_the_way),
    (follows_the_guess, contract.guess_changes_only_the_way), (repeats_itself, contract.update_equals_fresh),
    (breaks_bounds, contract.bounds_are_kept), (hides_time, contract.times_are_true),
]  # fmt: skip


@pytest.mark.parametrize(("lie", "rule"), LIES, ids=lambda value: value.__name__)
def test_each_lie_breaks_the_rule_that_is_about_it(lie: Callable[..., QpResult], rule: Rule) -> None:
    assert not rule(lambda shape: Liar(shape, lie), samples()).kept


def test_a_solver_that_clears_its_programs_is_found_whatever_rules_came_before() -> None:
    findings = contract.checked(lambda shape: Liar(shape, clears_the_program))
    (written,) = (finding for finding in findings if finding.rule.startswith("The program is not written to"))
    assert not written.kept
    assert contract.same_optimum(solver_named("riccati"), samples()).kept  # who comes next meets none of the spoiled programs


def test_a_solver_that_takes_nan_breaks_a_rule() -> None:
    class Careless(Liar):
        def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
            qp.buffer[~np.isfinite(qp.buffer)] = 0.0
            return super().solve(qp, guess)

    finding = contract.bad_data_is_refused(lambda shape: Careless(shape, lambda _liar, _qp, _guess, result: result), samples())
    assert not finding.kept
    assert "A = nan" in finding.said


def test_the_command_prints_every_rule_and_fails_with_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["solvers", "--check", "riccati"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert sum(line.startswith("ok ") for line in lines) == len(CONTRACT)
    assert run(["solvers", "--check", "tests.bench.test_contract:Late", "--json"]) == 1
    findings = json.loads(capsys.readouterr().out)
    assert {finding["said"] for finding in findings} >= {
        "SolverError: solver 'tests.bench.test_contract:Late' raises ZeroDivisionError: late"
    }
    assert run(["solvers", "--check", "nosuch"]) == 2


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
