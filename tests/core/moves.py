"""Functions of the core that planning calls within a step: the guess of a plan, a step's share, its merit."""

from __future__ import annotations

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.qp.program import StageQp, StageSolution

_GUESS = core.function("hdv_guess_motion", *(core.POINTER,) * 4, core.INT, core.POINTER, core.POINTER, core.INT, returns=core.INT)
_TAKE_STEP = core.function("hdv_take_step", core.POINTER, core.POINTER, core.REAL, returns=core.REAL)
_L1_WEIGHTS = core.function("hdv_l1_weights", core.POINTER, core.POINTER, core.INT, core.POINTER, returns=core.INT)
_DEFECT_PRICE = core.function("hdv_defect_price", core.POINTER, core.INT, core.POINTER, returns=core.REAL)


def guess(
    scene: Records, z_start: FloatArray, states: FloatArray, curvatures: FloatArray, kept: int, most: FloatArray, change: FloatArray
) -> bool:
    """Extend the motion of a ``scene``, a record of ``SCENE``, of which ``kept`` stages are known, and let it begin at ``z_start``.

    From stage ``kept`` on, and for the curvature that leads there, it takes the road's stationary geometry ``states`` (N+1, n) and
    ``curvatures`` (N+1,). All steering is brought within what the vehicle can do: at most ``most``, changing by at most ``change`` a
    station; of the curvature first, then of the wheels that the plan steers. Returns whether steering of known stages was changed.
    """
    start = np.ascontiguousarray(z_start, float)
    arrays = map(core.address, (scene, start, states, curvatures))
    return bool(_GUESS(*arrays, kept, core.address(most), core.address(change), len(most) - 1))


def take_step(scene: Records, solution: StageSolution, share: float) -> float:
    """Move the motion of a ``scene``, a record of ``SCENE``, by ``share`` of a QP's solution, less where it would leave the model's domain.

    The first state is given: a solver's residual must not move it. Returns the largest change of a state, or infinity
    where no part of the step could be taken.
    """
    return float(_TAKE_STEP(core.address(scene), core.address(solution.record), share))


def l1_weights(qp: StageQp, solution: StageSolution, weights: FloatArray) -> bool:
    """Write the largest multiplier of each state's dynamics into ``weights`` (n,); return whether any row has a multiplier.

    The first n states say where the bodies are.
    """
    return bool(_L1_WEIGHTS(qp.address, solution.address_for(qp.shape), len(weights), core.address(weights)))


def defect_price(qp: StageQp, weights: FloatArray) -> float:
    """Return what the gaps in the dynamics cost at the given weights of the first states; no other's dynamics are ever broken."""
    return float(_DEFECT_PRICE(qp.address, len(weights), core.address(weights)))
