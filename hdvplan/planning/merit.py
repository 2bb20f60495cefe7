"""The merit of a motion: the measure by which the step of a QP is taken in full or shortened.

The l1 merit function of sequential quadratic programming (Han 1977; Nocedal, Wright 2006, sec. 18.4): the prices of all terms, which
hold what broken limits cost, and every gap between a predicted state and the dynamics at a weight no smaller than its multiplier. A
step that does not lower it is halved: where limits cannot be kept, full steps swing from side to side.
"""

from __future__ import annotations

from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.qp.program import StageQp, StageSolution

_L1_WEIGHTS = core.function("hdv_l1_weights", core.POINTER, core.POINTER, core.INT, core.POINTER, returns=core.INT)
_DEFECT_PRICE = core.function("hdv_defect_price", core.POINTER, core.INT, core.POINTER, returns=core.REAL)


def l1_weights(qp: StageQp, solution: StageSolution, weights: FloatArray) -> bool:
    """Write the largest multiplier of each state's dynamics into ``weights`` (n,); return whether any row has a multiplier.

    The first n states say where the bodies are.
    """
    return bool(_L1_WEIGHTS(qp.address, solution.address_for(qp.shape), len(weights), core.address(weights)))


def defect_price(qp: StageQp, weights: FloatArray) -> float:
    """Return what the gaps in the dynamics cost at the given weights of the first states; no other's dynamics are ever broken."""
    return float(_DEFECT_PRICE(qp.address, len(weights), core.address(weights)))
