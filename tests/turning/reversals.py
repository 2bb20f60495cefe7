"""The refuse vehicle of the tests, and an independent drive of a tractor with one trailer."""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

from hdvplan.arrays import FloatArray
from hdvplan.vehicle.load import parse_vehicle
from hdvplan.vehicle.model import Vehicle

REFUSE = """
name = "refuse"
source = "three axles, 11.2 m; rear axle's least radius 6.23 m"
[[unit]]
wheelbase = 5.85
front_overhang = 1.5
rear_overhang = 3.85
width = 2.55
max_curvature = 0.16051364
"""


def refuse() -> Vehicle:
    """Return the refuse vehicle of 11.2 m."""
    return parse_vehicle(REFUSE, default_name="refuse")


def towed(vehicle: Vehicle, begin: FloatArray, s: FloatArray, kappa: FloatArray, sign: float) -> FloatArray:
    """Return lead axle x, y, heading and trailer heading (n, 4) at arclengths ``s``, ``kappa`` held between them.

    The textbook's equations of a car with one off-axle trailer, integrated by SciPy from ``begin`` (4,); ``sign`` -1 drives backwards.
    """
    hitch, length = vehicle.lead.hitch_offset, vehicle.units[1].wheelbase

    def rates(_: float, state: FloatArray, kappa: float) -> FloatArray:
        _, _, heading, trailer = state
        beta = heading - trailer
        return sign * np.array([np.cos(heading), np.sin(heading), kappa, (np.sin(beta) - hitch * kappa * np.cos(beta)) / length])

    out, held = [begin], np.flatnonzero(np.diff(kappa)) + 1  # one piece of constant steering at a time
    for first, last in zip([0, *held], [*held, len(kappa)], strict=True):
        found = solve_ivp(
            rates, (s[first], s[last]), out[-1], "DOP853", s[first + 1 : last + 1], args=(kappa[first],), rtol=1e-12, atol=1e-12
        )
        out += list(found.y.T)
    return np.array(out)
