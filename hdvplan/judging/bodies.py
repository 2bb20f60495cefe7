"""The positions of the bodies of a driven vehicle, for drawing."""

from __future__ import annotations

import numpy as np

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.driving.drive import Drive
from hdvplan.road.path import evaluate_many
from hdvplan.vehicle.kinematics import place_many


def placed(drive: Drive, numbers: IntArray) -> Records:
    """Return where all bodies are at the simulated poses of the given ``numbers``, shape (poses, units) of ``POSE``."""
    points = evaluate_many(drive.stations.path, drive.poses_s[numbers])
    return place_many(drive.vehicle.table(), points, drive.poses_z[numbers])


def corners(drive: Drive, numbers: IntArray, *, axles_only: bool = False) -> FloatArray:
    """Return the corners of every body at the simulated poses of the given ``numbers``, shape (poses, units, 4, 2), x, y [m].

    ``axles_only`` leaves the overhangs out.
    """
    units, poses = drive.vehicle.table(), placed(drive, numbers)[..., None]
    front = np.minimum(units["wheelbase"], units["front"]) if axles_only else units["front"]
    rear = np.zeros(len(units)) if axles_only else -units["rear_overhang"]
    along = np.stack([front, front, rear, rear], axis=1)
    across = units["half_width"][:, None] * np.array([1.0, -1.0, -1.0, 1.0])
    x = poses["x"] + along * poses["cos"] - across * poses["sin"]
    return np.stack([x, poses["y"] + along * poses["sin"] + across * poses["cos"]], axis=-1)


def pose_at(drive: Drive, s: float) -> int:
    """Return the number of the simulated pose nearest to arclength ``s`` [m]."""
    return int(np.argmin(np.abs(drive.poses_s - s)))
