"""The largest reach as an objective, see ``core/reach.c``."""

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.stations import Stations
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.model import Vehicle
from tests.core.twins.kinematics import body_point, gradient, places
from tests.core.twins.path import PLANNING_STEP_M, project


def begin_feet(vehicle: Vehicle, stations: Stations, points: Records, station: int) -> FloatArray:
    """Return the feet as on a straight, (units, points, 2)."""
    ahead = stations.s[station] + points["ahead"] - axles_behind(vehicle)[:, None]
    return np.repeat(ahead[:, :, None], 2, axis=2)


def rows(
    vehicle: Vehicle, stations: Stations, points: Records, half: FloatArray, station: int, z: FloatArray, feet: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return g (rows, n) and h of all watched points at a station, left edge before right; ``feet`` is warm start and result."""
    units, at = vehicle.table(), stations.points[station]
    axles, normal = places(units, np.array([at["x"], at["y"], at["cos"], at["sin"]]), z), np.array([-at["sin"], at["cos"]])
    g, h = [], []
    for unit, own in enumerate(points):
        for side, sign in enumerate((1.0, -1.0)):
            for point, ahead in enumerate(own["ahead"]):
                x, y = body_point(axles[unit], ahead, sign * half[unit])
                foot, offset, cos, sin, _ = project(stations.path, x, y, feet[unit, point, side], PLANNING_STEP_M)
                feet[unit, point, side] = foot
                g.append(sign * gradient(units, axles, unit, np.array([x, y]), normal, np.array([-sin, cos]), len(z)))
                h.append(-sign * offset)
    return np.array(g), np.array(h)
