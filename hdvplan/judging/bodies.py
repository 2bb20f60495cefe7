"""Where the bodies of a driven vehicle were, for drawing."""

from __future__ import annotations

import numpy as np

from hdvplan.driving.drive import Drive
from hdvplan.jit import FloatArray
from hdvplan.vehicle.kinematics import POSE, place


def corners(drive: Drive, pose: int) -> FloatArray:
    """Return the corners of every body at simulated pose number ``pose``, shape (units, 4, 2), x, y [m]."""
    path, units = drive.stations.path, drive.vehicle.table()
    point = path.at(drive.poses_s[pose])
    poses = np.empty(len(units), POSE)
    place(units, float(point.x), float(point.y), float(np.cos(point.heading)), float(np.sin(point.heading)), drive.poses_z[pose], poses)
    outlines = np.empty((len(units), 4, 2))
    for outline, unit, own in zip(outlines, units, poses, strict=True):
        along = np.array([unit["front"], unit["front"], -unit["rear_overhang"], -unit["rear_overhang"]])
        across = unit["half_width"] * np.array([1.0, -1.0, -1.0, 1.0])
        outline[:, 0] = own["x"] + along * own["cos"] - across * own["sin"]
        outline[:, 1] = own["y"] + along * own["sin"] + across * own["cos"]
    return outlines


def pose_at(drive: Drive, s: float) -> int:
    """Return the number of the simulated pose nearest to arclength ``s`` [m]."""
    return int(np.argmin(np.abs(drive.poses_s - s)))
