"""How much room a drive left to the kerbs of its street: the simulated bodies, swept continuously, in the plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.driving.drive import Drive
from hdvplan.road.path import ReferencePath
from hdvplan.road.pieces import Pieces
from hdvplan.road.street import Street
from hdvplan.vehicle.body import axles_behind
from hdvplan.vehicle.model import Vehicle

# Where a body came nearest to a kerb while the vehicle moved from a pose to the next.
TOUCH = core.record("hdv_touch")
SIDES = ("left", "right")
_SECTIONS = core.number("HDV_SECTIONS")

_ROUNDS = 10  # of moving kerbs until a drive touches them
_NEAR_M = 1e-3  # to kerbs, that counts as touching

Touches = dict[tuple[str, str], Records]  # (units, n) of ``TOUCH``, by the side and the region of a kerb

_touch_many = core.function(
    "hdv_touch_many", core.POINTER, core.POINTER, core.INT, core.INT, core.POINTER, core.POINTER, core.INT, core.POINTER, core.POINTER,
    core.POINTER, core.POINTER,
)  # fmt: skip


def touches_of(drive: Drive, s: FloatArray, *, wheels_only: bool = False) -> Touches:
    """Return the tightest contact of every body with the street's kerbs, (units, n), beside each of the stations ``s`` [m].

    What lies before the road's start or beyond its end counts at its first or last station, and keeps its own arclength.
    Obstacles are no kerbs: see ``approaches``. The region "drivable" binds wheels and wheelbase where overhangs have kerbs of their own,
    else whole bodies; ``wheels_only`` looks at wheels and wheelbase alone. A gap is infinite where no body came near. Empty on a road
    without limits.
    """
    street, path = drive.road.kerbs, drive.stations.path
    if street is None:
        return {}
    own = tuple(kerb for kerb in street.kerbs if kerb.wheels)
    whole = tuple(kerb for kerb in street.kerbs if not kerb.wheels)
    regions = {"drivable": own} if own else {"drivable": whole}
    if wheels_only:
        regions = {"drivable": own or tuple(replace(kerb, wheels=True) for kerb in whole)}
    elif own:
        regions["sweepable"] = whole
    found: Touches = {}
    for region, kerbs in regions.items():
        pieces = replace(street, kerbs=kerbs).pieces(path.s_first, path.s_last)
        touches = touches_along(drive.vehicle, path, pieces, drive.poses_s, drive.poses_z, drive.poses_kappa)
        for number, side in enumerate(SIDES):
            found[side, region] = _beside(touches[:, :, number], s, street)
    return found


def half_width_of(drive: Drive, s: FloatArray, half: float) -> tuple[float, Touches]:
    """Return the least half width [m] about the line as given whose kerbs a drive keeps on the road, to 1 mm, and its contacts with them.

    ``half`` is that about the driven line, where the search begins. Kerbs that move in come nearer by as much, at corners by more or less.
    """
    for _ in range(_ROUNDS):
        touches = touches_of(replace(drive, road=replace(drive.road, regions=()).with_limits(half, half)), s)
        for touch in touches.values():
            touch["gap"][(touch["s"] < 0.0) | (touch["s"] > drive.road.path.length)] = np.inf
        gap = min(float(np.min(touch["gap"])) for touch in touches.values())
        if abs(gap) <= _NEAR_M or gap >= half:  # beside a leg of a few metres a body may be at no kerb at all
            break
        half -= gap
    return half, touches


def touches_along(vehicle: Vehicle, path: ReferencePath, pieces: Pieces, s: FloatArray, z: FloatArray, kappa: FloatArray) -> Records:
    """Return the touches from each pose to the next, (poses, units, 2, sections); beside nothing their piece is -1.

    The vehicle was driven from states ``z`` (poses, n) at arclengths ``s`` (poses,) [m], each with ``kappa`` (poses - 1,) [1/m].
    """
    units, behind, n = vehicle.table(), axles_behind(vehicle), vehicle.states
    s, z, kappa = (np.ascontiguousarray(column) for column in (s, z, kappa))
    touches = np.empty((len(s), len(units), len(SIDES), _SECTIONS), TOUCH)
    _touch_many(
        core.address(pieces.record), core.address(units), len(units), n, core.address(path.record), core.address(behind), len(s),
        core.address(s), core.address(z), core.address(kappa), core.address(touches),
    )  # fmt: skip
    return touches


def _beside(touches: Records, s: FloatArray, street: Street) -> Records:
    """Return the tightest of touches (poses, units, sections) beside each station."""
    apart = s[1] - s[0]
    first = s[0] - 0.5 * apart if s[0] > street.begin + apart else -np.inf
    last = s[-1] + 0.5 * apart if s[-1] < street.begin + street.length - apart else np.inf
    found = np.zeros((touches.shape[1], len(s)), TOUCH)
    found["gap"], found["s"], found["piece"] = np.inf, s, -1
    for to, of_unit in zip(found, np.moveaxis(touches, 1, 0), strict=True):
        along = of_unit["s"]
        along = street.begin + np.mod(along - street.begin, street.length) if street.closed else along
        beside = (of_unit["piece"] >= 0) & (along >= first) & (along <= last)  # of a part of a road, what lies beside it
        order = np.argsort(-of_unit["gap"][beside], kind="stable")  # the tightest is written last
        own = tuple(index[order] for index in np.nonzero(beside))
        at = np.clip(np.rint((along[own] - s[0]) / (s[1] - s[0])).astype(np.int64), 0, len(s) - 1)
        to[at] = of_unit[own]
        to["s"][at] = along[own]
    return found
