"""Terms of a program in their places, linearised at a motion of the test's own."""

from collections.abc import Iterable
from typing import TypeVar

import numpy as np

from hdvplan.jit import FloatArray
from hdvplan.planning.terms.term import Horizon, Part, Scene

P = TypeVar("P")


def horizon_at(scene: Scene, first: int, *, before: float = 0.0, fixed: int = 0, binding: bool = True) -> Horizon:
    """Return the horizon of a scene that begins at station ``first``."""
    road = scene.stations.points[first : first + scene.settings.stages + 1]
    return Horizon(first, road, before, fixed, binding)


def move(scene: Scene, z: FloatArray, kappa: FloatArray | None = None) -> None:
    """Write the motion that is linearised at; without ``kappa`` its curvatures are zero."""
    scene.motion.z[:] = z
    scene.motion.kappa[:] = np.zeros(len(z) - 1) if kappa is None else kappa


def extended(parts: Iterable[Part], horizon: Horizon, begin: int = 1) -> None:
    """Linearise at stages from ``begin`` on, of which nothing is known; no point may be without a foot."""
    for part in parts:
        assert part.extend(horizon, begin) == -1


def linearised(parts: Iterable[Part], horizon: Horizon) -> None:
    """Linearise at the whole motion, from what is known of it; no point may be without a foot."""
    for part in parts:
        assert part.linearise(horizon) == -1


def part_of(parts: Iterable[Part], kind: type[P]) -> P:
    """Return the one part of a kind."""
    (found,) = (part for part in parts if isinstance(part, kind))
    return found
