"""The referee: what counts as a solved QP, and what a solver may not do while it is measured, however right its answers are.

A solver's own status is not relied on. A step is accepted where its point keeps the program and its multipliers prove it optimal: all three
residuals, recomputed, small. Multipliers grow with the price of limits that cannot be kept, up to 1e6; a residual of the Lagrangian or of
complementarity is small only beside them. The scale is therefore the reference's largest multiplier, which no solver can inflate.
Where solvers are held to an accuracy in metres instead, their multipliers prove nothing: the distance from a proved optimum decides.

It may not wait, change clocks or remember answers. Each is told from the outside, and none depends on how busy the machine is. A solver
that waits gives its core away of its own accord, which the system counts apart from what it takes away; one that remembers answers the
same programs much faster from the second round on, and faster than copies whose numbers are moved a little by chance.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping, Sequence
from time import process_time
from types import BuiltinFunctionType
from typing import NamedTuple

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.samples import NUMBERS, outcome_of
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Residuals, WorkspaceMaker, largest_multiplier, residuals

PRIMAL_M = 1e-4  # a hundredth of the centimetre to which limits are judged
DUAL = 1e-4  # of the Lagrangian's gradient, relative to the scale
GAP = 1e-4  # of complementarity summed over all inequalities, relative to the scale
WRONG_M = 1e-3  # an optimum further than this from the reference's is another optimum
TUNED = 2.0  # times the accuracy that tolerances were tuned to, on a sample: what a step may be off by


if sys.platform != "win32":
    import resource

_CLOCKS = ("perf_counter", "process_time", "monotonic")
_WAITS = 1.5  # times as long by the clock as by the processor
_OFTEN = 0.5  # of a drive's steps in which a solver waits
_REMEMBERS = 4.0  # times as long in the first round as later, or for copies: caches that are cold and a busy machine make up to twice
_FEWEST = 4  # steps from which that is told
_COPIED = 8  # steps of which copies are solved
_MOVED = 1e-9  # of their numbers: less than any tolerance, so that a warm start is worth as much


class Watch:
    """Watches one measured drive from when it is made."""

    def __init__(self) -> None:
        self._began = _spent()

    def fault(self, steps: int) -> str:
        """Return what the solver did in ``steps`` that forbids ranking it, in words; nothing of a fair one."""
        if changed := changed_clocks():
            return f"the solver changes clocks: {', '.join(changed)}"
        wall, cpu, waits = (now - then for now, then in zip(_spent(), self._began, strict=True))
        if waits >= max(1.0, _OFTEN * steps) and wall > _WAITS * cpu:
            return f"the solver waits instead of working, or works elsewhere: {wall / max(cpu, 1e-9):.3g} times as long by the clock"
        return ""


def _spent() -> tuple[float, float, int]:
    return time.perf_counter(), time.process_time(), given_away()


def given_away() -> int:
    """Return how often this thread has given its core away of its own accord: it waits then, or has its work done elsewhere."""
    if sys.platform == "win32":
        return 0  # there a solver that waits is not told
    return resource.getrusage(getattr(resource, "RUSAGE_THREAD", resource.RUSAGE_SELF)).ru_nvcsw


def changed_clocks() -> list[str]:
    """Return the clocks of this process that are no longer the system's, ``module.name``."""
    ours = [(name, module) for name, module in sorted(sys.modules.items()) if name == "time" or name.startswith("hdvplan")]
    return [
        f"{name}.{clock}"
        for name, module in ours
        for clock in _CLOCKS
        if (found := getattr(module, clock, None)) is not None and not _genuine(found, clock)
    ]


def _genuine(found: object, clock: str) -> bool:
    return isinstance(found, BuiltinFunctionType) and found.__self__ is time and found.__name__ == clock


def remembers(rounds: Sequence[FloatArray]) -> bool:
    """Tell whether a solver answers out of its memory what it was asked before; ``rounds`` are a cell's ``Measurement.steps``."""
    count = min(map(len, rounds))
    if len(rounds) < 2 or count < _FEWEST:  # noqa: PLR2004 - a round and another
        return False
    first, *later = (steps[:count, NUMBERS.index("cpu_s")] for steps in rounds)
    ratio = first / np.maximum(np.min(later, axis=0), 1e-9)
    return bool(np.median(ratio) > _REMEMBERS)


class Asked(NamedTuple):
    """What a solver was asked, copied."""

    qp: StageQp
    guess: StageSolution | None


def copied_steps(count: int) -> set[int]:
    """Return of which of a drive's steps copies are solved: evenly spread, without the first, in which a solver sets up."""
    return set(np.linspace(1, count - 1, min(_COPIED, count - 1)).round().astype(int).tolist()) if count > 1 else set()


def memory_fault(
    make: WorkspaceMaker, asked: Mapping[int, Sequence[Asked]], seconds: Mapping[int, float], alive: Callable[[], None]
) -> str:
    """Return that a solver takes far longer for programs that nobody can know, in words; nothing of one that does not.

    ``asked`` are the programs of some steps, and ``seconds`` what they took while they were timed. Each is solved once as it is, which sets
    up and warms all there is to warm, then two copies, of which the faster counts, and of its clock and processor time the less:
    what a busy machine adds is in neither.
    """
    if len(asked) < _FEWEST:
        return ""
    try:
        workspace = make(next(iter(asked.values()))[0].qp.shape)
        fresh = [sum(_took_copies(workspace, one, alive) for one in programs) for programs in asked.values()]
    except Exception as error:  # noqa: BLE001 - a solver may raise anything
        return f"the solver fails at programs that are new to it: {outcome_of(error)[1]}"
    ratio = float(np.median(np.array(fresh) / np.maximum([seconds[step] for step in asked], 1e-9)))
    return f"the solver remembers answers: programs that are new to it take it {ratio:.3g} times as long" if ratio > _REMEMBERS else ""


def _took_copies(workspace: QpWorkspace, one: Asked, alive: Callable[[], None]) -> float:
    """Return what moved copies of a program take [s], after the program itself."""
    took = []
    for qp in (one.qp, _moved(one.qp), _moved(one.qp)):
        alive()
        began = process_time()
        result = workspace.solve(qp, one.guess)
        took.append(min(process_time() - began, result.update_time + result.solve_time))
    return min(took[1:])


def _moved(qp: StageQp) -> StageQp:
    """Return a copy whose numbers are moved by what the operating system draws; zeros, bounds, prices and symmetry stay."""
    random, copy = np.random.default_rng(), qp.copy()
    for values in (copy.B, copy.c, copy.q, copy.r, copy.x_first):
        values[:] *= 1.0 + _MOVED * random.uniform(-1.0, 1.0, values.shape)
    return copy


def accepted(primal: FloatArray, dual: FloatArray, gap: FloatArray, scale: FloatArray) -> FloatArray:
    """Return 1 where residuals prove an optimum, 0 where not, NaN where there is no ``scale``; arrays of one shape."""
    proved = (primal <= PRIMAL_M) & (dual <= DUAL * scale) & (gap <= GAP * scale)  # False for NaN
    return np.where(np.isnan(scale), np.nan, proved.astype(float))


def scale_of(point: StageSolution) -> float:
    """Return the largest multiplier of a point, at least 1."""
    return max(1.0, largest_multiplier(point))


def proves(judged: Residuals, scale: float) -> bool:
    """Tell whether the residuals of one point prove it optimal."""
    return bool(accepted(*(np.array([value]) for value in (*judged, scale)))[0])


class ReferenceCheck:
    """The reference's solution of every program of a drive: a workspace that has the reference solve what it solves, and its maker.

    The reference starts from nothing, so that it cannot follow a solver astray. Such a drive is not timed.
    """

    def __init__(self, make: WorkspaceMaker, reference: WorkspaceMaker, copied: set[int]) -> None:
        self._make, self._make_reference, self._copied = make, reference, copied
        self._step = 0
        self.asked: dict[int, list[Asked]] = {}
        self._found: list[tuple[float, float, float]] = []
        self._own: QpWorkspace
        self._reference: QpWorkspace

    def __call__(self, shape: StageShape) -> QpWorkspace:
        """Return itself, around workspaces for ``shape``; a drive that first comes along a way is checked there too."""
        self._own, self._reference = self._make(shape), self._make_reference(shape)
        self.name, self.starts_warm = self._own.name, self._own.starts_warm
        return self

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp``, and compare the solution with the reference's; see ``QpWorkspace``."""
        if self._step in self._copied:
            self.asked.setdefault(self._step, []).append(Asked(qp.copy(), None if guess is None else guess.copy()))
        result = self._own.solve(qp, guess)
        self._found.append(distance_to(qp, result.point, self._reference))
        return result

    def take(self) -> tuple[float, float, float]:
        """Return of the programs since the last call: largest distance of e_y [m] and of u, and the last one's scale; NaN where unknown."""
        self._step += 1
        found, self._found[:] = np.array(self._found).reshape(-1, 3), []
        if not len(found):
            return np.nan, np.nan, np.nan
        return float(np.max(found[:, 0])), float(np.max(found[:, 1])), float(found[-1, 2])


def distance_to(qp: StageQp, point: StageSolution, reference: QpWorkspace) -> tuple[float, float, float]:
    """Return how far a point lies from the reference's: e_y [m], u, and the scale of multipliers; NaN where the reference fails."""
    result = reference.solve(qp, None)
    scale = scale_of(result.point)
    if not proves(residuals(qp, result.point), scale):
        return np.nan, np.nan, np.nan
    return (
        float(np.max(np.abs(point.x[:, 0] - result.point.x[:, 0]))),
        float(np.max(np.abs(point.u - result.point.u))),
        scale,
    )
