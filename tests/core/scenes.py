"""Terms of a program in their places, linearised at a motion of the test's own, and what planning calls of the core in a step."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.terms.limits import CLEAR_M, LimitsPart
from hdvplan.planning.terms.term import SCENE, Horizon, Motion, Part, Scene
from hdvplan.qp.program import StageQp, StageShape, StageSolution, by_stage

P = TypeVar("P")
SAME = 1e-12  # of rows that were looked up at one motion: the sums of a gap and its derivative


def horizon_at(scene: Scene, first: int, *, before: float = 0.0, fixed: int = 0, binding: bool = True) -> Horizon:
    """Return the horizon of a scene that begins at station ``first``."""
    road = scene.stations.points[first : first + scene.settings.stages + 1]
    return Horizon(first, road, before, fixed, binding)


def record_of(motion: Motion, shape: StageShape, *, road: Records, step: float = 1.0, before: float = 0.0) -> Records:
    """Return the core's record of a scene that has a motion, a road and the sizes of a program, and no more."""
    record = np.zeros(1, SCENE)
    record["step"] = step
    record["motion"], record["states"], record["kappa_before"] = core.address(motion.stages), motion.z.shape[1], before
    record["program"]["shape"] = shape.sizes
    record["road"] = core.address(road)
    return record


def move(scene: Scene, z: FloatArray, kappa: FloatArray | None = None) -> None:
    """Write the motion that is linearised at; without ``kappa`` its curvatures are zero."""
    scene.motion.z[:] = z
    scene.motion.kappa[:] = np.zeros(len(z) - 1) if kappa is None else kappa


def shifted(scene: Scene, parts: Iterable[Part], by: int) -> None:
    """Move all that is known to the beginning of memory, as a window does that has reached its end."""
    own = (scene.motion.stages, scene.qp.stages, scene.qp.rows)
    for array in (*map(by_stage, own), *(array for part in parts for array in part.memory)):
        array[: len(array) - by] = array[by:].copy()


def extended(parts: Iterable[Part], horizon: Horizon, begin: int = 1) -> None:
    """Linearise at stages from ``begin`` on, of which nothing is known; no point may be without a foot."""
    for part in parts:
        assert part.extend(horizon, begin) == -1


def linearised(parts: Iterable[Part], horizon: Horizon) -> None:
    """Linearise at the whole motion, from what is known of it; no point may be without a foot."""
    for part in parts:
        assert part.linearise(horizon) == -1


def moved_of(parts: Iterable[Part]) -> FloatArray:
    """Return how far any point of the body of each row may have moved since the row was looked up, shape (N, rows) of a program [m].

    Infinite where nothing was looked up, 0 for the rows of other terms.
    """
    part = part_of(parts, LimitsPart)
    begin, stages, first = int(part.scene.record["at"][0]), part.scene.settings.stages, int(part.data["row"][0])
    by_side = part.seen.edges["moved"][begin + 1 : begin + stages + 1].reshape(stages, -1)
    moved = np.zeros((stages, part.scene.qp.shape.rows))
    moved[:, first : first + part.rows.shape[1]] = np.repeat(by_side, part.rows.shape[1] // by_side.shape[1], axis=1)
    return moved


def assert_same_rows(one: tuple[StageQp, FloatArray], other: tuple[StageQp, FloatArray], stages: slice = slice(None)) -> None:
    """Compare the rows of two programs at one motion, at some of the stages 1..N, that differ in when they looked at their bodies.

    Each comes with ``moved_of`` its terms. Rows that neither has followed since are the same. A gap changes by no more than a body's
    points move, and so does a row that follows: the two are apart by twice that where another contact has become the tightest. A side
    that has rows in only one of them is as clear as the other takes it to be: see ``test_memory_of_limits`` for how clear that is.
    """
    (mine, followed), (theirs, others_followed) = ((qp, moved[stages]) for qp, moved in (one, other))
    carried, others = (np.any(qp.G[stages] != 0.0, axis=2) for qp in (mine, theirs))
    both, moved = carried & others, followed + others_followed
    apart = np.abs(mine.h[stages] - theirs.h[stages])
    assert np.all(apart[both] <= 2.0 * moved[both] + SAME)
    looked = both & (moved == 0.0)
    assert np.max(np.abs(mine.G[stages] - theirs.G[stages])[looked], initial=0.0) < SAME
    for true, only, far in ((mine, carried & ~others, followed), (theirs, others & ~carried, others_followed)):
        assert np.all(true.h[stages][only] > CLEAR_M - 2.0 * far[only] - SAME)
    for qp, rows in ((mine, carried), (theirs, others)):
        assert np.all(qp.h[stages][~rows] >= CLEAR_M)
        assert np.all(qp.stages["live"][1:][stages][np.any(rows, axis=1)] == 1.0)


def part_of(parts: Iterable[Part], kind: type[P]) -> P:
    """Return the one part of a kind."""
    (found,) = (part for part in parts if isinstance(part, kind))
    return found


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
