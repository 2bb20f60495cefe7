"""Drive several legs in receding horizon: plans look across the cusps, and are executed as an exact simulation, rear first where so drawn.

A leg that was driven backwards is given as what it is when played in reverse: a drive forwards along its line, in order of s. What it
sweeps, keeps and uses is the same in both directions.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import POSE_SPACING_M, Drive, simulate
from hdvplan.driving.start import Start, kept_start, start_of
from hdvplan.errors import OptionError, PlanError
from hdvplan.planning.course import Course, Way, course_of
from hdvplan.planning.objectives import Goal, Objective
from hdvplan.planning.planner import Plan, Planner
from hdvplan.planning.settings import Discretisation, PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.balance import EnvelopeBalance
from hdvplan.planning.terms.centring import Centring, Residual
from hdvplan.qp.workspace import WorkspaceMaker
from hdvplan.road.legs import Legs
from hdvplan.vehicle.kinematics import auxiliary_ahead, place_many
from hdvplan.vehicle.model import Vehicle

HORIZON_M, TRAILER_HORIZON_M = 20.0, 30.0  # with shorter ones preset vehicles, those with trailers, fold backwards: results/legs
_HELD = 0.1  # weight of each axle's own offset where the vehicle is driven backwards, beside the objective


@dataclass
class _Driven:
    """What was driven of a leg, in the order of driving."""

    z: list[FloatArray]
    kappa: list[float] = field(default_factory=list)
    plans: list[Plan] = field(default_factory=list)
    error: float = 0.0


@dataclass(frozen=True)
class ReadyLegs:
    """A vehicle where its first leg begins, and what plans it."""

    vehicle: Vehicle
    settings: PlannerSettings
    course: Course
    begin: Start
    goal: Goal
    planner: Planner


def ready_legs(
    legs: Legs, vehicle: Vehicle, objective: Objective, make_workspace: WorkspaceMaker, settings: PlannerSettings
) -> ReadyLegs:  # fmt: skip
    """Return what a drive of several legs begins with; see ``drive_legs``."""
    settings = replace(settings, discretisation=Discretisation.GAUSS)
    course = course_of(legs.legs, vehicle, step=settings.step, stages=settings.stages)
    course = replace(course, stations=course.stations.giving_way(settings))
    goal = objective(course.stations, vehicle)
    if any(isinstance(term, EnvelopeBalance) for term in goal.terms):
        msg = "the objective that balances the swept envelope counts along one line, and cannot plan several legs"
        raise OptionError(msg, hint="choose --objective geometric")
    goal = replace(goal, terms=(*goal.terms, *_held(course.stations, vehicle)))
    planner = Planner(vehicle, course.stations, goal, settings, make_workspace)
    return ReadyLegs(vehicle, settings, course, _start(course, vehicle, settings), goal, planner)


def drive_legs(
    legs: Legs,
    vehicle: Vehicle,
    objective: Objective,
    make_workspace: WorkspaceMaker,
    settings: PlannerSettings,
    *,
    on_progress: Callable[[float], None] | None = None,
) -> tuple[Drive, ...]:
    """Plan and execute all legs; return a drive a leg, each in order of s on its own line.

    States are predicted by the implicit midpoint rule, whatever the settings say: it is exact in both directions alike, so that a
    step back undoes a step forward.

    Raises:
        OptionError: an objective that balances the swept envelope itself, which counts along one line, or too short a horizon.
        PlanError: the vehicle cannot be planned further, or the executed motion leaves the model's domain.
        SolverError: as for ``drive``.

    """
    least = TRAILER_HORIZON_M if len(vehicle.units) > 1 else HORIZON_M
    if settings.horizon < least and any(leg.backward for leg in legs.legs):
        msg = f"with a horizon of {settings.horizon:g} m the {vehicle.name} cannot be driven backwards: it would fold"
        raise OptionError(msg, hint=f"--horizon {least:g} or more")
    return driven_legs(ready_legs(legs, vehicle, objective, make_workspace, settings), on_progress)


def driven_legs(begun: ReadyLegs, on_progress: Callable[[float], None] | None = None) -> tuple[Drive, ...]:
    """Plan and execute from a start to the end of the last leg; see ``drive_legs``."""
    course, settings, vehicle = begun.course, begun.settings, begun.vehicle
    keep = int(np.ceil(settings.step / POSE_SPACING_M))
    z, kappa, at = begun.begin.z, begun.begin.kappa, 0
    done = [_Driven([z[None]] if number == 0 else []) for number in range(len(course.ways))]
    while at < course.end:
        plan = begun.planner.plan(at, np.ascontiguousarray(z), kappa)
        done[_number(course, at)].plans.append(plan)
        count = min(settings.executed, course.end - at)
        for station in range(at, at + count):
            z = _moved(course, done, vehicle, plan, station, z, keep)
        at, kappa = at + count, float(plan.kappa[count - 1])
        if on_progress is not None:
            on_progress(at / course.end)
    return tuple(_drive(way, own, vehicle, settings, begun.goal, keep) for way, own in zip(course.ways, done, strict=True))


def _held(stations: Stations, vehicle: Vehicle) -> tuple[Centring, ...]:
    """Return what holds every axle at its own balanced place where the vehicle is driven backwards.

    The objective centres a weighted sum of two axles' offsets, which is none while the vehicle folds: forwards no fold lasts,
    backwards it grows.
    """
    balanced, backwards, none = stations.centring, stations.points["step"] < 0.0, np.zeros(len(stations.s))
    if not np.any(backwards):
        return ()
    held = np.where(backwards, np.sqrt(_HELD), 0.0)
    if len(vehicle.units) == 1:
        others = {balanced.axle: balanced.e_aux}
    else:
        offsets = _offsets(stations, vehicle)
        others = {unit: stations.ahead(offsets[unit], auxiliary_ahead(vehicle, unit)) for unit in range(1, len(vehicle.units))}
    lead = Centring(Residual(held, none, held * balanced.e_y))
    return (lead, *(Centring(Residual(none, held, held * offset, unit)) for unit, offset in others.items()))


def _offsets(stations: Stations, vehicle: Vehicle) -> FloatArray:
    """Return the offsets of all units' axles on the balanced circle of each station's curvature, (units, n) [m]."""
    k, zero = stations.curvature, np.zeros(len(stations.s))
    poses = place_many(vehicle.table(), np.stack([zero, zero, zero + 1.0, zero, k]), stations.centring.states).T
    x, y = poses["x"], poses["y"]
    return np.asarray((2.0 * y - k * (x**2 + y**2)) / (1.0 + np.hypot(1.0 - k * y, k * x)))  # of a point off a circle through the origin


def _start(course: Course, vehicle: Vehicle, settings: PlannerSettings) -> Start:
    """Return how the vehicle stands at first: as in steady driving along the first leg's line, moved into the street where that helps."""
    way = course.ways[0]
    return kept_start(way.own, vehicle, start_of(course.stations, vehicle), settings.clearance - settings.give_way, way.s(way.first))


def _number(course: Course, station: int) -> int:
    """Return which leg a station belongs to: a cusp belongs to the leg that ends there, and the first station to the first leg."""
    return max(0, sum(way.first <= station for way in course.ways) - 1)


def _moved(
    course: Course, done: list[_Driven], vehicle: Vehicle, plan: Plan, station: int, z: FloatArray, keep: int
) -> FloatArray:  # fmt: skip
    """Return the state at the station after ``station``, and note what was driven on the way there.

    Raises:
        PlanError: the motion leaves the model's domain.

    """
    number, i, rigid = _number(course, station), station - plan.first, vehicle.rigid_states
    wheels = plan.z[i : i + 2, rigid:]
    if course.stations.points["step"][station] == 0.0:
        z = np.concatenate([z[:rigid], wheels[1]])
        done[_number(course, station + 1)].z[:] = [z[None]]  # the next leg begins as the wheels stand then
        return z
    way, own = course.ways[number], done[number]
    s = way.s(station)
    states = simulate(vehicle.table(), way.stations.path, s, way.step, z, plan.kappa[i : i + 1], keep, wheels)
    if not np.all(np.isfinite(states)):
        msg = f"in leg {number + 1} at s = {s:z.1f} m the executed motion leaves the road-aligned model's domain"
        raise PlanError(msg, s_m=s, hint="the line bends too tightly for the room beside it, or the trailers fold: draw it wider")
    own.z.append(states[1:])
    own.kappa.append(float(plan.kappa[i]))
    own.error = max(own.error, abs(float(states[-1, 0] - plan.z[i + 1, 0])))
    return np.asarray(states[-1])


def _drive(way: Way, own: _Driven, vehicle: Vehicle, settings: PlannerSettings, goal: Goal, keep: int) -> Drive:
    """Return what was driven of a leg in order of s."""
    order = slice(None, None, -1) if way.leg.backward else slice(None)
    poses, kappa = np.ascontiguousarray(np.concatenate(own.z)[order]), np.array(own.kappa)[order]
    plans = []
    for plan in own.plans:
        passed = min(max(plan.first - way.first, 0), way.steps)
        plans.append(replace(plan, first=way.steps - passed if way.leg.backward else passed))
    poses_s = way.stations.step / keep * np.arange(len(poses), dtype=np.float64)
    return Drive(
        way.leg.road, vehicle, settings, way.own, goal, poses[::keep], kappa, poses_s, poses, np.repeat(kappa, keep), tuple(plans),
        own.error,
    )  # fmt: skip
