"""What counts as a solved QP: its residuals, recomputed, and how far its path lies from a reference's.

A solver's own status is not relied on. A step is accepted where its point keeps the program and its multipliers prove it optimal: all three
residuals small. Multipliers grow with the price of limits that cannot be kept, up to 1e6; a residual of the Lagrangian or of
complementarity is small only beside them. The scale is therefore the reference's largest multiplier, which no solver can inflate.
Where solvers are held to an accuracy in metres instead, their multipliers prove nothing: the distance from a proved optimum decides.
"""

from __future__ import annotations

from time import perf_counter

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, QpWorkspace, Residuals, WorkspaceMaker, largest_multiplier, residuals

PRIMAL_M = 1e-4  # a hundredth of the centimetre to which limits are judged
DUAL = 1e-4  # of the Lagrangian's gradient, relative to the scale
GAP = 1e-4  # of complementarity summed over all inequalities, relative to the scale
WRONG_M = 1e-3  # an optimum further than this from the reference's is another optimum
TUNED = 2.0  # times the accuracy that tolerances were tuned to, on a sample: what a step may be off by


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
    """The reference's solution of every program of a drive: it makes workspaces that have the reference solve what they solve.

    The reference starts from nothing, so that it cannot follow a solver astray. Its time is no part of a step.
    """

    def __init__(self, make: WorkspaceMaker, reference: WorkspaceMaker) -> None:
        """Stand between planning and the workspaces that ``make`` makes."""
        self._make, self._reference = make, reference
        self._found: list[tuple[float, float, float]] = []

    def __call__(self, shape: StageShape) -> QpWorkspace:
        """Make a workspace."""
        return _CheckedWorkspace(self._make(shape), self._reference(shape), self._found)

    def take(self) -> tuple[float, float, float]:
        """Return of the programs since the last call: largest distance of e_y [m] and of u, and the last one's scale; NaN where unknown."""
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


class _CheckedWorkspace:
    """A workspace whose every solution is compared with the reference's."""

    def __init__(self, inner: QpWorkspace, reference: QpWorkspace, found: list[tuple[float, float, float]]) -> None:
        self._inner, self._reference, self._found = inner, reference, found
        self.name, self.starts_warm = inner.name, inner.starts_warm

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve ``qp`` by the solver, then by the reference; see ``QpWorkspace``."""
        result = self._inner.solve(qp, guess)
        began = perf_counter()
        self._found.append(distance_to(qp, result.point, self._reference))
        return result._replace(time_aside=result.time_aside + perf_counter() - began)
