"""How far a primal-dual point is from optimal, recomputed from the program: the judge of every solver alike."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan import core
from hdvplan.qp.program import StageQp, StageSolution

_residuals = core.function("hdv_residuals", core.POINTER, core.POINTER, core.POINTER)


class Residuals(NamedTuple):
    """How far a point is from optimal, recomputed from the program and never taken from a solver."""

    primal: float  # largest violation of dynamics, rows and bounds [m, rad, 1/m]
    dual: float  # largest entry of the Lagrangian's gradient
    gap: float  # |complementarity| summed over all inequalities


def residuals(qp: StageQp, point: StageSolution) -> Residuals:
    """Return the residuals of ``point``; NaN where anything in it is not finite. They judge every solver alike.

    Raises:
        QpDataError: the point is of another shape than the program.

    """
    found = np.empty(3)
    _residuals(qp.address, point.address_for(qp.shape), core.address(found))
    return Residuals(*found.tolist())
