"""Vehicles and states to try, plain geometry written apart from the package, and the one numerical derivative."""

from collections.abc import Callable

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.settings import Discretisation
from hdvplan.planning.stations import STATION
from hdvplan.planning.terms.term import SCENE, Motion, core_functions
from hdvplan.qp.program import StageQp, StageShape
from hdvplan.road.limits import Limits
from hdvplan.road.path import ReferencePath, from_curvature
from hdvplan.vehicle import kinematics
from hdvplan.vehicle.model import Unit, Vehicle

few = settings(derandomize=True)  # the same examples on every run, however busy the machine is


def units() -> st.SearchStrategy[Unit]:
    return st.builds(
        Unit,
        wheelbase=st.floats(2.0, 14.0),
        front_overhang=st.floats(0.0, 4.0),
        rear_overhang=st.floats(0.0, 5.0),
        width=st.floats(1.5, 3.0),
        hitch_offset=st.floats(-1.0, 2.0),
    )


def vehicles(longest: int = 4) -> st.SearchStrategy[Vehicle]:
    return st.lists(units(), min_size=1, max_size=longest).map(lambda chain: Vehicle("drawn", tuple(chain)))


def three_units() -> Vehicle:
    """Return a rigid truck with a dolly and a semitrailer of other widths: every recursion is used, nothing is equal."""
    return Vehicle(
        "three", (Unit(4.8, 1.4, 1.1, 2.55, 0.7), Unit(5.5, 0.3, 0.6, 2.4, -0.2), Unit(8.1, 1.0, 3.3, 2.6))
    )  # fmt: skip


def body_points(vehicle: Vehicle, axle: FloatArray, heading: float, beta: FloatArray, local: list[FloatArray]) -> list[FloatArray]:
    """Return points in the plane of every body, given the lead axle's position, its heading and the articulation angles.

    ``local`` holds for every body an array (points, 2) of distances ahead of and left of its axle.
    """
    found, position = [], axle
    for i, (unit, points) in enumerate(zip(vehicle.units, local, strict=True)):
        if i > 0:
            coupling = position - vehicle.units[i - 1].hitch_offset * np.array([np.cos(heading), np.sin(heading)])
            heading -= float(beta[i - 1])
            position = coupling - unit.wheelbase * np.array([np.cos(heading), np.sin(heading)])
        forward, left = np.array([np.cos(heading), np.sin(heading)]), np.array([-np.sin(heading), np.cos(heading)])
        found.append(position + points[:, :1] * forward + points[:, 1:] * left)
    return found


def on_road(vehicle: Vehicle, path: ReferencePath, s: float, z: FloatArray, local: list[FloatArray]) -> list[FloatArray]:
    """Return the same points from a road-aligned state at arclength ``s``."""
    road = path.at(s)
    psi = float(road.heading)
    axle = np.array([float(road.x) - z[0] * np.sin(psi), float(road.y) + z[0] * np.cos(psi)])
    return body_points(vehicle, axle, psi + float(z[1]), z[2:], local)


def winding() -> ReferencePath:
    """Return a road that turns left, then right, with curvature up to 0.06 1/m."""
    s = np.cumsum([0.0, 20.0, 15.0, 10.0, 25.0, 10.0, 10.0, 20.0])
    return from_curvature(s, np.array([0.0, 0.0, 0.06, 0.06, -0.05, -0.05, 0.0, 0.0]))


def varying_limits() -> Limits:
    """Return limits for it with slopes of up to 0.2 on all four lines, and with a wall that stands 0.7 m into the road."""
    s = np.array([0.0, 20.0, 27.0, 27.01, 30.0, 30.01, 45.0, 60.0, 110.0])
    left = np.array([3.0, 2.0, 3.4, 2.7, 2.9, 4.0, 3.0, 5.0, 5.0])
    return Limits(s, left, -left[::-1] - 0.3, left + np.array([0.0, 1.0, 0.5, 0.5, 0.5, 0.5, 2.0, 0.0, 1.0]), -left[::-1] - 0.9)


def arc(curvature: float, length: float) -> ReferencePath:
    """Return a circular arc."""
    return from_curvature(np.array([0.0, length]), np.array([curvature, curvature]))


def placed(vehicle: Vehicle, z: FloatArray, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> Records:
    """Return the poses of a vehicle in state ``z`` beside a point of a road; of one eastwards at its origin."""
    point = np.array([[x], [y], [np.cos(heading)], [np.sin(heading)], [0.0]])
    poses: Records = kinematics.place_many(vehicle.table(), point, z[None])[0]
    return poses


def axles(vehicle: Vehicle, poses: Records) -> FloatArray:
    """Return x, y of every unit's axle, then of the front wheels."""
    lead, ahead = poses[0], vehicle.lead.wheelbase
    front = [lead["x"] + ahead * lead["cos"], lead["y"] + ahead * lead["sin"]]
    return np.concatenate([*([pose["x"], pose["y"]] for pose in poses), front])


def rates(vehicle: Vehicle, k: float, z: FloatArray, kappa: float) -> FloatArray:
    """Return dz/ds at the road's curvature ``k``."""
    return kinematics.rates(vehicle.table(), k, z, kappa)


def linearised(vehicle: Vehicle, k: float, z: FloatArray, kappa: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return dz/ds and its derivatives by z and by kappa, from Euler's rule over a metre of a road with curvature ``k``."""
    units, n = vehicle.table(), vehicle.states
    qp, motion, road = StageQp.empty(StageShape(1, n + 1, 1 + len(vehicle.active), 0)), Motion.empty(vehicle, 1), np.zeros(2, STATION)
    motion.z[:], motion.kappa[0], road["curvature"], road["cos"], road["step"] = z, kappa, k, 1.0, 1.0
    scene, rule = np.zeros(1, SCENE), np.array([Discretisation.EULER.code])
    scene["program"], scene["unit_count"], scene["states"], scene["step"] = qp.record, len(units), n, 1.0
    for name, array in {"units": units, "road": road, "motion": motion.stages, "poses": motion.poses}.items():
        scene[name] = core.address(array)
    core_functions("dynamics").linearise(core.address(rule), core.address(scene), 1, 1)
    return qp.c[0, :n], qp.A[0, :n, :n] - np.eye(n), qp.B[0, :n, 0]


STEP = 1e-3


def differences(function: Callable[[FloatArray], FloatArray | float], at: FloatArray, step: float = STEP) -> FloatArray:
    """Return the derivative of ``function`` at ``at`` by the five-point rule; shape (values, len(at)).

    Its error is about step^4 / 30 times the fifth derivative plus 1e-16 / step times the value: near 1e-12 for smooth
    functions of size one.
    """
    columns = []
    for j in range(at.size):
        unit = np.zeros(at.size)
        unit[j] = step
        far = np.atleast_1d(function(at - 2.0 * unit)) - np.atleast_1d(function(at + 2.0 * unit))
        close = np.atleast_1d(function(at + unit)) - np.atleast_1d(function(at - unit))
        columns.append((far + 8.0 * close) / (12.0 * step))
    return np.stack(columns, axis=-1)
