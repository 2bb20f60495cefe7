"""Roads as narrow as what was driven on them: each comes with the drive that fits, so that nothing may be proved impossible on it.

A vehicle drives a winding line, by a plan or by steering that no planner would choose; what it swept, less what still counts as kept, then
becomes the limits, and what it left free in the plane the obstacles.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import shapely

from hdvplan.api import drive_case
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.centring.weights import CentringTable
from hdvplan.driving.drive import Drive, simulate
from hdvplan.driving.start import start_of
from hdvplan.errors import HdvplanError
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.bodies import corners
from hdvplan.judging.envelope import Envelope
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.verdict import verdict_of
from hdvplan.planning.bias import Bias
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.planning.stations import stations_of
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

WAYS = ("planned", "steered", "bang-bang")
SETTINGS = PlannerSettings(horizon=60.0, step=0.5)
_OBJECTIVES = ("geometric", "lead-axle", "balanced", "trail-axle")
_INSIDE_M = 1e-3  # of what counts as kept: the judge's rounding
_WIDE_M = 6.0
_BESIDE_M = 1.0  # of room beside what was swept, where obstacles are meant to limit
_TIGHTEST = 0.8  # of the vehicle's curvature, of the roads
_AIM_M = 12.0  # of road between the offsets that a wandering drive aims at
_CORNER = 0.65  # of what counts as kept: a corner of a swept area lies further inside than its edges, by the root of two
_KEEP = 2  # simulated poses a step


@dataclass(frozen=True)
class Fitting:
    """A case that a drive fits, as judged, and how that was driven."""

    case: Case
    result: Result
    way: str


def fitting(seed: int, vehicle: Vehicle) -> Fitting | None:
    """Return the case of a seed; None where the drive leaves the road or cannot be judged."""
    rng = np.random.default_rng(seed)
    road, way = winding(rng, vehicle), str(rng.choice(WAYS))
    try:
        drive = _planned(rng, road, vehicle) if way == "planned" else steered(rng, road, vehicle, sudden=way == "bang-bang")
        if drive is None:
            return None
        narrow = as_narrow(rng, drive)
        result = result_of(replace(drive, road=narrow), solver="riccati", objective="geometric")
    except HdvplanError:
        return None
    return Fitting(result.case, result, way) if verdict_of(result).fits else None


def winding(rng: np.random.Generator, vehicle: Vehicle) -> Road:
    """Return a road of 40 to 80 m whose curvature changes every 6 to 20 m."""
    length, s, most = rng.uniform(40.0, 80.0), [0.0], _TIGHTEST * vehicle.max_curvature
    while s[-1] < length:
        s.append(s[-1] + rng.uniform(6.0, 20.0))
    curvature = rng.uniform(-most, most, len(s)) * (rng.random(len(s)) < rng.uniform(0.4, 1.0))
    return Road("winding", from_curvature(np.array(s), curvature))


def _planned(rng: np.random.Generator, road: Road, vehicle: Vehicle) -> Drive:
    room = _WIDE_M if rng.random() < 0.5 else rng.uniform(0.5 * vehicle.width + 0.2, 3.0)  # noqa: PLR2004 - half of them
    objective = str(rng.choice(_OBJECTIVES))
    bias = Bias.constant(float(rng.uniform(-0.5, 0.5)) if objective == "geometric" else 0.0)
    settings = replace(SETTINGS, scheme=Scheme(str(rng.choice(list(Scheme)))), smoothness=float(10.0 ** rng.uniform(0.0, 4.0)))
    return drive_case(Case(road.with_limits(room, room), vehicle, objective, settings=settings, bias=bias))


def steered(rng: np.random.Generator, road: Road, vehicle: Vehicle, *, sudden: bool) -> Drive | None:
    """Return a drive that wanders about its road, steering evenly or from lock to lock; None where it leaves the model's domain."""
    table = CentringTable.of(vehicle)
    stations = stations_of(road, vehicle, table, step=SETTINGS.step, horizon=SETTINGS.horizon)
    total, units = int(np.ceil(road.path.length / SETTINGS.step - 1e-9)), vehicle.table()
    nodes = np.arange(0.0, stations.s[-1] + _AIM_M, _AIM_M)
    aim = np.interp(stations.s, nodes, rng.uniform(-1.0, 1.0, len(nodes)))
    z, most, unrest = start_of(stations, vehicle).z, vehicle.max_curvature, rng.uniform(0.0, 1.0)
    fine, executed = [z[None]], []
    for at in range(total):
        here = stations.centring
        wanted = here.kappa[at] - 0.03 * (z[0] - here.e_y[at] - aim[at]) - 0.35 * z[1] + unrest * most * rng.normal()
        kappa = np.array([float(np.clip(np.sign(wanted) * most if sudden else wanted, -most, most))])
        part = simulate(units, stations.path, float(stations.s[at]), SETTINGS.step, z, kappa, _KEEP)
        if not np.all(np.isfinite(part)) or abs(part[-1, 0]) > _WIDE_M:
            return None
        fine.append(part[1:])
        executed.append(kappa)
        z = part[-1]
    poses = np.concatenate(fine)
    poses_s = SETTINGS.step / _KEEP * np.arange(len(poses), dtype=np.float64)
    goal = objective_named("geometric")(stations, vehicle)
    held = np.repeat(np.concatenate(executed), _KEEP)
    return Drive(road, vehicle, SETTINGS, stations, goal, poses[::_KEEP], np.concatenate(executed), poses_s, poses, held, (), 0.0)


def as_narrow(rng: np.random.Generator, drive: Drive) -> Road:
    """Return the drive's road with limits and obstacles that it just keeps, in places with some room to spare."""
    envelope = Envelope(drive)
    give = KEPT_M - _INSIDE_M
    spare = rng.choice([0.0, 0.02, 0.2]) * np.maximum(rng.normal(size=(2, len(envelope.s))), 0.0)
    low, high = (_known(reach) for reach in (envelope.reach_right, envelope.reach_left))
    sweep = high - give + spare[0], low + give - spare[1]
    inner = sweep
    if rng.random() < 0.3:  # noqa: PLR2004 - overhangs have room of their own in some
        axles = Envelope(drive, axles_only=True)
        inner = _known(axles.reach_left) - give, _known(axles.reach_right) + give
        inner = np.minimum(inner[0], sweep[0]), np.maximum(inner[1], sweep[1])
    road = replace(drive.road, limits=None, faces=None)
    regions = tuple(_obstacles(rng, drive)) if rng.random() < 0.4 else ()  # noqa: PLR2004 - as above
    if regions and rng.random() < 0.5:  # noqa: PLR2004 - in half of them little but the obstacles limits
        sweep = sweep[0] + _BESIDE_M, sweep[1] - _BESIDE_M
        return replace(road, regions=regions).within(Limits(envelope.s, *sweep, *sweep))
    return replace(road, regions=regions).within(Limits(envelope.s, inner[0], inner[1], sweep[0], sweep[1]))


def _known(reach: FloatArray) -> FloatArray:
    known = np.isfinite(reach)
    return np.interp(np.arange(len(reach)), np.flatnonzero(known), reach[known])


def _obstacles(rng: np.random.Generator, drive: Drive) -> Iterator[Region]:
    """Yield boxes beside the line, without what the drive swept of them."""
    outlines = corners(drive, np.arange(len(drive.poses_s)))
    pairs = np.concatenate([outlines[:-1], outlines[1:]], axis=2).reshape(-1, 8, 2)  # a body, here and at the next pose
    swept = shapely.union_all(shapely.convex_hull(shapely.linestrings(pairs)))
    path = drive.road.path
    for _ in range(int(rng.integers(1, 7))):
        s, offset = rng.uniform(0.0, path.length), rng.uniform(-4.0, 4.0)
        x, y = path.to_plane(s, offset)
        length, width = rng.uniform(0.5, 12.0), rng.uniform(0.5, 4.0)
        box = shapely.box(-0.5 * length, -0.5 * width, 0.5 * length, 0.5 * width)
        turned = shapely.affinity.rotate(box, float(rng.uniform(0.0, 180.0)))
        placed = shapely.affinity.translate(turned, float(x), float(y))
        for part in shapely.get_parts(shapely.difference(placed, shapely.buffer(swept, -_CORNER * KEPT_M))):
            if isinstance(part, shapely.Polygon) and part.area > 0.01:  # noqa: PLR2004 - slivers are no obstacles [m2]
                yield Region(Kind.OBSTACLE, part)
