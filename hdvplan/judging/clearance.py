"""How much room a drive left in the plane: to the kerbs of its street, of bodies swept continuously, and to every obstacle.

Neither depends on limits along s.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import shapely
import shapely.affinity
from numpy.typing import NDArray

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.driving.drive import Drive, simulate
from hdvplan.errors import RoadError
from hdvplan.judging.bodies import judged_to, outlines_of, part_named, placed
from hdvplan.road.limits import WIDEST_M
from hdvplan.road.passages import furthest, normals
from hdvplan.road.path import ReferencePath, project_many
from hdvplan.road.pieces import Pieces
from hdvplan.road.regions import Kind, Region
from hdvplan.road.street import Street
from hdvplan.vehicle.kinematics import axles_behind
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

    Raises:
        RoadError: none is found, as the line as given goes back and forth.

    """
    for _ in range(_ROUNDS):
        if half > WIDEST_M:
            msg = f"no half width about the line as given is found, up to {WIDEST_M:g} m, that holds what is swept"
            raise RoadError(msg, hint="do its points go back and forth, as a GPS receiver's that stands? take those out")
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


_CLOSE_M = 0.4  # to an obstacle: further than any point of a vehicle moves from one simulated pose to the next
_APART_M = 0.02  # of poses close to an obstacle: in the tightest bends a corner swings out by as much from one to the next
_LEAP_M = 5.0  # along the road, from one stretch on which an obstacle is entered to the next
_DIGITS = 9  # of depths, which are rounded to compare them [m]

Shapes = NDArray[np.object_]

_PLACE = np.dtype([("body", np.intp), ("point", np.float64, 2), ("distance", np.float64), ("s_from", np.float64), ("s_to", np.float64)])


@dataclass(frozen=True)
class Approach:
    """Where a drive came nearest to an obstacle, or was deepest in it."""

    obstacle: Region
    distance: float  # least distance of any body; negative: how deep one was inside [m]
    s: float  # of the place on the road [m]; before 0 or beyond the road's length where the obstacle lies beside neither
    s_from: float  # the places that a body was inside, or the nearest one [m]
    s_to: float
    x: float  # of the place [m]
    y: float
    unit: int
    side: str  # of the body, "left" or "right"
    part: str  # of the body, see ``contact``
    stretches: tuple[Approach, ...] = ()  # of an obstacle that was entered in several places, such as a long one: each of them

    @classmethod
    def of(cls, stretches: list[Approach]) -> Approach:
        """Return the one of an obstacle from those of its stretches: the deepest, from the first to the last."""
        deepest = min(stretches, key=lambda one: round(one.distance, _DIGITS))
        first, last = min(one.s_from for one in stretches), max(one.s_to for one in stretches)
        return replace(deepest, s_from=first, s_to=last, stretches=tuple(stretches)) if len(stretches) > 1 else deepest


def approaches(drive: Drive) -> tuple[Approach, ...]:
    """Return the nearest approach to each obstacle of the road, at the simulated poses, and every 2 cm where a body is close to one.

    Once the lead axle has left an open road, only what is still on the road counts.
    """
    obstacles = [region for region in drive.road.regions if region.kind is Kind.OBSTACLE]
    if not obstacles:
        return ()
    polygons = np.array([obstacle.polygon for obstacle in obstacles], dtype=object)
    drive = _closely(drive, polygons)
    numbers, places = _places(drive, polygons, polygons)
    pose, unit = np.divmod(places["body"], len(drive.vehicle.units))
    ahead, across = _on_bodies(drive, pose, unit, places["point"])
    s = _along(drive, pose, unit, ahead, places["point"])
    lap = np.floor(s / drive.road.path.length) * drive.road.path.length if drive.road.path.closed else np.zeros(len(s))
    s, s_from, s_to = s - lap, np.fmin(places["s_from"], s) - lap, np.fmax(places["s_to"], s) - lap
    x, y = places["point"].T
    found: list[list[Approach]] = [[] for _ in obstacles]
    for i, number in enumerate(numbers):
        side, part = "left" if across[i] > 0.0 else "right", part_named(drive.vehicle.units[unit[i]], float(ahead[i]))
        span, point = (float(s[i]), float(s_from[i]), float(s_to[i])), (float(x[i]), float(y[i]))
        found[number].append(Approach(obstacles[number].at(*point), float(places["distance"][i]), *span, *point, int(unit[i]), side, part))
    return tuple(map(Approach.of, found))


def rooms_beside(drive: Drive, s: FloatArray) -> FloatArray:
    """Return how far bodies stay from what of obstacles lies beside each of the stations ``s``, (n,) [m], as ``approaches`` has it.

    Infinite where none does, on the road's side of the kerb.
    """
    road, rooms = drive.road, np.full(len(s), np.inf)
    polygons = np.array([region.polygon for region in road.regions if region.kind is Kind.OBSTACLE], dtype=object)
    if road.beside is None or not len(polygons):
        return rooms
    edges = np.concatenate([s[:1], 0.5 * (s[1:] + s[:-1]), s[-1:]])
    here, reach = road.path.at(edges), np.abs(road.beside.table(edges)[2:])
    most = np.minimum(reach, [furthest(here.curvature), furthest(-here.curvature)])
    centre, normal = normals(here)
    ends = np.stack([centre + most[0, :, None] * normal, centre - most[1, :, None] * normal], axis=1)
    strips = np.asarray(shapely.convex_hull(shapely.linestrings(np.concatenate([ends[:-1], ends[1:]], axis=1))))
    number, station = shapely.STRtree(strips).query(polygons, predicate="intersects")
    parts = np.asarray(shapely.intersection(polygons[number], strips[station]))
    of_parts, places = _places(_closely(drive, polygons), parts, polygons[number])
    np.minimum.at(rooms, station[of_parts], places["distance"])
    return rooms


def _places(drive: Drive, parts: Shapes, wholes: Shapes) -> tuple[IntArray, NDArray[np.void]]:
    """Return the numbers of ``parts`` of obstacles ``wholes`` and where bodies come nearest, or are deepest on each stretch of one."""
    bodies = outlines_of(drive)
    leaving = np.repeat(drive.poses_s > judged_to(drive), len(drive.vehicle.units))
    bodies[leaving] = shapely.intersection(bodies[leaving], _before_end(drive))
    tree = shapely.STRtree(bodies)
    within, entered = _entered(drive, parts, wholes, bodies, tree)
    apart = np.setdiff1d(np.arange(len(parts)), within)
    return np.concatenate([within, apart]), np.concatenate([entered, _nearest(parts[apart], bodies, tree)])


def _closely(drive: Drive, polygons: Shapes) -> Drive:
    """Return a drive with more poses between those at which a body is close to one of the polygons."""
    tree = shapely.STRtree(outlines_of(drive))
    close = np.zeros(len(drive.poses_s), bool)
    close[tree.query(polygons, predicate="dwithin", distance=_CLOSE_M)[1] // len(drive.vehicle.units)] = True
    spacing, wheels = float(drive.poses_s[1] - drive.poses_s[0]), drive.poses_z[:, drive.vehicle.rigid_states :]
    count, units, path = int(np.ceil(spacing / _APART_M)), drive.vehicle.table(), drive.stations.path
    s, z = [drive.poses_s], [drive.poses_z]
    begun = np.flatnonzero(close[:-1])
    for stretch in np.split(begun, np.flatnonzero(np.diff(begun) > 1) + 1):
        if len(stretch):
            first, last = int(stretch[0]), int(stretch[-1]) + 1
            begin, kappa = float(drive.poses_s[first]), drive.poses_kappa[first:last]
            states = simulate(units, path, begin, spacing, drive.poses_z[first], kappa, count, wheels[first : last + 1])
            z.append(states)
            s.append(begin + spacing / count * np.arange(len(states), dtype=float))
    order = np.argsort(np.concatenate(s), kind="stable")
    return replace(drive, poses_s=np.concatenate(s)[order], poses_z=np.concatenate(z)[order])


def _before_end(drive: Drive) -> shapely.Polygon:
    """Return what lies before the normal at the road's end, as far as bodies of a vehicle reach that is leaving it."""
    end = drive.road.path.at(drive.road.path.length)
    reach = 2.0 * (drive.vehicle.reach_ahead + drive.vehicle.reach_behind)
    x, y = float(end.x), float(end.y)
    before = shapely.box(x - reach, y - reach, x, y + reach)
    return shapely.affinity.rotate(before, float(end.heading), origin=(x, y), use_radians=True)


def _nearest(obstacles: Shapes, bodies: Shapes, tree: shapely.STRtree) -> NDArray[np.void]:
    """Return where bodies come nearest to obstacles that none of them meets."""
    places = np.empty(len(obstacles), _PLACE)
    places["body"] = tree.nearest(obstacles)
    places["s_from"] = places["s_to"] = np.nan  # none but the place itself
    lines = shapely.shortest_line(bodies[places["body"]], obstacles)
    places["distance"], places["point"] = shapely.length(lines), shapely.get_coordinates(lines)[::2]
    return places


def _entered(drive: Drive, parts: Shapes, wholes: Shapes, bodies: Shapes, tree: shapely.STRtree) -> tuple[IntArray, NDArray[np.void]]:
    """Return the numbers of the parts that bodies meet, and where one is deepest in the whole of each, on every stretch of it."""
    met, inside = tree.query(parts, predicate="intersects")
    overlaps = shapely.intersection(bodies[inside], parts[met])
    within = shapely.point_on_surface(overlaps)  # corners alone would miss a wall that crosses a body from side to side
    points, owner = shapely.get_coordinates(np.concatenate([overlaps, within]), return_index=True)
    if not len(points):
        return np.empty(0, np.intp), np.empty(0, _PLACE)
    owner %= len(overlaps)
    pose, unit = np.divmod(inside[owner], len(drive.vehicle.units))
    s = _along(drive, pose, unit, _on_bodies(drive, pose, unit, points)[0], points)
    order = np.lexsort((s, met[owner]))
    points, owner, s = points[order], owner[order], s[order]
    begins = np.append(True, (np.diff(met[owner]) > 0) | (np.diff(s) > _LEAP_M))
    row, first = np.cumsum(begins) - 1, np.flatnonzero(begins)
    spots = shapely.points(points)
    in_body = shapely.distance(spots, shapely.boundary(bodies[inside])[owner])
    # How far within the outline of the body or of the obstacle, whichever is further.
    depths = np.maximum(in_body, shapely.distance(spots, shapely.boundary(wholes)[met[owner]]))
    ranked = np.lexsort((-in_body, -np.round(depths, _DIGITS), row))  # of places equally deep that furthest in a body
    deepest = ranked[np.unique(row[ranked], return_index=True)[1]]
    places = np.empty(len(first), _PLACE)
    places["body"], places["point"], places["distance"] = inside[owner[deepest]], points[deepest], -depths[deepest]
    places["s_from"], places["s_to"] = np.minimum.reduceat(s, first), np.maximum.reduceat(s, first)
    return met[owner[first]], places


def _on_bodies(drive: Drive, poses: IntArray, units: IntArray, points: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return how far points in the plane, shape (n, 2), lie ahead of a body's axle and left of its middle, shape (n,) each [m]."""
    numbers, row = np.unique(poses, return_inverse=True)
    at = placed(drive, numbers)[row, units]
    x, y = points[:, 0] - at["x"], points[:, 1] - at["y"]
    return x * at["cos"] + y * at["sin"], y * at["cos"] - x * at["sin"]


def _along(drive: Drive, poses: IntArray, units: IntArray, ahead: FloatArray, points: FloatArray) -> FloatArray:
    """Return the arclengths of points (n, 2) that bodies were at; where the road bends too tightly for a foot, those of a straight."""
    near = drive.poses_s[poses] - np.asarray(axles_behind(drive.vehicle))[units] + ahead
    s, offset = project_many(drive.stations.path, points[:, 0], points[:, 1], near)[:2]
    return np.where(np.isfinite(offset), s, near)
