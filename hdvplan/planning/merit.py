"""The merit of a motion: the measure by which the step of a QP is taken in full or shortened.

The l1 merit function of sequential quadratic programming (Han 1977; Nocedal, Wright 2006, sec. 18.4): the prices of all terms, which
hold what broken limits cost, and every gap between a predicted state and the dynamics at a weight no smaller than its multiplier. A
step that does not lower it is halved: where limits cannot be kept, full steps swing from side to side.
"""

from __future__ import annotations

from hdvplan.jit import FloatArray, Records, compiled

_BINDING = 1e-6  # multiplier from which on a row counts as binding; solvers leave less on the others


@compiled
def l1_weights(stages: Records, points: Records, row_points: Records, weights: FloatArray) -> bool:
    """Write the largest multiplier of each state's dynamics into ``weights`` (n,); return whether any row has a multiplier.

    ``points`` and ``row_points`` are a QP's solution; its first n states say where the bodies are.
    """
    for j in range(weights.size):
        weights[j] = 0.0
    for i in range(1, points.size):
        for j in range(weights.size):
            weights[j] = max(weights[j], abs(points[i].dynamics[j]))
    for i in range(1, row_points.shape[0]):
        if stages[i].live > 0.0:
            for row in range(row_points.shape[1]):
                if row_points[i, row].multiplier > _BINDING:
                    return True
    return False


@compiled
def defect_price(stages: Records, weights: FloatArray) -> float:
    """Return what the gaps in the dynamics cost at the given weights of the first states; no other's dynamics are ever broken."""
    total = 0.0
    for i in range(stages.size - 1):
        for j in range(weights.size):
            total += weights[j] * abs(stages[i].c[j])
    return total
