"""Where the bodies of a driven vehicle were, for drawing."""

from __future__ import annotations

import numpy as np

from hdvplan.driving.drive import Drive
from hdvplan.jit import FloatArray
from hdvplan.vehicle.kinematics import place


def corners(drive: Drive, pose: int) -> FloatArray:
    """Return the corners of every body at simulated pose number ``pose``, shape (units, 4, 2), x, y [m]."""
    path, units = drive.stations.path, drive.vehicle.table()
    point = path.at(drive.poses_s[pose])
    poses = np.empty((len(units), 6))
    place(units, float(point.x), float(point.y), float(np.cos(point.heading)), float(np.sin(point.heading)), drive.poses_z[pose], poses)
    outlines = np.empty((len(units), 4, 2))
    for outline, (front, rear, half), (x, y, cos, sin, _, _) in zip(outlines, units[:, 2:5], poses, strict=True):
        along, across = np.array([front, front, -rear, -rear]), np.array([half, -half, -half, half])
        outline[:, 0], outline[:, 1] = x + along * cos - across * sin, y + along * sin + across * cos
    return outlines


def pose_at(drive: Drive, s: float) -> int:
    """Return the number of the simulated pose nearest to arclength ``s`` [m]."""
    return int(np.argmin(np.abs(drive.poses_s - s)))
