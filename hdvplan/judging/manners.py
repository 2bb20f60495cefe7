"""How hard a plan steers: whether it uses up the steering, or swings from lock to lock within the vehicle's length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray
from hdvplan.driving.drive import Drive
from hdvplan.planning.running import running

NEARLY_ALL = 0.95  # of the steering, or of its rate: a driver has nothing left to correct with
_LOCK = 0.8  # of the steering, on either side: from one to the other is a swing from lock to lock
_ROUNDING = 1e-9


@dataclass(frozen=True)
class Use:
    """The largest share of something limited that a plan uses, and the stretches (from, to) [m] over which it is nearly all."""

    share: float
    s: float  # of the largest share [m]
    stretches: tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class Manners:
    """How hard the lead unit's steering is used, and where (from, to) [m] it goes from lock to lock within the vehicle's length."""

    curvature: Use
    rate: Use
    swings: tuple[tuple[float, float], ...]


def manners_of(drive: Drive) -> Manners:
    """Return how hard a drive steers, from its executed curvatures, each held over a step."""
    vehicle, step, kappa = drive.vehicle, drive.settings.step, drive.kappa
    s = drive.stations.s[: len(kappa)]
    curvature = np.abs(kappa) / vehicle.max_curvature
    rate = np.abs(np.diff(kappa, prepend=kappa[:1])) / (step * vehicle.max_curvature_rate)
    size = max(2, int(np.ceil((vehicle.reach_ahead + vehicle.reach_behind) / step)))
    high, low = (running(pick, kappa, size // 2, size - size // 2 - 1) for pick in (np.maximum, np.minimum))
    lock = _LOCK * vehicle.max_curvature
    return Manners(_use(s, curvature), _use(s, rate), _stretches(s, (high > lock) & (low < -lock)))


def manners_texts(drive: Drive, manners: Manners) -> list[str]:
    """Return a sentence for everything that a driver would find too much, naming its first or worst place."""
    texts = []
    if manners.swings:
        first, last = manners.swings[0]
        more = f", and at {len(manners.swings) - 1} more places" if len(manners.swings) > 1 else ""
        texts.append(f"the plan swings from lock to lock between s = {first:.1f} and {last:.1f} m, within the vehicle's length{more}")
    for use, what in ((manners.curvature, "steering"), (manners.rate, "steering rate")):
        if use.stretches:
            total = sum(last - first + drive.settings.step for first, last in use.stretches)
            texts.append(
                f"the plan uses {100.0 * use.share:.0f} % of the {what} at s = {use.s:.1f} m, over 95 % along {total:.1f} m of road"
            )
    return texts


def _use(s: FloatArray, share: FloatArray) -> Use:
    most = int(np.argmax(share))
    return Use(float(share[most]), float(s[most]), _stretches(s, share > NEARLY_ALL + _ROUNDING))


def _stretches(s: FloatArray, wanted: BoolArray) -> tuple[tuple[float, float], ...]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], wanted, [False]]).astype(int)))
    return tuple((float(s[begin]), float(s[end - 1])) for begin, end in zip(edges[::2], edges[1::2], strict=True))
