"""The line of the lead rear axle that makes the last axle follow a drawn line.

A coupling lies a wheelbase ahead of the axle behind it, on that axle's tangent; and where it does not lie on the axle ahead of it, that
one's heading follows the coupling's own direction, within a few lengths of the lever between the two. A lever behind the axle is
followed against the heading, as a trailer is, one ahead of it along the heading: so both are stable, and nothing folds.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from hdvplan.arrays import FloatArray, chord_of
from hdvplan.errors import RoadError
from hdvplan.road.options import REFERENCE_SLACK, RoadOptions
from hdvplan.road.smooth import smooth_line
from hdvplan.vehicle.kinematics import critical_angles
from hdvplan.vehicle.model import Vehicle

_SPACING_M = 0.25  # of the line's points: the spline through them is off by less than 1 mm on a radius of 5 m
_ON_AXLE_M = 1e-3  # a shorter lever is none
_EXACT = 1e-8  # of the lever's heading [rad]
_ACROSS = np.deg2rad(80.0)  # between a lever and its coupling's direction: nearer to 90 degrees it stands across its path


def lead_line(vehicle: Vehicle, points: FloatArray, options: RoadOptions) -> FloatArray:
    """Return the line of the lead rear axle (m, 2) for a line of the last axle (n, 2), both directed as the vehicle heads [m].

    The last axle's line is smoothed first, to what the vehicle can follow. Axles count as not steered: what is driven along the line is
    planned and simulated exactly.

    Raises:
        RoadError: the line cannot be smoothed within the options, or a body would stand across its path.

    """
    if len(vehicle.units) == 1:
        return points
    path = smooth_line(points, closed=False, max_deviation=options.smooth, max_curvature=_most(vehicle, options)).path
    s = np.linspace(0.0, path.length, max(8, int(np.ceil(path.length / _SPACING_M))) + 1)
    here = path.at(s)
    axle, heading = np.stack([here.x, here.y], axis=1), np.unwrap(here.heading)
    for ahead, unit in zip(vehicle.units[-2::-1], vehicle.units[:0:-1], strict=True):
        coupling = axle + unit.wheelbase * _unit(heading)
        heading = _followed(coupling, ahead.hitch_offset)
        axle = coupling + ahead.hitch_offset * _unit(heading)
    return axle


def _most(vehicle: Vehicle, options: RoadOptions) -> float:
    """Return the tightest curvature of the last axle's line [1/m]: in the circle at full lock, where there is one."""
    kappa = vehicle.max_curvature
    for beta, ahead in zip(critical_angles(vehicle), vehicle.units, strict=False):
        if not np.isfinite(beta):
            return options.max_curvature
        kappa /= np.cos(beta) + ahead.hitch_offset * kappa * np.sin(beta)
    return min(REFERENCE_SLACK * kappa, options.max_curvature) if kappa > 0.0 else options.max_curvature


def _unit(heading: FloatArray) -> FloatArray:
    return np.stack([np.cos(heading), np.sin(heading)], axis=1)


def _followed(coupling: FloatArray, lever: float) -> FloatArray:
    """Return the headings (n,) of a body whose coupling, a ``lever`` behind its axle, moves along points (n, 2) [m, rad].

    Raises:
        RoadError: the body would stand across its coupling's path.

    """
    s = chord_of(coupling)
    spline = CubicSpline(s, coupling)
    x, y = spline(s, 1).T
    along: FloatArray = np.unwrap(np.arctan2(y, x))
    if abs(lever) < _ON_AXLE_M:
        return along
    order = slice(None, None, -1 if lever > 0.0 else 1)
    direction, at = CubicSpline(s, along), s[order]
    followed = solve_ivp(
        lambda at, psi: np.sin(psi - direction(at)) / lever, (at[0], at[-1]), along[order][:1], "LSODA", t_eval=at, rtol=_EXACT, atol=_EXACT
    )
    heading: FloatArray = np.asarray(followed.y[0])[order]
    across = np.abs(heading - along)
    if np.max(across) > _ACROSS:
        place = float(s[np.argmax(across)])
        msg = f"the last axle's line turns so sharply near s = {place:z.0f} m that the body ahead would stand across its path"
        raise RoadError(msg, s_m=place, hint="draw it wider, or draw the line of the lead axle: --leg-line lead-axle")
    return heading
