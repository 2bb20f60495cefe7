"""How a trailer follows: a coordinate of its heading that steering alone does not change.

Per metre that the leading unit moves forward, turning by kappa, a trailer behind a coupling ``hitch_offset`` a behind the axle, with its
axle ``wheelbase`` l behind the coupling, turns by (p(gamma) - a kappa c(gamma)) / l, where gamma is the articulation angle, and with
tau = tan of the trailer's wheels out of the bend

    p = sin(gamma) + tau cos(gamma),   c = cos(gamma) - tau sin(gamma).

Of a vehicle that turns on the spot, theta - G(gamma) with G' = 1 / (1 + (a / l) c) does not change. Its rate W' = p / (l + a c) holds no
steering: it follows from x = theta - W alone. Without offset, W is the trailer's heading.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.vehicle.model import Unit

SHARPEST = 1.5  # articulation angle: beyond 86 degrees no combination is said to drive forward [rad]
_STEP = 1e-3  # of the tables [rad]


class Coupling(NamedTuple):
    """Tables over x = theta - W, from ``first`` in steps of ``step`` [rad]: articulation angle [rad], and rate of W [1/m]."""

    hitch_offset: float  # of the leading unit [m]
    offset_share: float  # |a| / l
    first: float
    step: float
    angle: FloatArray
    rate: FloatArray


def coupling_of(lead: Unit, trailer: Unit) -> Coupling:
    """Return how ``trailer`` follows ``lead``."""
    gamma = np.linspace(-SHARPEST, SHARPEST, 4001)
    wheels = np.tan(np.clip(trailer.steering_ratio * gamma, -trailer.max_steering_angle, trailer.max_steering_angle))
    sideways, along = np.sin(gamma) + wheels * np.cos(gamma), np.cos(gamma) - wheels * np.sin(gamma)
    share = lead.hitch_offset / trailer.wheelbase
    per_angle = 1.0 / (1.0 + share * along)
    x = np.concatenate([[0.0], np.cumsum(0.5 * (per_angle[1:] + per_angle[:-1]) * np.diff(gamma))])
    x -= np.interp(0.0, gamma, x)
    rate = sideways / (trailer.wheelbase + lead.hitch_offset * along)
    at = np.arange(x[0], x[-1] + _STEP, _STEP)
    return Coupling(lead.hitch_offset, abs(share), float(at[0]), _STEP, np.interp(at, x, gamma), np.interp(at, x, rate))
