"""An independent drive of a manoeuvre: every unit as a rigid body in the plane, integrated by SciPy.

Written from the geometry of rolling alone, with none of hdvplan's kinematics. The vehicle begins at standstill, stretched along x.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from hdvplan.arrays import FloatArray
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Poses:
    """Rear axles (n, units, 2) and headings (n, units) at arclengths of the guided point."""

    axles: FloatArray
    headings: FloatArray

    def point(self, unit: int, ahead: float, left: float) -> FloatArray:
        """Return a body point at all poses, (n, 2)."""
        cos, sin = np.cos(self.headings[:, unit]), np.sin(self.headings[:, unit])
        return self.axles[:, unit] + np.column_stack([ahead * cos - left * sin, ahead * sin + left * cos])


def rolled(vehicle: Vehicle, ahead: float, left: float, radius: float, straight: float, s: FloatArray, end: float = np.inf) -> Poses:
    """Drive a point of the lead unit along a straight, a left arc of ``radius`` until arclength ``end`` and its tangent."""

    def direction(at: float) -> float:
        return float(np.clip(at - straight, 0.0, end - straight)) / radius

    def wheels(unit: int, headings: FloatArray, front: float) -> float:
        """Return the direction in which an axle rolls, off its body."""
        law = vehicle.units[unit]
        angle = front if unit == 0 else headings[unit - 1] - headings[unit]
        return -float(np.clip(law.steering_ratio * angle, -law.max_steering_angle, law.max_steering_angle))

    def lead_motion(heading: float, at: float) -> tuple[FloatArray, float, float]:
        """Return velocity of the lead's rear axle, its yaw rate and the front angle while the guided point moves at unit speed."""
        length = vehicle.lead.wheelbase

        def motion(front: float) -> tuple[FloatArray, float]:
            rear = wheels(0, np.array([heading]), front)
            yaw = (np.tan(front) - np.tan(rear)) / length  # per metre forward
            return np.array([1.0, np.tan(rear)]), yaw

        def miss(front: float) -> float:
            velocity, yaw = motion(front)
            moved = velocity + yaw * np.array([-left, ahead])
            towards = direction(at) - heading
            return float(moved[1] * np.cos(towards) - moved[0] * np.sin(towards))

        off = direction(at) - heading
        rigid = np.arctan(vehicle.lead.wheelbase * np.sin(off) / (ahead * np.cos(off) + left * np.sin(off)))
        front = float(rigid) if vehicle.lead.steering_ratio == 0.0 else brentq(miss, -1.4, 1.4, xtol=1e-14)
        velocity, yaw = motion(front)
        speed = np.hypot(*(velocity + yaw * np.array([-left, ahead])))
        cos, sin = np.cos(heading), np.sin(heading)
        turned = np.array([cos * velocity[0] - sin * velocity[1], sin * velocity[0] + cos * velocity[1]])
        return turned / speed, yaw / speed, front

    def rates(at: float, headings: FloatArray) -> FloatArray:
        velocity, yaw, front = lead_motion(float(headings[0]), at)
        out = [yaw]
        for number, unit in enumerate(vehicle.units[1:], start=1):
            hitch, heading = vehicle.units[number - 1].hitch_offset, headings[number - 1]
            coupling = velocity + yaw * hitch * np.array([np.sin(heading), -np.cos(heading)])
            rolling = headings[number] + wheels(number, headings, front)
            # the axle, a wheelbase behind the coupling, must not slide across its rolling direction
            across = np.array([-np.sin(rolling), np.cos(rolling)])
            lever = np.array([-np.sin(headings[number]), np.cos(headings[number])])
            yaw = float(coupling @ across / (unit.wheelbase * (lever @ across)))
            velocity = coupling - yaw * unit.wheelbase * lever
            out.append(yaw)
        return np.array(out)

    headings = np.empty((len(s), len(vehicle.units)))
    state = np.zeros(len(vehicle.units))
    borders = [0.0, straight, min(end, float(s[-1])), float(s[-1])]
    for begin, stop in pairwise(borders):  # one piece at a time: the curvature jumps in between
        if stop <= begin:
            continue
        found = solve_ivp(rates, (begin, stop), state, method="DOP853", rtol=1e-11, atol=1e-12, dense_output=True)
        here = (s >= begin) & (s <= stop)
        assert found.sol is not None
        headings[here] = found.sol(s[here]).T
        state = found.y[:, -1]
    return Poses(_axles(vehicle, ahead, left, _path(radius, straight, end, s), headings), headings)


def _path(radius: float, straight: float, end: float, s: FloatArray) -> FloatArray:
    angle = np.clip(s - straight, 0.0, end - straight) / radius
    x, y = np.minimum(s, straight) + radius * np.sin(angle), radius * (1.0 - np.cos(angle))
    beyond = np.maximum(s - end, 0.0)
    return np.column_stack([x + beyond * np.cos(angle), y + beyond * np.sin(angle)])


def _axles(vehicle: Vehicle, ahead: float, left: float, path: FloatArray, headings: FloatArray) -> FloatArray:
    axles = np.empty((*headings.shape, 2))
    cos, sin = np.cos(headings), np.sin(headings)
    axles[:, 0] = path - np.column_stack([ahead * cos[:, 0] - left * sin[:, 0], ahead * sin[:, 0] + left * cos[:, 0]])
    for number in range(1, headings.shape[1]):
        hitch, length = vehicle.units[number - 1].hitch_offset, vehicle.units[number].wheelbase
        for axis, part in enumerate((cos, sin)):
            axles[:, number, axis] = axles[:, number - 1, axis] - hitch * part[:, number - 1] - length * part[:, number]
    return axles
