"""Terms of a program in their places, linearised at a motion of the test's own."""

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.motion import Motion
from hdvplan.planning.terms.limits import CLEAR_M
from hdvplan.planning.terms.term import SCENE, Horizon, Part, Scene
from hdvplan.qp.program import StageQp, StageShape, by_stage

P = TypeVar("P")


def horizon_at(scene: Scene, first: int, *, before: float = 0.0, fixed: int = 0, binding: bool = True) -> Horizon:
    """Return the horizon of a scene that begins at station ``first``."""
    road = scene.stations.points[first : first + scene.settings.stages + 1]
    return Horizon(first, road, before, fixed, binding)


def record_of(motion: Motion, shape: StageShape, *, road: Records | None = None, before: float = 0.0) -> Records:
    """Return the core's record of a scene that has a motion, a road and the sizes of a program, and no more."""
    record = np.zeros(1, SCENE)
    record["motion"], record["states"], record["kappa_before"] = core.address(motion.stages), motion.z.shape[1], before
    record["program"]["shape"] = shape.sizes
    record["road"] = 0 if road is None else core.address(road)
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


def assert_same_rows(one: StageQp, other: StageQp, near_h: float, near_g: float, stages: slice = slice(None)) -> None:
    """Compare the rows of two programs, at some of the stages 1..N, that differ in what they know of edges that are clear.

    A row that only one of them carries must be clear in the other, by a bound of its true clearance.
    """
    carried, others = (np.any(qp.G[stages] != 0.0, axis=2) for qp in (one, other))
    both = carried & others
    assert np.max(np.abs(one.h[stages] - other.h[stages])[both], initial=0.0) < near_h
    assert np.max(np.abs(one.G[stages] - other.G[stages])[both], initial=0.0) < near_g
    for true, bound, only in ((one, other, carried & ~others), (other, one, others & ~carried)):
        assert np.all(bound.h[stages][only] <= true.h[stages][only] + near_h)
    for qp, rows in ((one, carried), (other, others)):
        assert np.all(qp.h[stages][~rows] >= CLEAR_M)
        assert np.all(qp.stages["live"][1:][stages][np.any(rows, axis=1)] == 1.0)


def part_of(parts: Iterable[Part], kind: type[P]) -> P:
    """Return the one part of a kind."""
    (found,) = (part for part in parts if isinstance(part, kind))
    return found
