"""Drive a whole road in receding horizon: plan, execute a few metres as an exact simulation, plan again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.centring.stationary import CentringTable
from hdvplan.driving.start import Start, approach_to, kept_start, lies_beside, start_of
from hdvplan.errors import PlanError, RoadError
from hdvplan.planning.bias import NONE, Bias
from hdvplan.planning.objectives import Goal, Objective
from hdvplan.planning.planner import Plan, Planner
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations, stations_of
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.road.path import ReferencePath
from hdvplan.road.road import Road
from hdvplan.vehicle.model import Vehicle

SUBSTEP_M = 0.05  # the integration error of 100 m is then below 1e-6 m (tested against an adaptive integrator)

_simulate = core.function(
    "hdv_simulate", core.POINTER, core.INT, core.INT, core.POINTER, core.REAL, core.INT, core.REAL, core.POINTER, core.POINTER,
    core.INT, core.INT, core.POINTER,
)  # fmt: skip


def simulate(
    units: Records, path: ReferencePath, s_start: float, step: float, z_start: FloatArray, kappa: FloatArray, keep: int,
    steering: FloatArray | None = None,
) -> FloatArray:  # fmt: skip
    """Return the states while driving ``kappa`` [1/m], each value held over ``step`` [m] of road; shape (len(kappa) * keep + 1, n).

    Where ``step`` is negative the vehicle is driven backwards.

    ``steering`` (len(kappa) + 1, active) are the angles of active wheels at the ends of the steps; without it they are held [rad].
    ``keep`` states are returned for every step. NaN from where the model leaves its domain (1 - e_y k <= 0, or the lead rear axle
    no longer moves forward along the road).
    """
    n = len(z_start)
    if steering is None:
        steering = np.tile(z_start[1 + len(units) :], (len(kappa) + 1, 1))
    kappa, steering = np.ascontiguousarray(kappa, dtype=float), np.ascontiguousarray(steering, dtype=float)
    states = np.full((len(kappa) * keep + 1, n), np.nan)
    states[0] = z_start
    _simulate(
        core.address(units), len(units), n, core.address(path.record), s_start, len(kappa), step, core.address(kappa),
        core.address(steering), keep, int(np.ceil(abs(step) / keep / SUBSTEP_M)), core.address(states),
    )  # fmt: skip
    return states


_ROUNDING_M = 1e-6  # of arclengths
POSE_SPACING_M = 0.25  # simulated poses are kept at least this densely


@dataclass(frozen=True)
class Drive:
    """What was executed: one sample per station from the road's start to its end, and every plan on the way.

    The poses go on beyond the end with the rest of the last plan, until the last body has left the road or that plan ends.
    """

    road: Road
    vehicle: Vehicle
    settings: PlannerSettings
    stations: Stations
    goal: Goal
    z: FloatArray  # (samples, n), simulated states at the stations
    kappa: FloatArray  # (samples - 1,), executed curvature [1/m]
    poses_s: FloatArray  # (poses,), arclengths of the finer simulated states [m]
    poses_z: FloatArray  # (poses, n)
    poses_kappa: FloatArray  # (poses - 1,), held from each pose to the next [1/m]
    plans: tuple[Plan, ...]
    prediction_error: float  # largest difference of planned and simulated position over the executed parts [m]
    bias: Bias = NONE  # where the middle of the swept envelope was wanted

    def __repr__(self) -> str:
        """Return one line: all plans together have millions of signs."""
        return f"<{type(self).__name__} of {self.vehicle.name} on {self.road.name}: {self.road.path.length:.1f} m, {len(self.plans)} plans>"

    @property
    def steering(self) -> FloatArray:
        """Angles of the wheels that the plan steers, at the stations, changing evenly between them, (samples, active) [rad]."""
        return self.z[:, self.vehicle.rigid_states :]


def drive(
    road: Road,
    vehicle: Vehicle,
    objective: Objective,
    make_workspace: WorkspaceMaker,
    settings: PlannerSettings,
    *,
    bias: Bias = NONE,
    on_progress: Callable[[float], None] | None = None,
    on_plan: Callable[[Plan], None] | None = None,
) -> Drive:
    """Plan and execute ``vehicle`` along all of ``road``; ``on_progress`` receives the driven share after each step.

    ``bias`` is where the middle of the swept envelope should lie. ``hdvplan.driving.start`` says how the vehicle stands at the start.
    ``on_plan`` receives every plan before it is executed, so that a drive that ends in an error, its own or the caller's, leaves its
    plans.

    Raises:
        RoadError: the road is shorter than the vehicle.
        OptionError: a bias that the road has no room for, or with an objective that cannot have one.
        PlanError: the vehicle cannot be planned further, or the executed motion leaves the model's domain.

    """
    return driven(ready(road, vehicle, objective, make_workspace, settings, bias), on_progress, on_plan)


@dataclass(frozen=True)
class Ready:
    """A vehicle where its drive along a road begins, and what plans it."""

    road: Road
    vehicle: Vehicle
    settings: PlannerSettings
    bias: Bias
    stations: Stations
    begin: Start
    goal: Goal
    planner: Planner


def ready(
    road: Road, vehicle: Vehicle, objective: Objective, make_workspace: WorkspaceMaker, settings: PlannerSettings, bias: Bias, *,
    stationary: bool = False, after: Drive | None = None,
) -> Ready:  # fmt: skip
    """Return what a drive begins with; see ``drive`` for arguments and errors. A ``stationary`` start is neither approached nor moved.

    A drive that goes on where the road of another one ended, ``after`` that, begins as that one stood there.
    """
    length = vehicle.reach_ahead + vehicle.reach_behind
    if road.path.length < length:
        msg = f"the road is {road.path.length:.1f} m long, shorter than the vehicle ({length:.1f} m)"
        raise RoadError(msg)
    stations = stations_of(road, vehicle, CentringTable.of(vehicle), step=settings.step, horizon=settings.horizon, bias=bias)
    stations = stations.giving_way(settings)
    begin = start_of(stations, vehicle) if after is None else Start(after.z[-1], float(after.kappa[-1]))
    if not stationary and after is None:
        if not lies_beside(stations.path, vehicle, begin.z):
            begin = _arrived(road, vehicle, objective, make_workspace, settings, bias)
        begin = kept_start(stations, vehicle, begin, settings.clearance - float(stations.points["give_way"][0]))
    goal = objective(stations, vehicle)
    return Ready(road, vehicle, settings, bias, stations, begin, goal, Planner(vehicle, stations, goal, settings, make_workspace))


def driven(begun: Ready, on_progress: Callable[[float], None] | None = None, on_plan: Callable[[Plan], None] | None = None) -> Drive:
    """Plan and execute from a start to the road's end, then what is left of the last plan, so that all bodies leave the road."""
    road, vehicle, settings, stations = begun.road, begun.vehicle, begun.settings, begun.stations
    keep = int(np.ceil(settings.step / POSE_SPACING_M))
    total = int(np.ceil(road.path.length / settings.step - 1e-9))
    z, kappa_before = begun.begin
    fine, steered, plans, error = [z[None]], [], [], 0.0
    at = 0
    while at < total:
        plan = begun.planner.plan(at, z, kappa_before)
        if on_plan is not None:
            on_plan(plan)
        count = min(settings.executed, total - at)
        part = executed(vehicle, stations, plan, slice(0, count), z, keep)
        error = max(error, float(np.max(np.abs(part[::keep, 0] - plan.z[: count + 1, 0]))))
        fine.append(part[1:])
        steered.append(plan.kappa[:count])
        plans.append(plan)
        z, kappa_before, at = part[-1], float(plan.kappa[count - 1]), at + count
        if on_progress is not None:
            on_progress(at / total)
    leaving = slice(count, count + int(np.ceil(vehicle.reach_behind / settings.step)))
    fine.append(executed(vehicle, stations, plan, leaving, z, keep)[1:])
    poses, held = np.concatenate(fine), np.repeat(np.concatenate([*steered, plan.kappa[leaving]]), keep)
    poses_s = settings.step / keep * np.arange(len(poses), dtype=np.float64)
    return Drive(
        road, vehicle, settings, stations, begun.goal, poses[: keep * total + 1 : keep], np.concatenate(steered), poses_s, poses, held,
        tuple(plans), error, begun.bias,
    )  # fmt: skip


def among(here: Drive, before: Drive | None, after: Drive | None, room: float) -> Drive:
    """Return a drive with what others had driven ``before`` its road and drove ``after`` it, as far as bodies reach and ``room`` [m].

    The roads go on from one to the next: bodies that lie on two of them are then seen whole from each.
    """
    vehicle, length, rows = here.vehicle, here.road.path.length, []
    first, last = -vehicle.reach_ahead - room, length + vehicle.reach_behind + room
    neighbours = [(here, 0.0, 0.0, np.inf if after is None else length)]
    neighbours += [] if before is None else [(before, -before.road.path.length, first, 0.0)]
    neighbours += [] if after is None else [(after, length, length, last)]
    for drive_, shift, begin, end in sorted(neighbours, key=lambda one: one[1]):
        s = drive_.poses_s + shift
        own = (s >= begin - _ROUNDING_M) & (s < end - _ROUNDING_M)
        rows.append((s[own], drive_.poses_z[own], np.append(drive_.poses_kappa, 0.0)[own]))
    poses_s, poses_z, poses_kappa = (np.concatenate(column) for column in zip(*rows, strict=True))
    return replace(here, poses_s=poses_s, poses_z=poses_z, poses_kappa=poses_kappa[:-1])


def executed(vehicle: Vehicle, stations: Stations, plan: Plan, part: slice, z: FloatArray, keep: int) -> FloatArray:
    """Return ``keep`` simulated states for each step of a part of a plan, which begins in state ``z``.

    Raises:
        PlanError: the motion leaves the model's domain.

    """
    kappa, begin, step = plan.kappa[part], float(stations.s[plan.first + part.start]), stations.step
    wheels = plan.z[part.start : part.start + len(kappa) + 1, vehicle.rigid_states :]
    states = simulate(vehicle.table(), stations.path, begin, step, z, kappa, keep, wheels)
    if not np.all(np.isfinite(states)):
        s = begin + step / keep * float(np.argmin(np.isfinite(states[:, 0])))
        msg = f"at s = {s:z.1f} m the executed motion leaves the road-aligned model's domain"
        raise PlanError(msg, s_m=s, hint=_remedy(vehicle, stations, plan))
    return states


def _remedy(vehicle: Vehicle, stations: Stations, plan: Plan) -> str:
    """Return what helps where a motion leaves the line: another vehicle where the wheels, turned all the way, turn less than it bends."""
    near = slice(max(plan.first - len(plan.kappa), 0), plan.first + len(plan.kappa))  # what is planned, and as much behind it
    bends, rate = float(np.ptp(stations.curvature[near])), vehicle.max_curvature_rate
    if bends > rate * stations.step * len(stations.s[near]):
        return f"the {vehicle.name} steers too slowly for any way along the line: max_curvature_rate = {rate:g} 1/m^2, per metre travelled"
    return "smooth the road more (--smooth): the line bends too tightly for the room beside it"


def _arrived(
    road: Road, vehicle: Vehicle, objective: Objective, make_workspace: WorkspaceMaker, settings: PlannerSettings, bias: Bias
) -> Start:
    """Return the start after coming along the road's continuation, planned like the road itself.

    Raises:
        PlanError: the vehicle cannot be driven into the bend in which the road begins.

    """
    way = approach_to(road, vehicle, settings)
    along = Bias(bias.s + way.path.length, bias.offset)
    try:
        arrived = driven(ready(way, vehicle, objective, make_workspace, settings, along, stationary=True))
    except PlanError as error:
        msg = f"the road begins in a bend into which the {vehicle.name} cannot be driven"
        raise PlanError(msg, s_m=0.0, hint="let the road begin further back") from error
    return Start(arrived.z[-1], float(arrived.kappa[-1]))
