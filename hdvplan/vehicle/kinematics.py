"""The road-aligned kinematics of a lead unit with any number of trailers, with exact derivatives.

State z = (e_y, e_psi, beta_1, ..., delta_1, ...): lateral error of the lead unit's rear axle, heading error of its body, then the
articulation angle at every coupling (heading ahead minus heading behind), then, of every axle that the plan steers, the angle of its
wheels off its body (left positive); how fast that turns is the plan's to choose, and zero here. Input: kappa = tan(front angle) /
wheelbase, which is the curvature of the lead rear axle's path unless that axle is steered. ``units`` is ``Vehicle.table()``.

Every axle moves along its wheels, at an angle delta off its body: a state, or delta = -ratio * (front angle or beta), held at
+-max_steering_angle. With velocities per metre that the lead body moves forward at its axle, a unit's axle moves (forward,
forward tan(delta)) in the body's axes, and the coupling behind it (forward, forward tan(delta) - hitch turn). Turned by beta
these are the velocities at the coupling of the next unit, whose wheels then decide how fast that turns.
Sources: [GEO] eqs. 2 and 6; without steered axles the recursion over couplings is the standard n-trailer.
"""

from __future__ import annotations

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.vehicle.model import Vehicle

# Where a unit is in the plane: its axle, its heading, and its coupling to the unit ahead [m]. The lead unit turns about its own axle,
# so its "coupling" is that axle. And how it stands to what is ahead: to the road, or by its articulation angle.
POSE = core.record("hdv_pose")

_place_many = core.function("hdv_place_many", core.POINTER, core.INT, core.INT, core.POINTER, core.INT, core.POINTER, core.POINTER)
_derivative = core.function("hdv_derivative", core.POINTER, core.INT, core.REAL, core.INT, core.POINTER, core.REAL, core.POINTER)


def place_many(units: Records, points: FloatArray, z: FloatArray) -> Records:
    """Return every unit's pose in states ``z`` (k, states), records of ``POSE`` (k, units).

    ``points`` (5, k) are the road's where the lead rear axle is, as ``road.path.evaluate_many`` returns them.
    """
    points, z = np.ascontiguousarray(points.T), np.ascontiguousarray(z)
    poses = np.empty((len(z), len(units)), POSE)
    _place_many(core.address(units), len(units), len(z), core.address(points), z.shape[1], core.address(z), core.address(poses))
    return poses


def rates(units: Records, road_curvature: float, z: FloatArray, kappa: float) -> FloatArray:
    """Return dz/ds, shape (states,), wheels that the plan steers held."""
    z, f = np.ascontiguousarray(z), np.empty(len(z))
    _derivative(core.address(units), len(units), road_curvature, len(z), core.address(z), kappa, core.address(f))
    return f


def critical_angles(vehicle: Vehicle) -> FloatArray:
    """Return the critical articulation of every coupling, (units - 1,) [rad]; infinite where the steering alone folds no trailer.

    It is the one that stays as it is in a circle at full lock: sin(beta) - hitch_offset kappa cos(beta) = kappa wheelbase, with the
    curvature kappa of the path of the axle ahead. Beyond it an angle grows whatever is steered. A trailer's own path then bends by
    kappa / (cos(beta) + hitch_offset kappa sin(beta)), which the next coupling meets. Trailers' axles are taken as not steered.
    """
    kappa, found = vehicle.max_curvature, np.full(len(vehicle.units) - 1, np.inf)
    for number, (ahead, unit) in enumerate(zip(vehicle.units, vehicle.units[1:], strict=False)):
        lever = ahead.hitch_offset * kappa
        sine = kappa * unit.wheelbase / np.hypot(1.0, lever)
        if sine >= 1.0:
            break
        beta = np.arctan(lever) + np.arcsin(sine)
        found[number], kappa = beta, kappa / (np.cos(beta) + lever * np.sin(beta))
        if kappa <= 0.0:  # the trailer's axle no longer rolls forward
            break
    return found
