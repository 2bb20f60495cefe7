"""Drive a manoeuvre exactly: the guided point stays on its path, and the kinematics that judge plans turn all bodies.

The guided point's velocity fixes how the lead unit turns: its direction off the body decides the front wheels' angle. Everything
else comes from ``vehicle.kinematics``: with the lead rear axle on a straight road, in line with it, ``derivative`` is the motion per
metre that the lead body moves forward. It is integrated over the guided point's arclength by the classical Runge-Kutta method,
piece by piece.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.errors import OptionError, TurnError
from hdvplan.turning.manoeuvre import GuidePath, Manoeuvre, guide_offsets, guide_path
from hdvplan.vehicle.kinematics import place_many, points_on, rates
from hdvplan.vehicle.model import Vehicle

POSE_M = 0.05  # between the poses that figures are measured on
SUBSTEP_M = 0.0125  # of the integration: angles are then exact to 1e-10 rad (tested against the closed form)
_SETTLED_RAD = 1e-10  # off its last angles a circle is steady
_MOST_TURNS = 64.0  # before a circle that does not settle is given up
_LARGEST_M = 300.0  # radius up to which one that can be followed is searched
_LONGEST_M = 5000.0  # path that is driven; more takes minutes and shows nothing
_FOUND_M = 1e-3  # to which the least radius is found
_SEARCH_M = 0.1  # between poses, and of the integration, while it is searched
_SLACK = 1.0 + 1e-9  # on the largest curvature: rounding

_follow = core.function(
    "hdv_follow", core.POINTER, core.INT, core.REAL, core.REAL, core.INT, core.POINTER, core.POINTER, core.INT, core.REAL, core.REAL,
    core.POINTER, core.POINTER,
)  # fmt: skip


@dataclass(frozen=True)
class Followed:
    """A driven manoeuvre; arrays over the poses, (n, ...), in the plane of the manoeuvre [m, rad]."""

    vehicle: Vehicle
    manoeuvre: Manoeuvre
    path: GuidePath
    angle: float  # turned in all [rad]
    s: FloatArray  # of the guided point [m]
    guide: FloatArray  # its x, y, heading, curvature of its path (n, 4)
    kappa: FloatArray  # tan(front angle) / wheelbase (n,) [1/m]
    beta: FloatArray  # articulation angles (n, couplings)
    poses: Records  # of every unit (n, units)
    headings: FloatArray  # of every unit (n, units), continuous

    @property
    def steering(self) -> FloatArray:
        """Angle of the front wheels (n,) [rad]."""
        return np.asarray(np.arctan(self.vehicle.lead.wheelbase * self.kappa))

    def points(self, unit: int, ahead: FloatArray, left: FloatArray) -> FloatArray:
        """Return body points of ``unit``, ``ahead`` of its axle and ``left`` of its axis [m], at all poses: (n, len(ahead), 2)."""
        return points_on(self.poses[:, unit, None], ahead, left)


def follow(vehicle: Vehicle, manoeuvre: Manoeuvre, *, spacing: float = POSE_M) -> Followed:
    """Return ``vehicle`` driven through ``manoeuvre`` with a pose every ``spacing`` of the guided point's path [m].

    Axles that plans steer follow their law here. How fast the front wheels turn is not limited.

    Raises:
        TurnError: the front wheels cannot turn far enough, or a trailer would be pushed backwards; it names the least radius that can
            be followed.
        OptionError: the path is longer than 5 km.

    """
    length = manoeuvre.lead_in + manoeuvre.radius * (manoeuvre.angle or 4.0 * np.pi) + manoeuvre.lead_out_of(vehicle)
    if length > _LONGEST_M:
        msg = f"the path would be {1e-3 * length:.1f} km long; at most {1e-3 * _LONGEST_M:g} km are driven"
        raise OptionError(msg)
    driven = _driven(vehicle, manoeuvre, spacing, SUBSTEP_M)
    if isinstance(driven, Followed):
        return driven
    least = _least_radius(vehicle, manoeuvre)
    turn = "a full circle" if manoeuvre.angle is None else f"{np.rad2deg(manoeuvre.angle):g} degrees"
    more = (
        f"no radius up to {_LARGEST_M:.0f} m is possible"
        if least is None
        else f"least radius {least:.2f} m, {least - manoeuvre.radius:.2f} m more"
    )
    msg = f"the {vehicle.name} cannot drive {turn} with its {manoeuvre.point} on a radius of {manoeuvre.radius:.2f} m: {driven}; {more}"
    hint = None if least is None else f"it can drive: {_options(replace(manoeuvre, radius=least))}"
    raise TurnError(msg, radius_m=manoeuvre.radius, least_radius_m=least, hint=hint)


def _options(manoeuvre: Manoeuvre) -> str:
    """Return the options of ``hdvplan turn`` that describe ``manoeuvre``."""
    angle = "steady" if manoeuvre.angle is None else f"{np.rad2deg(manoeuvre.angle):g}"
    ramp = f" --ramp {manoeuvre.ramp:g}" if manoeuvre.ramp > 0.0 else ""
    standstill = " --standstill" if manoeuvre.standstill else ""
    return f"--radius {manoeuvre.radius:.2f} --angle {angle} --guide {manoeuvre.point}{ramp}{standstill}"


def tightest(vehicle: Vehicle, manoeuvre_point: tuple[float, float]) -> float:
    """Return the radius on which a lead unit's point, (ahead, left) [m], runs with its front wheels at their stop [m]."""
    return _radius(passive(vehicle).table(), manoeuvre_point, vehicle.max_curvature)


def passive(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with the axles that plans steer steered by their law."""
    return replace(vehicle, units=tuple(replace(unit, max_steering_rate=0.0) for unit in vehicle.units))


def _driven(vehicle: Vehicle, manoeuvre: Manoeuvre, spacing: float, substep: float) -> Followed | str:
    """Return the drive, or why there is none."""
    point = guide_offsets(manoeuvre.point, vehicle)
    if manoeuvre.angle is not None:
        return _once(vehicle, manoeuvre, point, manoeuvre.angle, manoeuvre.lead_out_of(vehicle), spacing, substep)
    turns = 1.0
    while turns <= _MOST_TURNS:
        driven = _once(vehicle, manoeuvre, point, 2.0 * np.pi * turns, 0.0, spacing, substep)
        if isinstance(driven, str):
            return driven
        settled = _settled_angle(driven)
        if settled < driven.angle - 0.5 * np.pi:
            return _once(vehicle, manoeuvre, point, settled + 2.0 * np.pi, 0.0, spacing, substep)
        turns *= 2.0
    return f"its trailers do not settle within {_MOST_TURNS:.0f} rounds"


def _settled_angle(driven: Followed) -> float:
    """Return by what angle the guided path has turned once nothing changes any more [rad]."""
    angles = np.column_stack([driven.guide[:, 2] - driven.headings[:, 0], driven.beta])
    changing = np.flatnonzero(np.abs(angles - angles[-1]).max(axis=1) > _SETTLED_RAD)
    return float(driven.guide[changing[-1] if len(changing) else 0, 2] - driven.path.heading)


def _once(
    vehicle: Vehicle, manoeuvre: Manoeuvre, point: tuple[float, float], angle: float, lead_out: float, spacing: float, substep: float
) -> Followed | str:
    """Return the drive through a turn by ``angle`` [rad], or why there is none."""
    units = passive(vehicle).table()
    begin = 0.0
    if manoeuvre.standstill:
        kappa = _steady_kappa(units, point, manoeuvre.radius, vehicle.max_curvature)
        if kappa is None:
            return _stop(vehicle)
        begin = _direction(units, point, kappa)
    path = guide_path(manoeuvre, angle, lead_out, begin)
    counts = np.ceil(path.pieces[:, 0] / spacing - 1e-9).astype(np.int64)
    substeps = int(np.ceil(spacing / substep - 1e-9))
    states, kappas = integrate(units, point, path.pieces, counts, substeps, begin, vehicle.max_curvature * _SLACK)
    if not np.isfinite(states[-1, 0]):
        return _stop(vehicle)
    s = np.concatenate([[0.0], *(a + b * np.arange(1, n + 1) / n for a, b, n in zip(path.starts, path.pieces[:, 0], counts, strict=False))])
    guide = path.at(s)
    poses = place_many(units, _lead_axle(point, guide, states[:, 0]), np.column_stack([np.zeros((len(s), 2)), states[:, 1:]]))
    headings = states[:, :1] - np.concatenate([np.zeros((len(s), 1)), np.cumsum(states[:, 1:], axis=1)], axis=1)
    driven = Followed(vehicle, manoeuvre, path, angle, s, guide, kappas, states[:, 1:], poses, headings)
    middle = 0.5 * (headings[1:] + headings[:-1])
    forward = np.diff(poses["x"], axis=0) * np.cos(middle) + np.diff(poses["y"], axis=0) * np.sin(middle)
    backward = np.flatnonzero(forward.min(axis=0) < 0.0)
    if len(backward):
        unit = vehicle.units[backward[0]].name or f"unit {backward[0] + 1}"
        return f"the {unit} would be pushed backwards"
    return driven


def _stop(vehicle: Vehicle) -> str:
    lead = vehicle.lead
    return f"its front wheels turn to {np.rad2deg(np.arctan(lead.wheelbase * vehicle.max_curvature)):.1f} degrees at most"


def _least_radius(vehicle: Vehicle, manoeuvre: Manoeuvre) -> float | None:
    """Return the least radius that can be followed, rounded up to a centimetre [m]; None if none is found."""
    low = high = manoeuvre.radius
    while isinstance(_driven(vehicle, replace(manoeuvre, radius=high), _SEARCH_M, _SEARCH_M), str):
        low, high = high, 1.5 * high
        if high > _LARGEST_M:
            return None
    while high - low > _FOUND_M:
        middle = 0.5 * (low + high)
        if isinstance(_driven(vehicle, replace(manoeuvre, radius=middle), _SEARCH_M, _SEARCH_M), str):
            low = middle
        else:
            high = middle
    return float(np.ceil(100.0 * high) / 100.0)


def motion(units: Records, kappa: float) -> tuple[float, float]:
    """Return how far the lead unit's axle moves sideways and the unit turns per metre forward [-, rad/m]."""
    sideways, turn = rates(units, 0.0, np.zeros(1 + len(units)), kappa)[:2]
    return float(sideways), float(turn)


def _radius(units: Records, point: tuple[float, float], kappa: float) -> float:
    """Return the radius of a point's circle at constant ``kappa`` [1/m]."""
    sideways, turn = motion(units, kappa)
    return float(np.hypot(1.0 - point[1] * turn, sideways + point[0] * turn) / turn)


def _direction(units: Records, point: tuple[float, float], kappa: float) -> float:
    """Return the direction in which a point moves, off the lead body [rad]."""
    sideways, turn = motion(units, kappa)
    return float(np.arctan2(sideways + point[0] * turn, 1.0 - point[1] * turn))


def _steady_kappa(units: Records, point: tuple[float, float], radius: float, most: float) -> float | None:
    """Return the ``kappa`` at which a point runs on ``radius``, or None where the wheels do not turn that far."""
    if _radius(units, point, most * _SLACK) > radius:
        return None
    return float(brentq(lambda kappa: _radius(units, point, kappa) - radius, 1e-9, most * _SLACK, xtol=1e-16))


def integrate(
    units: Records,
    point: tuple[float, float],
    pieces: FloatArray,
    counts: IntArray,
    substeps: int,
    heading: float,
    most: float,
    begin: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Return the lead unit's heading and the articulation angles at every pose (n, units) [rad], and kappa (n,) [1/m].

    The lead unit's ``point`` runs along ``pieces`` (length, curvature at begin and end) from ``heading`` [rad]. ``begin`` (units,) is the
    first row; without it the vehicle stands stretched along x. NaN from where ``kappa`` passes ``most``: the wheels are at their stop.
    """
    poses = 1 + int(counts.sum())
    states, kappas = np.full((poses, len(units)), np.nan), np.full(poses, np.nan)
    states[0] = 0.0 if begin is None else begin
    _follow(
        core.address(units), len(units), *point, len(pieces), core.address(pieces), core.address(counts), substeps, heading, most,
        core.address(states), core.address(kappas),
    )  # fmt: skip
    return states, kappas


def _lead_axle(point: tuple[float, float], guide: FloatArray, heading: FloatArray) -> FloatArray:
    """Return x, y, cos, sin of the lead unit's axle from the guided point's places, as points of a road along it; shape (5, n)."""
    (ahead, left), cos, sin = point, np.cos(heading), np.sin(heading)
    return np.stack([guide[:, 0] - ahead * cos + left * sin, guide[:, 1] - ahead * sin - left * cos, cos, sin, np.zeros(len(heading))])
