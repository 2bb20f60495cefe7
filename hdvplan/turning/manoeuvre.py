"""A prescribed manoeuvre: which point of the lead unit follows which line, arc and line.

The path of the guided point is a chain of pieces whose curvature is linear in its arclength: line, ramp, arc, ramp, line. It
begins at the origin; the vehicle stands stretched along x there. All turns are to the left; vehicles are symmetric, so a turn to
the right is the mirror image.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, TurnError
from hdvplan.vehicle.model import Vehicle

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(20)  # a piece that turns by less than a radian, to rounding
_PART_RAD = 1.0


class GuidePoint(StrEnum):
    """The point of the lead unit that follows the path."""

    FRONT_AXLE = "front-axle"  # middle of the front axle
    OUTER_FRONT_WHEEL = "outer-front-wheel"  # outside of it, level with the body's side
    FRONT_CORNER = "front-corner"  # outer corner of the body's front
    KINGPIN = "kingpin"  # coupling of the first trailer, which must lie ahead of the rear axle

    @property
    def words(self) -> str:
        """What readers call it."""
        return self.replace("-", " ")


@dataclass(frozen=True)
class Manoeuvre:
    """A turn to the left that a point of the vehicle drives exactly. Lengths in metres along that point's path.

    Raises:
        OptionError: a value outside its range, or ramps that alone turn by more than the angle.

    """

    radius: float  # of the arc [m]
    angle: float | None  # between entry and exit [rad]; None: in the circle until nothing changes any more, without exit
    point: GuidePoint = GuidePoint.FRONT_AXLE
    ramp: float = 0.0  # over which the path's curvature grows to 1 / radius, and falls again [m]
    lead_in: float = 5.0  # straight before [m]
    lead_out: float | None = None  # straight after [m]; None: twice the vehicle's length
    standstill: bool = False  # the wheels are turned before the vehicle moves: the lead unit is in its circle at once

    def __post_init__(self) -> None:
        """Refuse what is no turn."""
        angle = 0.0 if self.angle is None else self.angle
        lengths = {"radius": self.radius, "ramp": self.ramp, "lead_in": self.lead_in, "lead_out": self.lead_out or 0.0, "angle": angle}
        for name, value in lengths.items():
            if not (np.isfinite(value) and value >= 0.0):
                shown = f"{np.rad2deg(value):g} degrees" if name == "angle" else f"{value:g}"
                msg = f"{name} = {shown} must be a positive number"
                raise OptionError(msg)
        if self.radius == 0.0 or self.angle == 0.0:
            msg = "a turn needs a radius and an angle above 0"
            raise OptionError(msg)
        if self.angle is not None and self.angle * self.radius < self.ramp:
            most = np.floor(100.0 * self.angle * self.radius) / 100.0  # what can be given, to a centimetre
            msg = f"ramps of {self.ramp:g} m turn by more than the angle; at this radius they may be {most:.2f} m long"
            raise OptionError(msg)
        if self.standstill and self.ramp > 0.0:
            msg = "a ramp contradicts steering at standstill"
            raise OptionError(msg, hint="leave ramp out, or standstill")

    def lead_out_of(self, vehicle: Vehicle) -> float:
        """Return the length of the straight after the turn, long enough for trailers to come in line [m]."""
        return 2.0 * (vehicle.reach_ahead + vehicle.reach_behind) if self.lead_out is None else self.lead_out


def guide_offsets(point: GuidePoint, vehicle: Vehicle) -> tuple[float, float]:
    """Return how far ahead of the lead rear axle and left of the lead unit's axis the guided point lies [m].

    Raises:
        TurnError: the point does not lead the vehicle: it is not there, or not ahead of the rear axle.

    """
    lead = vehicle.lead
    if point is GuidePoint.FRONT_AXLE:
        return lead.wheelbase, 0.0
    if point is GuidePoint.OUTER_FRONT_WHEEL:
        return lead.wheelbase, -0.5 * lead.width
    if point is GuidePoint.FRONT_CORNER:
        return lead.front, -0.5 * lead.width
    if len(vehicle.units) == 1 or lead.hitch_offset >= 0.0:
        msg = f"the {vehicle.name} cannot be guided by its kingpin: it has none ahead of the rear axle"
        raise TurnError(msg, hint="guide another point: front-axle, outer-front-wheel or front-corner")
    return -lead.hitch_offset, 0.0


@dataclass(frozen=True)
class GuidePath:
    """The path of the guided point, from the origin: ``pieces`` (n, 3) of length [m] and curvature at begin and end [1/m]."""

    pieces: FloatArray
    heading: float  # at the begin [rad]

    @property
    def starts(self) -> FloatArray:
        """Arclengths at which the pieces begin, and the end, shape (n + 1,) [m]."""
        return np.concatenate([[0.0], np.cumsum(self.pieces[:, 0])])

    def at(self, s: FloatArray) -> FloatArray:
        """Return x, y [m], heading [rad] and curvature [1/m] at rising arclengths ``s`` [m], shape (len(s), 4); exact to rounding."""
        out = np.empty((len(s), 4))
        x, y, heading = 0.0, 0.0, self.heading
        piece = np.clip(np.searchsorted(self.starts, s, side="right") - 1, 0, len(self.pieces) - 1)
        for number, (length, begin, end) in enumerate(self.pieces):
            here = piece == number
            u = np.append(s[here] - self.starts[number], length)
            slope = (end - begin) / length
            if slope == 0.0:
                chord, towards = u * np.sinc(0.5 * begin * u / np.pi), heading + 0.5 * begin * u
                px, py = x + chord * np.cos(towards), y + chord * np.sin(towards)
            else:
                parts = max(1, int(np.ceil(np.abs(0.5 * (begin + end)) * length / _PART_RAD)))
                along = u[:, None] * ((np.arange(parts)[:, None] + 0.5 * (1.0 + _NODES)).ravel() / parts)
                turned, weights = heading + begin * along + 0.5 * slope * along**2, np.tile(0.5 * _WEIGHTS / parts, parts)
                px, py = x + u * (np.cos(turned) @ weights), y + u * (np.sin(turned) @ weights)
            angle = heading + begin * u + 0.5 * slope * u**2
            out[here] = np.column_stack([px, py, angle, begin + slope * u])[:-1]
            x, y, heading = px[-1], py[-1], angle[-1]
        return out


def guide_path(manoeuvre: Manoeuvre, angle: float, lead_out: float, heading: float) -> GuidePath:
    """Return the path of a turn by ``angle`` [rad]: line, ramp, arc, ramp, line of ``lead_out`` [m]; pieces without length are left out."""
    k, ramp = 1.0 / manoeuvre.radius, manoeuvre.ramp
    lead_in = 0.0 if manoeuvre.standstill else manoeuvre.lead_in
    ramps_out = ramp if manoeuvre.angle is not None else 0.0
    arc = angle * manoeuvre.radius - 0.5 * (ramp + ramps_out)
    pieces = np.array([[lead_in, 0.0, 0.0], [ramp, 0.0, k], [arc, k, k], [ramps_out, k, 0.0], [lead_out, 0.0, 0.0]])
    return GuidePath(pieces[pieces[:, 0] > 0.0], heading)
