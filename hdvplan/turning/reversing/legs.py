"""Legs of constant steering, forwards and backwards, driven exactly.

The front wheels turn while the vehicle stands; in between the lead unit's points move on circles or straights, which is exact in closed
form. A backward leg is the forward drive from its end to its begin, played in reverse: forwards trailers follow stably, and the motion
without slip is the same in both directions. Their angles are integrated by ``follow``, whose guided point is the middle of the front axle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.road.legs import direction_of
from hdvplan.turning.follow import integrate, motion
from hdvplan.vehicle.kinematics import place_many
from hdvplan.vehicle.model import Vehicle

_SUBSTEP_M = 0.1  # of the integration: with a trailer of 3 m, angles are exact to 1e-8 rad
_NO_PIECE_M = 1e-9
_SLACK = 1.0 + 1e-6  # on the curvature of a piece, which the integration finds again


@dataclass(frozen=True)
class Wheels:
    """How a vehicle's lead unit moves with its front wheels at a stop, to the left; to the right it is the mirror image.

    ``slide`` is how far its rear axle moves sideways [-] and ``turn`` how far it turns [rad/m], each per metre forward. ``slide`` is 0
    unless that axle is steered.
    """

    kappa: float
    slide: float
    turn: float


def wheels_at_stop(vehicle: Vehicle) -> Wheels:
    """Return the motion with the front wheels at their stop; axles that plans steer follow their law in ``vehicle``."""
    slide, turn = motion(vehicle.table(), vehicle.max_curvature)
    return Wheels(vehicle.max_curvature, slide, turn)


@dataclass(frozen=True)
class Strokes:
    """Candidates for a drive of the lead unit: (candidates, pieces) of angles turned [rad] and, of straight pieces, lengths driven [m].

    ``start`` (candidates, 3) is the rear axle's place and the heading, x, y [m], [rad]. Along backward pieces the vehicle rolls backwards;
    ``straight`` tells which pieces are.
    """

    start: FloatArray
    amounts: FloatArray
    straight: tuple[bool, ...]
    backward: tuple[bool, ...]

    def lengths(self, wheels: Wheels) -> FloatArray:
        """Return the length of every piece, negative backwards, (candidates, pieces) [m]."""
        driven = np.where(self.straight, self.amounts, np.abs(self.amounts) / wheels.turn)
        return np.where(self.backward, -driven, driven)

    def kappas(self, wheels: Wheels) -> FloatArray:
        """Return the curvature of every piece, (candidates, pieces) [1/m]: backwards the heading turns against the front wheels."""
        side = np.where(self.straight, 0.0, np.sign(self.amounts))
        return wheels.kappa * np.where(self.backward, -side, side)

    def lead(self, wheels: Wheels, parts: int) -> FloatArray:
        """Return ``parts`` + 1 poses of every piece, as ``lead_along`` does."""
        sides = np.sign(self.kappas(wheels))
        return lead_along(self.start, self.lengths(wheels), (sides * wheels.slide, sides * wheels.turn), parts)


@dataclass(frozen=True)
class Draft:
    """A drive as pieces of constant steering; arrays over the pieces, in the order of driving. Odd ``leg`` are driven backwards."""

    start: FloatArray  # of the lead rear axle, x, y [m], and the lead unit's heading [rad] (3,)
    lengths: FloatArray  # (n,) [m]
    kappas: FloatArray  # (n,) [1/m]
    leg: IntArray  # that a piece belongs to, counted from 0 (n,)

    def pieces(self, leg: int) -> list[tuple[float, float]]:
        """Return length and curvature of a leg's pieces."""
        own = self.leg == leg
        return list(zip(self.lengths[own].tolist(), self.kappas[own].tolist(), strict=True))


def lead_along(start: FloatArray, lengths: FloatArray, motions: tuple[FloatArray, FloatArray], parts: int) -> FloatArray:
    """Return ``parts`` + 1 poses of every piece, x, y, heading, shape (candidates, pieces, parts + 1, 3) [m, rad].

    ``start`` is (candidates, 3); ``lengths``, negative backwards, and the two ``motions``, as in ``moved``, are (candidates, pieces).
    """
    out = np.empty((*lengths.shape, parts + 1, 3))
    here, share = start, np.linspace(0.0, 1.0, parts + 1)
    for piece in range(lengths.shape[1]):
        slide, turn = (one[:, piece, None] for one in motions)
        out[:, piece] = moved(here, lengths[:, piece, None] * share, slide, turn)
        here = out[:, piece, -1]
    return out


def moved(start: FloatArray, length: FloatArray, slide: FloatArray, turn: FloatArray) -> FloatArray:
    """Return where the lead unit is after ``length`` (candidates, n) [m], shape (candidates, n, 3).

    Its axle moves ``slide`` sideways [-], and the unit turns by ``turn`` [rad/m], per metre forward; both (candidates, 1).
    """
    angle = turn * length
    towards = start[:, 2:3] + 0.5 * angle
    chord = length * np.sinc(0.5 * angle / np.pi)
    x = start[:, :1] + chord * (np.cos(towards) - slide * np.sin(towards))
    y = start[:, 1:2] + chord * (np.sin(towards) + slide * np.cos(towards))
    return np.stack([x, y, start[:, 2:3] + angle], axis=-1)


def posed(vehicle: Vehicle, lead: FloatArray, beta: FloatArray | None = None) -> Records:
    """Return every unit's pose, shape (..., units), of ``lead`` (..., 3); ``beta`` (..., couplings) are the articulation angles."""
    flat = lead.reshape(-1, 3)
    z = np.zeros((len(flat), 1 + len(vehicle.units)))
    if beta is not None:
        z[:, 2:] = beta.reshape(len(flat), -1)
    points = np.stack([flat[:, 0], flat[:, 1], np.cos(flat[:, 2]), np.sin(flat[:, 2]), np.zeros(len(flat))])
    return place_many(vehicle.table(), points, z).reshape(*lead.shape[:-1], len(vehicle.units))


def articulated(vehicle: Vehicle, pieces: Sequence[tuple[float, float]], counts: Sequence[int], begin: FloatArray) -> list[FloatArray]:
    """Return the articulation angles along ``pieces`` (length, kappa) driven forwards, a piece's in (count + 1, couplings) [rad].

    ``begin`` are those at the first piece's begin.
    """
    units, ahead, found = vehicle.table(), vehicle.lead.wheelbase, []
    for (length, kappa), count in zip(pieces, counts, strict=True):
        slide, turn = motion(units, kappa)
        pace = float(np.hypot(1.0, slide + ahead * turn))  # of the front axle, per metre that the rear one moves forward
        path = np.array([[length * pace, turn / pace, turn / pace]])
        substeps = max(1, int(np.ceil(length / (count * _SUBSTEP_M))))
        off = float(np.arctan2(slide + ahead * turn, 1.0))
        first = np.concatenate([[0.0], begin])
        angles = integrate(units, (ahead, 0.0), path, np.array([count]), substeps, off, vehicle.max_curvature * _SLACK, first)[0][:, 1:]
        begin = angles[-1]
        found.append(angles)
    return found


@dataclass(frozen=True)
class DrivenLeg:
    """A driven leg; arrays over its poses, in the order of driving."""

    backward: bool
    s: FloatArray  # driven by the lead rear axle since the leg's begin (n,) [m]
    lead: FloatArray  # that axle's x, y [m] and the lead unit's heading [rad] (n, 3)
    beta: FloatArray  # articulation angles (n, couplings) [rad]
    kappa: FloatArray  # held between the poses (n - 1,) [1/m]
    poses: Records  # of every unit (n, units)

    @property
    def direction(self) -> str:
        """What files and tables call the direction."""
        return direction_of(backward=self.backward)

    @property
    def length(self) -> float:
        """How far the lead rear axle is driven [m]."""
        return float(self.s[-1])

    def reversed(self) -> DrivenLeg:
        """Return the leg played in reverse."""
        return DrivenLeg(not self.backward, self.s[-1] - self.s[::-1], self.lead[::-1], self.beta[::-1], self.kappa[::-1], self.poses[::-1])


def driven(
    vehicle: Vehicle, start: FloatArray, pieces: Sequence[tuple[float, float]], spacing: float, *, backward: bool = False
) -> DrivenLeg:
    """Return a leg from ``start`` (3,) along ``pieces`` (length, kappa), with poses at most ``spacing`` apart and at all ends [m].

    Trailers are in line at its begin. Backwards only vehicles without trailers are driven; others by ``DrivenLeg.reversed``.
    """
    units, sign = vehicle.table(), -1.0 if backward else 1.0
    pieces = [piece for piece in pieces if piece[0] > _NO_PIECE_M]
    counts = [max(1, int(np.ceil(length / spacing))) for length, _ in pieces]
    lead, here, s = [start[None]], start[None], [np.zeros(1)]
    for (length, kappa), count in zip(pieces, counts, strict=True):
        share = np.arange(1, count + 1) / count
        slide, turn = motion(units, kappa)
        part = moved(here, sign * length * share[None], np.array([[slide]]), np.array([[turn]]))[0]
        lead.append(part)
        here = part[-1:]
        s.append(s[-1][-1] + length * share)
    couplings = len(vehicle.units) - 1
    beta = np.zeros((1 + sum(counts), couplings))
    if couplings:
        beta[1:] = np.concatenate([part[1:] for part in articulated(vehicle, pieces, counts, np.zeros(couplings))])
    along, held = np.concatenate(lead), np.repeat([kappa for _, kappa in pieces], counts)
    return DrivenLeg(backward, np.concatenate(s), along, beta, held, posed(vehicle, along, beta))
