"""The articulation from which no steering brings a trailer back while the vehicle is driven backwards."""

from __future__ import annotations

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.vehicle.model import Vehicle


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
