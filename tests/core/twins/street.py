"""How near a body is to kerbs, by other means than ``core/street.c``: rectangles, lines and points of shapely."""

from collections.abc import Sequence

import numpy as np
import shapely

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.stations import Stations
from hdvplan.road.pieces import Kerb, Pieces
from hdvplan.road.street import Street
from hdvplan.vehicle.kinematics import POSE, axles_behind, place_many
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.twins.kinematics import evaluate, rates

SECTIONS = core.number("HDV_SECTIONS")
TO_PLAN, TO_JUDGE = 0, 1  # enum hdv_look
SEEN_M = 0.1  # as in street.c
CONTACT = core.record("hdv_contact")
CONTACTS = np.dtype([("at", CONTACT, (2, SECTIONS)), ("near", float, 2), ("overhang", CONTACT, (2, 2))])
_LOOK = core.function("hdv_look_many", core.POINTER, core.INT, core.POINTER, core.INT, core.INT, *[core.POINTER] * 4)


def look(pieces: Pieces, vehicle: Vehicle, s: FloatArray, poses: Records, how: int = TO_PLAN) -> Records:
    """Return the contacts (poses, units) of a vehicle whose lead axle is at arclengths ``s``, at poses (poses, units)."""
    found, units = np.empty(poses.shape, CONTACTS), vehicle.table()
    s, poses, behind = np.ascontiguousarray(s, float), np.ascontiguousarray(poses), axles_behind(vehicle)
    addresses = map(core.address, (behind, s, poses, found))
    _LOOK(core.address(pieces.record), how, core.address(units), len(units), len(s), *addresses)
    return found


def state_before(vehicle: Vehicle, stations: Stations, at: int, x: FloatArray, back: float) -> FloatArray:
    """Return the state so far back before a station [m]: ``x`` is the state there, and the curvature held until it.

    The backward step is one of the explicit midpoint rule, wheels held.
    """
    units, s, kappa = vehicle.table(), float(stations.s[at]), float(x[-1])

    def rate(place: float, z: FloatArray) -> FloatArray:
        slope = rates(units, float(evaluate(stations.path, place)[4]), z, kappa)
        slope[vehicle.rigid_states :] = 0.0
        return slope

    z: FloatArray = x[:-1] - back * rate(s - 0.5 * back, x[:-1] - 0.5 * back * rate(s, x[:-1])) if back else x[:-1]
    return z


def gaps(vehicle: Vehicle, stations: Stations, s: FloatArray, z: FloatArray) -> FloatArray:
    """Return the gaps (n, units, 2, sections) that a plan looks for, with the lead axle at arclengths ``s`` (n,) in states ``z``."""
    points = np.stack([evaluate(stations.path, float(at)) for at in s], axis=1)
    assert stations.street is not None
    found: FloatArray = look(stations.street, vehicle, s, place_many(vehicle.table(), points, np.ascontiguousarray(z)))["at"]["gap"]
    return found


def standing(x: float, y: float, heading: float) -> Records:
    """Return the pose of a body, (1, 1)."""
    pose = np.zeros((1, 1), POSE)
    pose["x"], pose["y"], pose["cos"], pose["sin"] = x, y, np.cos(heading), np.sin(heading)
    return pose


def street_of(*kerbs: Kerb, length: float = 1000.0, closed: bool = False, line: FloatArray | None = None) -> Pieces:
    """Return the pieces of kerbs along a line eastwards."""
    return Street(kerbs, length, closed, np.array([[1.0, 0.0], [1.0, 0.0]]), line).pieces(0.0, length)


def outline(unit: Unit, pose: Records, *, wheels: bool = False) -> FloatArray:
    """Return the corners of a body, or of what lies between its axles, (4, 2): rear right, front right, front left, rear left."""
    rear, front, half = (
        (0.0, min(unit.wheelbase, unit.front), 0.5 * unit.width) if wheels else (-unit.rear_overhang, unit.front, 0.5 * unit.width)
    )
    ahead, left = np.array([rear, front, front, rear]), np.array([-half, -half, half, half])
    return np.stack([pose["x"] + ahead * pose["cos"] - left * pose["sin"], pose["y"] + ahead * pose["sin"] + left * pose["cos"]], axis=1)


def signed(line: shapely.LineString, beyond: shapely.Polygon, points: FloatArray) -> FloatArray:
    """Return the distance of points from a kerb, negative in the area beyond it."""
    places = shapely.points(points)
    distance = shapely.distance(places, line)
    return np.where(shapely.contains_properly(beyond, places), -distance, distance)


def protruding(points: FloatArray, *, left: bool) -> FloatArray:
    """Return the inner points of a kerb that stand into its street, and where their bisectors lead behind it, (2, n, 2)."""
    one, other = points[1:-1] - points[:-2], points[2:] - points[1:-1]
    turn = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    ways = one / np.hypot(*one.T)[:, None] + other / np.hypot(*other.T)[:, None]
    behind = (1.0 if left else -1.0) * ways[:, ::-1] * [-1.0, 1.0]
    return np.stack([points[1:-1], behind])[:, turn > 0.0 if left else turn < 0.0]


def furthest_within(corners: FloatArray, line: shapely.LineString, *, left: bool) -> float:
    """Return how far a kerb reaches into a body's outline, from the side that faces it and from both ends: 0 if it does not."""
    axis, across = (corners[1] - corners[0]) / np.hypot(*(corners[1] - corners[0])), (corners[3] - corners[0]) * (1.0 if left else -1.0)
    across /= np.hypot(*across)
    facing, other = (corners[[3, 2]], corners[[0, 1]]) if left else (corners[[0, 1]], corners[[3, 2]])
    low, high = 0.0, min(np.hypot(*(facing[0] - other[0])), 0.5 * np.hypot(*(facing[1] - facing[0])))
    while high - low > 1e-11:
        depth = 0.5 * (low + high)
        inner = [facing[0] + depth * (axis - across), facing[1] - depth * (axis + across), other[1] - depth * axis, other[0] + depth * axis]
        low, high = (depth, high) if shapely.intersects(shapely.Polygon(inner), line) else (low, depth)
    return low


def deepest(corners: FloatArray, points: FloatArray, *, left: bool, beyond: shapely.Polygon, stands: FloatArray) -> float:
    """Return the gap between a body's outline and a kerb: of its corners, and of the kerb's protruding points beside or inside it.

    ``stands`` are these, and where their bisectors lead: what is deepest behind one that a body has left behind it lies there. Where that
    is no more than a wall may be thick, the gap is how far the kerb reaches into the outline.
    """
    line = shapely.LineString(points)
    gaps: list[float] = list(signed(line, beyond, corners))
    sides = [shapely.LineString(corners[[0, 1]]), shapely.LineString(corners[[2, 3]])]  # right and left
    ends = shapely.MultiLineString([corners[[1, 2]], corners[[3, 0]]])
    body, axis = shapely.Polygon(corners), corners[1] - corners[0]
    for place, way in zip(*stands, strict=True):
        share = (place - corners[0]) @ axis / (axis @ axis)
        if 0.0 <= share <= 1.0:
            at = shapely.Point(place)
            apart = shapely.distance(sides[left], at)
            if body.contains(at):
                gaps.append(-min(apart, shapely.distance(ends, at)))
            elif apart < shapely.distance(sides[not left], at):
                gaps.append(apart)
            elif shapely.intersects(bisector := shapely.LineString([place, place + 1e3 * way]), sides[left]):
                gaps += list(signed(line, beyond, shapely.get_coordinates(shapely.intersection(bisector, sides[left]))))
    return min(gaps) if min(gaps) < -SEEN_M else min(*gaps, -furthest_within(corners, line, left=left) or np.inf)


def dense(points: Sequence[tuple[float, float]]) -> Kerb:
    """Return the left kerb through points, whose s is x."""
    line = np.array(points)
    return Kerb(line, line[:, 0].copy(), left=True)
