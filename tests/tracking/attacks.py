"""A driver who errs, integrated by NumPy and SciPy alone: nothing of hdvplan but the vehicle's dimensions is used.

The midpoint of the front axle is led along its planned track with an error to the side; every unit behind follows its coupling without
slip. Headings are the only states.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from hdvplan.arrays import FloatArray
from hdvplan.vehicle.model import Vehicle

STEP_M = 0.1  # of the Runge-Kutta method: with 0.2 m the steps of a plan's steering cost a tractor 3 mrad, and positions 2 mm


@dataclass(frozen=True)
class Motion:
    """Where units were at ``front`` (n,) metres of the planned front axle's track: axles (n, attacks, units, 2), headings [rad]."""

    front: FloatArray
    axles: FloatArray
    headings: FloatArray


class Driver:
    """A planned track of the front axle's midpoint, points (n, 2), and the headings of all units at its begin (units,)."""

    def __init__(self, vehicle: Vehicle, points: FloatArray, headings: FloatArray) -> None:
        way = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
        self.vehicle, self.track, self.headings = vehicle, CubicSpline(way, points), headings
        self.front = np.arange(0.0, way[-1] - STEP_M, STEP_M)

    def driven(self, errors: FloatArray) -> Motion:
        """Return the motion with errors (attacks, n) at the half steps of ``front``, even between them [m]."""
        headings = np.tile(self.headings, (len(errors), 1))
        kept, fronts = [headings], []
        for number, at in enumerate(self.front[:-1]):
            before, middle, after = (errors[:, 2 * number + part] for part in range(3))
            begin, half, end = at, at + 0.5 * STEP_M, at + STEP_M
            first, second = 2.0 / STEP_M * (middle - before), 2.0 / STEP_M * (after - middle)
            fronts.append(self._led(begin, before, first)[0])
            a = self._turning(headings, self._led(begin, before, first)[1])
            b = self._turning(headings + 0.5 * STEP_M * a, self._led(half, middle, first)[1])
            c = self._turning(headings + 0.5 * STEP_M * b, self._led(half, middle, second)[1])
            d = self._turning(headings + STEP_M * c, self._led(end, after, second)[1])
            headings = headings + STEP_M / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            kept.append(headings)
        fronts.append(self._led(end, after, second)[0])
        return Motion(self.front, self._axles(np.stack(fronts), np.stack(kept)), np.stack(kept))

    def _led(self, at: float, error: FloatArray, slope: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the front axle's midpoints and their motion a metre of the planned track."""
        point, way, bend = (self.track(at, order) for order in range(3))
        speed = np.hypot(*way)
        tangent, curvature = way / speed, (way[0] * bend[1] - way[1] * bend[0]) / speed**3
        normal = np.array([-tangent[1], tangent[0]])
        return point + error[:, None] * normal, (1.0 - curvature * error)[:, None] * tangent + slope[:, None] * normal

    def _turning(self, headings: FloatArray, moving: FloatArray) -> FloatArray:
        found = np.empty_like(headings)
        for number, unit in enumerate(self.vehicle.units):
            cosine, sine = np.cos(headings[:, number]), np.sin(headings[:, number])
            along, across = moving[:, 0] * cosine + moving[:, 1] * sine, moving[:, 1] * cosine - moving[:, 0] * sine
            turned = np.arctan2(across, along) if number == 0 else headings[:, number - 1] - headings[:, number]
            wheels = -np.clip(unit.steering_ratio * turned, -unit.max_steering_angle, unit.max_steering_angle)
            rolled = along * np.tan(wheels)
            found[:, number] = (across - rolled) / unit.wheelbase
            behind = rolled - unit.hitch_offset * found[:, number]
            moving = np.stack([along * cosine - behind * sine, along * sine + behind * cosine], axis=1)
        return found

    def _axles(self, coupling: FloatArray, headings: FloatArray) -> FloatArray:
        axles = []
        for number, unit in enumerate(self.vehicle.units):
            along = np.stack([np.cos(headings[..., number]), np.sin(headings[..., number])], axis=-1)
            axles.append(coupling - unit.wheelbase * along)
            coupling = axles[-1] - unit.hitch_offset * along
        return np.stack(axles, axis=2)


def strayed(planned: Motion, driven: Motion, unit: int, at: float) -> tuple[FloatArray, FloatArray]:
    """Return axle positions (attacks, 2) and headings (attacks,) of a unit less the planned ones, with its axle beside where ``at`` is."""
    place = CubicSpline(planned.front, planned.axles[:, 0, unit])
    here, along = place(at), place(at, 1)
    first = max(int(np.searchsorted(driven.front, at)) - int(4.0 / STEP_M), 0)
    near = slice(first, first + int(8.0 / STEP_M))
    axle, heading = (
        CubicSpline(driven.front[near], driven.axles[near, :, unit]),
        CubicSpline(driven.front[near], driven.headings[near, :, unit]),
    )
    attacks = np.arange(driven.axles.shape[1])
    when = np.full(len(attacks), at)
    for _ in range(6):  # Newton's method, until the axle is beside the place
        ahead = (axle(when)[attacks, attacks] - here) @ along
        when = when - ahead / (axle(when, 1)[attacks, attacks] @ along)
    planned_heading = CubicSpline(planned.front, planned.headings[:, 0, unit])(at)
    return axle(when)[attacks, attacks] - here, heading(when)[attacks, attacks] - planned_heading
