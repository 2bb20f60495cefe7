"""The motion of a chain, a path, simulation, manoeuvres: see ``kinematics.h``, ``path.h``, ``simulate.c``, ``follow.c`` of ``core``."""

from typing import Any, TypeAlias

import numpy as np
from scipy.optimize import brentq

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.road.path import LAST_STEP_M, ReferencePath


def wheels(unit: np.void, angle: float) -> float:
    """Return tan(delta) of a unit's axle that is steered by ``angle``."""
    return float(-np.tan(np.clip(unit["steering_ratio"] * angle, -unit["max_steering_angle"], unit["max_steering_angle"])))


def rear_wheels(units: Records, kappa: float) -> float:
    """Return tan(delta) of the lead rear axle."""
    return wheels(units[0], float(np.arctan(units[0]["wheelbase"] * kappa)))


def rates(units: Records, k: float, z: FloatArray, kappa: float) -> FloatArray:
    """Return dz/ds, [GEO] eqs. 2 and 6 for any chain."""
    rear = rear_wheels(units, kappa)
    travelled = (1.0 - z[0] * k) / (np.cos(z[1]) - np.sin(z[1]) * rear)
    velocity, turn = np.array([1.0, rear]), kappa - rear / units[0]["wheelbase"]
    f = np.zeros(len(z))
    f[:2] = travelled * (np.sin(z[1]) + np.cos(z[1]) * rear), travelled * turn - k
    for i in range(1, len(units)):
        cos, sin = np.cos(z[1 + i]), np.sin(z[1 + i])
        coupling = np.array([[cos, -sin], [sin, cos]]) @ (velocity - [0.0, units[i - 1]["hitch_offset"] * turn])
        velocity = coupling[0] * np.array([1.0, wheels(units[i], z[units[i]["steered_by"]])])
        behind = (coupling[1] - velocity[1]) / units[i]["wheelbase"]
        f[1 + i], turn = travelled * (turn - behind), behind
    return f


def places(units: Records, point: FloatArray, z: FloatArray) -> FloatArray:
    """Return x, y of the axle, cosine and sine of the heading of every unit, shape (units, 4); ``point`` is the road's x, y, cos, sin."""
    heading = np.arctan2(point[3], point[2])
    axle, found = point[:2] + z[0] * np.array([-np.sin(heading), np.cos(heading)]), []
    heading += z[1]
    for i, unit in enumerate(units):
        if i > 0:
            axle = axle - units[i - 1]["hitch_offset"] * np.array([np.cos(heading), np.sin(heading)])
            heading -= z[1 + i]
            axle = axle - unit["wheelbase"] * np.array([np.cos(heading), np.sin(heading)])
        found.append([*axle, np.cos(heading), np.sin(heading)])
    return np.array(found)


def couplings(units: Records, axles: FloatArray) -> FloatArray:
    """Return x, y of every unit's coupling to the unit ahead, of the lead unit its axle; ``axles`` as ``places`` returns them."""
    ahead = np.where(np.arange(len(units)) > 0, units["wheelbase"], 0.0)
    found: FloatArray = axles[:, :2] + ahead[:, None] * axles[:, 2:]
    return found


def body_point(axle: FloatArray, ahead: float, left: float) -> FloatArray:
    """Return x, y of the point of a body so far ahead of its axle and left of its axis."""
    cos, sin = axle[2:]
    return np.array([axle[0] + ahead * cos - left * sin, axle[1] + ahead * sin + left * cos])


def gradient(units: Records, axles: FloatArray, unit: int, at: FloatArray, normal: FloatArray, along: FloatArray, n: int) -> FloatArray:
    """Return the derivative by z (n,) of the motion of a point of ``unit`` along a direction; ``normal`` is the road's at the lead axle."""
    found, about = np.zeros(n), couplings(units, axles)[: unit + 1]
    turned = (at - about)[:, ::-1] * [-1.0, 1.0] @ along
    found[0], found[1], found[2 : 2 + unit] = normal @ along, turned[0], -turned[1:]
    return found


def simulate(
    units: Records, path: ReferencePath, s_start: float, step: float, z_start: FloatArray, kappa: FloatArray, keep: int, substeps: int,
    steering: FloatArray,
) -> FloatArray:  # fmt: skip
    """Return the states while driving, shape (len(kappa) * keep + 1, n); NaN from where the model leaves its domain."""
    z, rigid, h = z_start.copy(), 1 + len(units), step / (keep * substeps)
    out = np.full((len(kappa) * keep + 1, len(z)), np.nan)
    out[0] = z
    for i, held in enumerate(kappa):
        off, turn = np.arctan(rear_wheels(units, held)), (steering[i + 1] - steering[i]) / step

        def slope(k: float, at: FloatArray, held: float = held, turn: FloatArray = turn) -> FloatArray:
            return np.concatenate([rates(units, k, at, held)[:rigid], turn])

        for part in range(keep * substeps):
            first, middle, last = (evaluate(path, s_start + i * step + (part + ahead) * h)[4] for ahead in (0.0, 0.5, 1.0))
            f_1 = slope(first, z)
            f_2 = slope(middle, z + 0.5 * h * f_1)
            f_3 = slope(middle, z + 0.5 * h * f_2)
            f_4 = slope(last, z + h * f_3)
            z = z + h / 6.0 * (f_1 + 2.0 * f_2 + 2.0 * f_3 + f_4)
            if not (1.0 - z[0] * last > 0.0 and abs(z[1] + off) < 0.5 * np.pi):
                return out
            if (part + 1) % substeps == 0:
                out[i * keep + (part + 1) // substeps] = z
        z[rigid:] = out[(i + 1) * keep, rigid:] = steering[i + 1]
    return out


PLANNING_STEP_M = 1e-3  # as path.h
Record: TypeAlias = Any  # one element of a structured array: NumPy's types know no columns


def evaluate(path: ReferencePath, s: float) -> FloatArray:
    """Return x, y, cos(psi), sin(psi), curvature at arclength ``s``, with the true length of the tangent."""
    index = int(np.clip((s - path.s_first) / path.spacing, 0, len(path.coefficients) - 1))
    u = s - path.s_first - index * path.spacing
    rows, order = path.coefficients[index].reshape(2, 6), np.arange(6)
    x, y = rows @ u**order
    dx, dy = rows[:, 1:] @ (order[1:] * u ** order[:-1])
    ddx, ddy = rows[:, 2:] @ (order[2:] * order[1:-1] * u ** order[:-2])
    length = np.hypot(dx, dy)
    return np.array([x, y, dx / length, dy / length, (dx * ddy - dy * ddx) / length**3])


def project(path: ReferencePath, x: float, y: float, near: float, last_step: float = LAST_STEP_M) -> FloatArray:
    """Return s, offset, cos(psi), sin(psi), curvature at the foot of a point; the offset is NaN without one within 15 m."""
    s = near
    for _ in range(30):
        px, py, cos, sin, curvature = evaluate(path, s)
        ahead, offset = (x - px) * cos + (y - py) * sin, (y - py) * cos - (x - px) * sin
        slope = 1.0 - curvature * offset
        step = np.clip(ahead / (slope if slope >= 0.05 else 1.0), -5.0, 5.0)
        s += step
        if abs(s - near) > 15.0 or not path.s_first - 1e-9 <= s <= path.s_last + 1e-9:
            break
        if abs(step) < last_step:
            if slope <= 0.0:
                break
            turn = curvature * step
            return np.array([s, offset - 0.5 * ahead * turn, cos - sin * turn, sin + cos * turn, curvature])
    return np.array([s, np.nan, 1.0, 0.0, 0.0])


def rates_along(units: Records, point: tuple[float, float], heading: float, y: FloatArray) -> tuple[FloatArray, float]:
    """Return dy/ds of the lead heading and the articulations, and the kappa that moves the lead unit's ``point`` along ``heading``."""
    ahead, left = point
    z = np.concatenate([[0.0, 0.0], y[1:]])

    def velocity(kappa: float) -> tuple[float, float]:
        sideways, turn = rates(units, 0.0, z, kappa)[:2]
        return 1.0 - left * turn, sideways + ahead * turn

    def miss(kappa: float) -> float:
        along, across = velocity(kappa)
        return float(across * np.cos(heading - y[0]) - along * np.sin(heading - y[0]))

    kappa = float(brentq(miss, -1.0, 1.0, xtol=1e-16))
    return rates(units, 0.0, z, kappa)[1:] / np.hypot(*velocity(kappa)), kappa


def follow(
    units: Records, point: tuple[float, float], pieces: FloatArray, counts: IntArray, substeps: int, heading: float, most: float
) -> tuple[FloatArray, FloatArray]:
    """Return lead heading and articulations at every pose, and kappa; NaN from where ``kappa`` passes ``most``."""
    y = np.zeros(len(units))
    states, kappas = np.full((1 + counts.sum(), len(y)), np.nan), np.full(1 + counts.sum(), np.nan)
    states[0], kappas[0], row = y, rates_along(units, point, heading, y)[1], 0
    for (length, begin, end), count in zip(pieces, counts, strict=True):
        h = length / (count * substeps)
        for step in range(count * substeps):
            directions = [heading + begin * u + 0.5 * (end - begin) / length * u * u for u in h * (step + np.array([0.0, 0.5, 1.0]))]
            f_1, first = rates_along(units, point, directions[0], y)
            f_2, second = rates_along(units, point, directions[1], y + 0.5 * h * f_1)
            f_3, third = rates_along(units, point, directions[1], y + 0.5 * h * f_2)
            f_4, fourth = rates_along(units, point, directions[2], y + h * f_3)
            if max(map(abs, (first, second, third, fourth))) > most:
                return states, kappas
            y = y + h / 6.0 * (f_1 + 2.0 * f_2 + 2.0 * f_3 + f_4)
            if (step + 1) % substeps == 0:
                row += 1
                states[row], kappas[row] = y, rates_along(units, point, directions[2], y)[1]
        heading += 0.5 * (begin + end) * length
    return states, kappas
