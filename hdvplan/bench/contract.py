"""What planning requires of every solver, as checks that its author can run: on programs of real planning, invalid ones among them.

``hdvplan solvers --check NAME`` prints them. In a test suite::

    @pytest.mark.parametrize("rule", CONTRACT, ids=lambda rule: rule.__name__)
    def test_my_solver_keeps(rule: Rule) -> None:
        finding = rule(hdvplan.solver(MySolver), samples())
        assert finding.kept, finding.said
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache
from time import perf_counter

import numpy as np

from hdvplan.bench.measuring.recording import LIMITS, Recorded, record
from hdvplan.case import Case
from hdvplan.errors import QpDataError
from hdvplan.planning.settings import PlannerSettings
from hdvplan.plugins import error_text, raised_at
from hdvplan.qp.program import NAMES, StageQp, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Status, WorkspaceMaker, residuals
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.guards import Watch
from hdvplan.solvers.registry import is_foreign
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle

AGREE_M = 1e-3  # largest difference of a state or input from the reference's [m, rad, 1/m]: what a planning step is driven with
PRIMAL = 1e-3  # residuals up to which a claim to have solved is honest: primal as a planning step demands it [m, rad, 1/m],
DUAL = 1e-2  # of the Lagrangian's gradient, of which rows are worth 1e4 a metre
SOLVED = 0.9  # share of the programs that must be solved
_HAS_POINT = (Status.SOLVED, Status.INACCURATE)  # what is said of a point that is meant to be used
_HORIZON_M = 30.0
_EACH = 6  # programs of a drive in which limits play the same role
# A U-turn that needs 2.49 m (bus) or 2.79 m (tractor-trailer) on either side: limits off, inactive, binding, unkeepable.
_COURSES: tuple[tuple[str, float | None], ...] = (
    ("bus", None), ("bus", 6.0), ("bus", 2.48), ("bus", 2.2), ("tractor-trailer", 3.2), ("tractor-trailer", 2.75)
)  # fmt: skip


@dataclass(frozen=True)
class Finding:
    """What one rule found."""

    rule: str
    kept: bool
    said: str  # with the number that decided


Rule = Callable[[WorkspaceMaker, Sequence[Recorded]], Finding]


def samples() -> tuple[Recorded, ...]:
    """Return programs of drives in which limits are off, inactive, binding and unkeepable, with their solutions by the default solver.

    They are new copies every time: a solver that writes to one spoils no other rule.
    """
    return tuple(replace(one, qp=one.qp.copy(), guess=one.guess and one.guess.copy(), point=one.point.copy()) for one in _recorded())


@cache
def _recorded() -> tuple[Recorded, ...]:
    found: list[Recorded] = []
    for vehicle, half_width in _COURSES:
        road = SCENARIOS["uturn"]()
        limited = replace(road, limits=None) if half_width is None else road.with_limits(half_width, half_width)
        programs = record(Case(limited, load_vehicle(vehicle), settings=PlannerSettings(horizon=_HORIZON_M))).programs
        for role in LIMITS:
            alike = [each for each in programs if each.limits == role]
            found += alike[:: max(1, len(alike) // _EACH)][:_EACH]
    return tuple(found)


def checked(
    make: WorkspaceMaker, on_finding: Callable[[Finding], None] | None = None, on_progress: Callable[[float], None] | None = None
) -> list[Finding]:
    """Return what every rule of the contract finds of a solver; anything that it raises is a finding.

    So is a program that takes longer than ``LIMIT_S``, after which nothing more is asked. ``on_finding`` receives each finding as soon as
    it is known, ``on_progress`` 0 to 1: with a slow solver a rule takes minutes.
    """
    findings, ends, tell = list[Finding](), np.cumsum([0, *_asked()]), on_progress or (lambda _: None)
    watch = Watch(lambda solved: tell(float(min(ends[len(findings)] + solved, ends[len(findings) + 1]) / ends[-1])))
    for rule in CONTRACT:
        watch.solved = 0
        plain = rule is times_are_true and not watch.late  # a thread takes time, too
        findings.append(_found(rule, make if plain else watch.over(make)))
        if on_finding is not None:
            on_finding(findings[-1])
    return findings


@cache
def _asked() -> tuple[int, ...]:
    """Return how many programs every rule asks for, some of them more than once: counted with our own solver."""
    watches = [Watch(lambda _: None) for _ in CONTRACT]
    for rule, watch in zip(CONTRACT, watches, strict=True):
        rule(watch.over(RiccatiWorkspace), samples())
    return tuple(watch.solved for watch in watches)


def _found(rule: Rule, make: WorkspaceMaker) -> Finding:
    try:
        return rule(make, samples())
    except Exception as error:  # noqa: BLE001 - an author's code may raise anything
        return Finding(_title(rule), kept=False, said=f"{error_text(error)}{raised_at(error)}")


def same_optimum(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """The optimum is the reference's, with limits off, inactive, binding and unkeepable."""
    far = [_far(make, each, workspace.solve(each.qp, None)) for workspace, each in _each(make, programs)]
    most = {role: max([0.0, *(one for one, each in zip(far, programs, strict=True) if each.limits == role)]) for role in LIMITS}
    parts = ", ".join(f"{limits} {value:.1e}" for limits, value in most.items())
    return _agreeing(same_optimum, far, programs, f"differs by at most {parts}")


def honest_status(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """What is called solved has small residuals, and most programs are solved."""
    primal, dual, unsolved = 0.0, 0.0, list[int]()
    for number, (workspace, each) in enumerate(_each(make, programs)):
        result = workspace.solve(each.qp, None)
        if result.status is Status.SOLVED:
            judged = residuals(each.qp, result.point)
            primal, dual = _worse(primal, judged.primal), _worse(dual, judged.dual)
        else:
            unsolved.append(number)
    solved = len(programs) - len(unsolved)
    kept = primal <= PRIMAL and dual <= DUAL and solved > SOLVED * len(programs)
    said = f"{solved} of {len(programs)} solved, primal {primal:.1e}, dual {dual:.1e}"
    said += "" if kept else f" (more than {SOLVED:.0%} must be, at most {PRIMAL:g} and {DUAL:g})"
    for role in LIMITS:
        if left := [number for number in unsolved if programs[number].limits == role]:
            said += f"; not solved: {len(left)} with limits {role}, first samples()[{left[0]}]"
    return Finding(_title(honest_status), kept, said)


def update_equals_fresh(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """A workspace that solved other programs before finds what a new one finds."""
    far = [
        _far(make, each, workspace.solve(each.qp, None), make(each.qp.shape).solve(each.qp, None))
        for workspace, each in _each(make, programs)
    ]
    return _agreeing(update_equals_fresh, far, programs)


def guess_changes_only_the_way(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """A guess, right or wrong, leads to the same optimum, and is left as it was."""
    far, touched = [0.0] * len(programs), False
    for number, (workspace, each) in enumerate(_each(make, programs)):
        wrong = each.point.copy()
        wrong.stages["x"] += 1.0
        wrong.row_points["multiplier"] += 1.0
        for guess in (each.guess, each.point.copy(), wrong):
            before = None if guess is None else guess.copy()
            far[number] = max(far[number], _far(make, each, workspace.solve(each.qp, guess)))
            touched |= guess is not None and before is not None and not _same(guess, before)
    found = _agreeing(guess_changes_only_the_way, far, programs)
    return replace(found, kept=False, said=f"{found.said}, and guesses are written to") if touched else found


def unsolvable_is_said(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """A program that has no point is not called solved, and leaves nothing to the next one."""
    far, claimed = [0.0] * len(programs), list[bool]()
    for number, (workspace, each) in enumerate(_each(make, programs)):
        if not each.qp.shape.bounded_states:
            continue
        wrong = each.qp.copy()
        wrong.x_low[-1], wrong.x_high[-1] = 500.0, 501.0  # out of reach of the inputs
        claimed.append(workspace.solve(wrong, None).status is Status.SOLVED)
        far[number] = _far(make, each, workspace.solve(each.qp, None))
    said = f"{sum(claimed)} of {len(claimed)} called solved; the next one differs by at most {max(far):.1e}"
    found = _agreeing(unsolvable_is_said, far, programs, said)
    return replace(found, kept=found.kept and not any(claimed))


def bad_data_is_refused(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """NaN, infinity and crossed bounds raise QpDataError (call ``qp.check()``), and leave nothing to the next program."""
    each = next(one for one in programs if one.limits == "inactive" and one.qp.shape.bounded_states)
    workspace, wrong = make(each.qp.shape), []
    for name in NAMES:
        for value in (np.nan, np.inf):
            invalid = each.qp.copy()
            getattr(invalid, name).flat[-1] = value
            if not _refuses(workspace.solve, invalid):
                wrong.append(f"{name} = {value}")
    for low, high in (("x_low", "x_high"), ("u_low", "u_high")):
        invalid = each.qp.copy()
        getattr(invalid, low)[0] = getattr(invalid, high)[0] + 1.0
        if not _refuses(workspace.solve, invalid):
            wrong.append(f"{low} > {high}")
    far = distance(workspace.solve(each.qp, None).point, each.point)
    said = f"not refused: {', '.join(wrong)}" if wrong else f"all refused; the next one differs by {far:.1e}"
    return Finding(_title(bad_data_is_refused), not wrong and far <= AGREE_M, said)


def bounds_are_kept(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """No bound of a state or input is broken, where they are narrow too."""
    over = 0.0
    for workspace, each in _each(make, programs):
        narrow = each.qp.copy()
        reach = 0.5 * float(np.max(np.abs(each.point.u))) + 1e-4
        narrow.u_low[:], narrow.u_high[:] = np.maximum(narrow.u_low, -reach), np.minimum(narrow.u_high, reach)
        result = workspace.solve(narrow, None)
        if result.status is Status.SOLVED:
            over = _worse(over, float(np.max(np.maximum(narrow.u_low - result.point.u, result.point.u - narrow.u_high))))
    said = f"broken by at most {max(over, 0.0):.1e}" + (f" (allowed {PRIMAL:g} rad or 1/m)" if over > PRIMAL else "")
    return Finding(_title(bounds_are_kept), over <= PRIMAL, said)


def data_are_left_alone(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """The program is not written to, and a result stays until the next solve."""
    written, moved = 0, 0
    for workspace, each in _each(make, programs):
        qp = each.qp.copy()
        result = workspace.solve(qp, None)
        written += not np.array_equal(qp.buffer, each.qp.buffer)
        kept = result.point.copy()
        qp.buffer[:] = 0.0
        make(each.qp.shape).solve(each.qp, None)
        moved += not _same(kept, result.point)
    said = f"{written} programs written to, {moved} results changed by others"
    return Finding(_title(data_are_left_alone), written == moved == 0, said)


def times_are_true(make: WorkspaceMaker, programs: Sequence[Recorded]) -> Finding:
    """Update and solve take time, and no more than the call."""
    if is_foreign(make):
        return Finding(_title(times_are_true), kept=True, said="not asked of it: hdvplan times its calls")
    wrong, most = 0, len(programs) // 10
    for workspace, each in _each(make, programs):
        began = perf_counter()
        result = workspace.solve(each.qp, None)
        took = perf_counter() - began
        reported = result.update_time + result.solve_time + result.time_aside
        wrong += not (result.update_time >= 0.0 and result.solve_time > 0.0 and 0.5 * took <= reported <= took)
    allowed = f" (allowed {most})" if wrong > most else ""
    return Finding(_title(times_are_true), wrong <= most, f"{wrong} of {len(programs)} report other times than the clock{allowed}")


CONTRACT: tuple[Rule, ...] = (
    same_optimum, honest_status, bounds_are_kept, update_equals_fresh, guess_changes_only_the_way, unsolvable_is_said, bad_data_is_refused,
    data_are_left_alone, times_are_true,
)  # fmt: skip


def _agreeing(rule: Rule, far: Sequence[float], programs: Sequence[Recorded], said: str = "") -> Finding:
    """Return what a rule found whose results must agree: ``far`` is by how much those of each program differ [m, rad, 1/m]."""
    worst = int(np.argmax(far))
    said = said or f"differs by at most {far[worst]:.1e}"
    if far[worst] > AGREE_M:
        said += f" (allowed {AGREE_M:g} m, rad or 1/m; most in samples()[{worst}], limits {programs[worst].limits})"
    return Finding(_title(rule), far[worst] <= AGREE_M, said)


def _far(make: WorkspaceMaker, each: Recorded, found: QpResult, wanted: QpResult | None = None) -> float:
    """Return how far a point is from the one that is wanted; 0 where a new workspace has none either, which ``honest_status`` tells."""
    far = distance(found.point, (wanted or each).point)
    if far <= AGREE_M or found.status in _HAS_POINT:
        return far
    alone = wanted or make(each.qp.shape).solve(each.qp, None)
    return far if alone.status in _HAS_POINT else 0.0


def distance(one: StageSolution, other: StageSolution) -> float:
    """Return the largest difference of a state or an input; infinity where one is not finite."""
    far = max(float(np.max(np.abs(one.x - other.x))), float(np.max(np.abs(one.u - other.u))))
    return far if np.isfinite(far) else np.inf


def _each(make: WorkspaceMaker, programs: Sequence[Recorded]) -> list[tuple[QpWorkspace, Recorded]]:
    sizes = [(each.qp.shape.stages, each.qp.shape.states, each.qp.shape.rows) for each in programs]
    made = {size: make(each.qp.shape) for size, each in dict(zip(sizes, programs, strict=True)).items()}
    return [(made[size], each) for size, each in zip(sizes, programs, strict=True)]


def _refuses(solve: Callable[[StageQp, None], object], qp: StageQp) -> bool:
    try:
        solve(qp, None)
    except QpDataError:
        return True
    return False


def _same(one: StageSolution, other: StageSolution) -> bool:
    return all(np.array_equal(mine, theirs, equal_nan=True) for mine, theirs in zip(one.numbers, other.numbers, strict=True))


def _worse(one: float, other: float) -> float:
    return max(one, other) if np.isfinite(other) else np.inf


def _title(rule: Callable[..., object]) -> str:
    return (rule.__doc__ or rule.__name__).splitlines()[0].rstrip(".").replace("``", "`")
