"""Pulling out of a dock; backing in is the same drive in reverse.

The vehicle drives straight out and turns left at full lock until it is in line with the wall and stretched: with a trailer it turns further
and back, by the angle that leaves no articulation. There the forward drive along the wall ends on which it came. The straight is the
shortest with which it passes its neighbours.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import brentq

from hdvplan.arrays import FloatArray
from hdvplan.errors import TurnError
from hdvplan.turning.reversing.legs import Draft, DrivenLeg, articulated, driven, wheels_at_stop
from hdvplan.turning.reversing.sites import Site, dock_heading
from hdvplan.vehicle.model import Vehicle

KEPT_M = 0.002  # from neighbours: more than bodies bow out between two poses
_FURTHER_RAD = 1.5  # most by which a tractor turns further: the angle of its trailer would have changed sign long before
_STRETCHED_RAD = 1e-10
_FOLDED_RAD = 0.5 * np.pi  # articulation at which a trailer's axle stands still
_EVERY_M = 0.5
_FOUND_M = 1e-4
_SCAN_M = 0.25  # between straights that are tried: a longer one may not pass what a shorter one does, along a row at an angle


def pull_out(vehicle: Vehicle, site: Site, spacing: float) -> Draft:
    """Return the forward drive out of a dock with the shortest straight that passes its neighbours, seen at poses ``spacing`` apart [m].

    Raises:
        TurnError: none was found, however far the vehicle drives straight out, or its trailer folds up.

    """
    heading, most = dock_heading(site.template), 2.0 * (vehicle.reach_ahead + vehicle.reach_behind)
    door = np.array([vehicle.reach_behind * np.cos(heading), vehicle.reach_behind * np.sin(heading), heading])
    arcs = _arcs(vehicle, np.pi - heading)

    def out(straight: float) -> Draft:
        lengths, kappas = np.array([(straight, 0.0), *arcs]).T
        return Draft(door, lengths, kappas, np.zeros(len(lengths), dtype=np.int64))

    def at(straight: float) -> DrivenLeg:
        return driven(vehicle, door, out(straight).pieces(0), spacing)

    def spare(straight: float) -> float:
        return float(site.gaps(vehicle, at(straight).poses).min()) - site.clearance - KEPT_M

    if np.abs(at(0.0).beta).max(initial=0.0) >= _FOLDED_RAD:
        msg = f"the {vehicle.name} would push its trailer backwards at full lock"
        raise TurnError(msg)
    if spare(0.0) >= 0.0:
        return out(0.0)
    passes = next((far for far in np.arange(_SCAN_M, most, _SCAN_M) if spare(float(far)) >= 0.0), None)
    if passes is None:
        msg = f"no way was found for the {vehicle.name} out of its dock past its neighbours"
        raise TurnError(msg, hint="give a larger --door-spacing")
    return out(float(brentq(spare, passes - _SCAN_M, passes, xtol=_FOUND_M)) + _FOUND_M)


def _arcs(vehicle: Vehicle, angle: float) -> tuple[tuple[float, float], ...]:
    """Return the arcs (length [m], kappa [1/m]) that turn a stretched vehicle to the left by ``angle`` [rad] and stretch it again."""
    wheels = wheels_at_stop(vehicle)
    if len(vehicle.units) == 1:
        return ((angle / wheels.turn, wheels.kappa),)

    def around(further: float) -> tuple[tuple[float, float], ...]:
        return ((angle + further) / wheels.turn, wheels.kappa), (further / wheels.turn, -wheels.kappa)

    def left_over(further: float) -> float:
        driven_arcs = [arc for arc in around(further) if arc[0] > 0.0]
        counts = [max(1, int(np.ceil(length / _EVERY_M))) for length, _ in driven_arcs]
        angles: FloatArray = articulated(vehicle, driven_arcs, counts, np.zeros(1))[-1]
        return float(angles[-1, 0])

    if not left_over(0.0) > 0.0 > left_over(_FURTHER_RAD):
        msg = (
            f"the trailer of the {vehicle.name} does not come in line with its tractor again within {np.rad2deg(_FURTHER_RAD):.0f} degrees"
        )
        raise TurnError(msg)
    return around(float(brentq(left_over, 0.0, _FURTHER_RAD, xtol=_STRETCHED_RAD)))
