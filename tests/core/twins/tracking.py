"""How far units stray at most, and what they may come upon: ``core/stray.c`` and ``core/brushes.c``, a number or a kerb at a time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from hdvplan.arrays import BoolArray, FloatArray, Records
from hdvplan.judging.straying import BRUSH, SPACING_M, STRAY

BEFORE_M, ROUNDS, WINDOW_M, REACH_M, NEVER_M, ARCTAN = 150.0, 3, 4.0, 0.5, 1e-9, 0.33


class Errors(NamedTuple):
    """What a coupling strays: its offset and residual [m], its slope, and where it is along its track [m]."""

    offset: float
    slope: float
    residual: float = 0.0
    shift: float = 0.0
    beyond: float = 0.0  # of the offset, beyond the first order [m]
    steeper: float = 0.0  # of the slope


class Lead(NamedTuple):
    """How a unit is led: its coupling, where this is along its track and the track's bend there, its course, and how wheels are turned."""

    coupling: Errors
    aside: tuple[float, float]
    course: float
    off: float


class Beyond(NamedTuple):
    """What a unit strays beyond the first order: its axle [m], its heading [rad], and its coupling behind [m]."""

    axle: float = 0.0
    heading: float = 0.0
    next: float = 0.0


class Ahead(NamedTuple):
    """What of the unit ahead a law depends on: its heading [rad] and its rate, and what lies beyond the first order."""

    heading: float = 0.0
    rate: float = 0.0
    beyond: Beyond = Beyond()


class Law(NamedTuple):
    """By how much an axle turns otherwise than planned: in all, and without its own heading's share [rad]; what is left out; and how."""

    angle: float = 0.0
    other: float = 0.0
    residual: float = 0.0
    own: float = 0.0
    damping: float = 0.0


class Strays:
    """The comparison of docs/maths.md, Tracking error, along the links of a plan (intervals, units)."""

    def __init__(self, units: Records, links: Records, gains: Records) -> None:
        self.units, self.links, self.gains = units, links, gains

    def of(self, error: float, slope: float) -> Records:
        """Return how far every unit strays at most, (intervals, units) of ``STRAY``."""
        found, now = np.zeros(self.links.shape, STRAY), np.zeros(len(self.units), STRAY)
        for i in range(-int(BEFORE_M / SPACING_M), len(self.links)):
            coupling, ahead = Errors(error, slope), Ahead()
            for unit in range(len(self.units)):
                coupling, ahead = self._step(i, unit, coupling, ahead, now[unit], error)
            if i >= 0:
                found[i] = now
        return found

    def _link(self, i: int, unit: int) -> np.void:
        link: np.void = self.links[min(max(i, 0), len(self.links) - 1), unit]
        return link

    def _gain(self, i: int, unit: int) -> np.void:
        gain: np.void = self.gains[min(max(i, 0), len(self.links) - 1), unit]
        return gain

    def _bend(self, i: int, unit: int, metres: float) -> float:
        each = SPACING_M * float(self._link(i, unit)["coupling_speed"])
        around = 1 + int(np.clip(metres / each, 0, 1000))
        course = np.array([self._link(j, unit)["course"] for j in range(i - around, i + around + 1)])
        return float(np.max(np.maximum(np.abs(np.diff(course)) / each, 0.0)))

    def _aside(self, i: int, unit: int, offset: float, along: float, skew: float) -> tuple[float, float]:
        """Return how far along its track a coupling can be, and the track's largest bend there."""
        shift, bend = along + offset * skew, 0.0
        for _ in range(ROUNDS):
            bend = self._bend(i, unit, shift)
            turned = bend * shift
            bow = 0.5 * turned * (shift + offset * turned)
            shift = (along + (offset + bow) * skew + offset * turned) / max(1.0 - 0.5 * turned**2, 0.5)
        return shift, bend

    def _law(self, i: int, unit: int, aside: tuple[float, float], coupling: Errors, ahead: Ahead, heading: float) -> Law:
        own, link, (shift, bend) = self.units[unit], self._link(i, unit), aside
        ratio, turned = abs(float(own["steering_ratio"])), bend * shift
        if ratio == 0.0 or own["steered_by"] != 1 + unit:
            return Law()
        second = own["wheelbase"] * (heading - np.sin(heading) + 1.0 - np.cos(heading)) + coupling.offset * turned + 0.5 * shift * turned**2
        if unit == 0:
            angle = np.arctan(coupling.slope / (1.0 - bend * coupling.offset)) + turned + heading
            missing = coupling.slope * (coupling.slope**2 + bend * coupling.offset) + 2.0 * bend * (second + shift)
        else:
            metres = (shift + coupling.shift) / link["coupling_speed"]
            around = 1 + int(np.clip(metres / SPACING_M, 0, 1000))
            turning = np.array([self._link(j, unit - 1)["turning"] for j in range(i - around, i + around + 1)])
            change, speed = np.max(np.abs(turning - turning[around])), abs(turning[around])
            angle = ahead.heading + heading + (speed + change) * metres
            missing = ahead.rate * metres + change * metres + speed * 2.0 * second / link["coupling_speed"]
        planned, stop, other = ratio * abs(link["steered"]), own["max_steering_angle"], ratio * (angle - heading)
        if abs(planned - stop) < ratio * angle:
            return Law(ratio * angle, other, ratio * (missing + angle), ratio, 0.0)
        return Law() if planned >= stop else Law(ratio * angle, other, ratio * missing, ratio, ratio)

    def _step(self, i: int, unit: int, coupling: Errors, ahead: Ahead, stray: np.void, error: float) -> tuple[Errors, Ahead]:
        """Write one unit's bounds over those of the interval before; return what it passes on."""
        link, length = self._link(i, unit), float(self.units[unit]["wheelbase"])
        theta, alpha, speed, per = link["coupling_off"], link["axle_off"], link["axle_speed"], link["axle_speed"] / length
        omega, along_axle, before, heading = abs(theta), np.cos(alpha), stray.copy(), float(stray["heading"])
        gain, beyond = self._gain(i, unit), Beyond()
        stray["offset"] = coupling.offset
        for _ in range(ROUNDS):
            bow, third = length * (1.0 - np.cos(heading)), heading - np.sin(heading)
            along = (stray["axle"] * abs(np.sin(alpha)) + bow) / np.cos(theta)
            shift, bend = aside = self._aside(i, unit, coupling.offset, along, abs(np.tan(theta)))
            turned = bend * shift
            law = self._law(i, unit, aside, coupling, ahead, heading)
            course = np.arctan(coupling.slope / (1.0 - min(bend * coupling.offset, 0.5))) + turned
            seen = shift * coupling.slope + 0.5 * turned * (shift + coupling.offset * turned)
            stray["residual"] = coupling.residual + seen + length * np.cos(theta) * third
            stray["bow"] = bow * np.sin(theta)
            offset = coupling.offset + stray["residual"] + abs(stray["bow"])
            askew = min(heading + law.angle, 1.5)
            stray["drift"] = speed * (np.tan(askew) - askew + link["bend"] * stray["axle"] * np.tan(askew) + law.residual)
            source = speed * ((1.0 + law.own) * offset * link["by_offset"] + law.other) + stray["drift"]
            stray["axle"] = (before["axle"] + SPACING_M * source) / (1.0 + SPACING_M * speed * (1.0 + law.damping) * link["by_axle"])
            beyond = self._beyond(i, unit, coupling, ahead.beyond, stray, float(before["beyond"]))
            stray["axle"] = min(stray["axle"], error * gain["axle"] + beyond.axle)
            was = float(before["heading"])
            wide, pull = np.tan(min(omega + course + was, 1.5)), np.tan(min(omega + course - was, 1.5)) - np.tan(omega)
            askance = (wide + abs(np.tan(alpha))) * (link["bend"] * before["axle"] + 1.0 / np.cos(min(was, 1.4)) - 1.0)
            rate = per * (along_axle * pull + askance + (1.0 + askance) * law.other / along_axle)
            most_rate = per * (along_axle * (wide - np.tan(omega)) + askance + (1.0 + askance) * law.angle / along_axle)
            grown = was + SPACING_M * rate / (1.0 + SPACING_M * per * along_axle / np.cos(omega) ** 2)
            heading = min(grown, np.arcsin(min(offset * link["by_offset"] + stray["axle"] * link["by_axle"], 1.0)))
            heading = min(heading, error * gain["heading"] + beyond.heading)
        stray["heading"], stray["beyond"] = heading, beyond.axle
        lead = Lead(coupling, aside, course, law.angle)
        return self._passed(i, unit, stray, lead, beyond, error), Ahead(heading, most_rate, beyond)

    def _beyond(self, i: int, unit: int, coupling: Errors, ahead: Beyond, stray: np.void, before: float) -> Beyond:
        """Return what T1 to T4 make of what the first order leaves out."""
        link, speed = self._link(i, unit), float(self._link(i, unit)["axle_speed"])
        askew = link["by_offset"] * (coupling.beyond + stray["residual"] + abs(stray["bow"]))
        followed = 1.0 + link["law_by_heading"]
        source = abs(followed) * askew + abs(link["law_by_ahead"]) * ahead.axle + abs(link["law_by_turned"]) * ahead.heading
        pull = followed * link["by_axle"] - link["law_by_axle"]
        axle = (before + SPACING_M * (speed * source + stray["drift"])) / (1.0 + SPACING_M * speed * pull)
        by_axle = abs(link["next_by_axle"] - link["next_by_heading"] * link["by_axle"])
        return Beyond(axle, askew + link["by_axle"] * axle, by_axle * axle + abs(link["next_by_heading"]) * askew)

    def _passed(self, i: int, unit: int, stray: np.void, lead: Lead, beyond: Beyond, error: float) -> Errors:
        if unit + 1 == len(self.units):
            return Errors(0.0, 0.0)
        link, own, heading = self._link(i, unit), self.units[unit], float(stray["heading"])
        hitch, gamma, alpha = abs(float(own["hitch_offset"])), float(link["next_off"]), float(link["axle_off"])
        share, bow, omega = hitch / own["wheelbase"], hitch * (1.0 - np.cos(heading)), abs(link["coupling_off"])
        third, sideways, across = hitch * (heading - np.sin(heading)), abs(np.sin(gamma)), abs(np.sin(gamma - alpha))
        apart = stray["axle"] * abs(link["next_by_axle"]) + heading * abs(link["next_by_heading"])
        straight = min(apart, error * self._gain(i, unit)["next"] + beyond.next + third)
        together = (straight * sideways + stray["axle"] * abs(np.sin(alpha))) / np.cos(gamma)
        along = min(stray["axle"] * across + hitch * heading * sideways, together) + bow
        offset = straight + bow * sideways
        shift, bend = self._aside(i, unit + 1, offset, along, 0.0)
        swing, turned = share * (np.tan(min(omega + lead.course + heading, 1.5)) - np.tan(omega)), bend * shift
        slope, steeper = np.tan(min(heading + lead.off * (2.0 + share) + swing + turned, 1.5)) * (1.0 + bend * offset), np.inf
        if lead.off == 0.0:
            skew = lead.aside[1] * (beyond.axle * abs(np.sin(alpha)) / np.cos(omega) + lead.coupling.beyond * np.tan(omega))
            by_course = share / np.cos(omega) ** 2
            steeper = self._steep(lead, heading, share, omega, turned) * (1.0 + bend * offset)
            steeper += beyond.heading - heading + bend * (beyond.axle * across + beyond.heading * hitch * sideways)
            steeper += by_course * (lead.coupling.steeper + skew + beyond.heading - lead.coupling.slope - heading)
            gain = max(self._gain(i, unit)["next_slope"], self._gain(i + 1, unit)["next_slope"])
            slope = min(slope, error * gain + steeper)
        seen = shift * slope + 0.5 * turned * (shift + offset * turned)
        return Errors(offset + seen, slope, seen + bow * sideways + third, shift, beyond.next, steeper)

    def _steep(self, lead: Lead, heading: float, share: float, omega: float, turned: float) -> float:
        """Return the slope of the coupling behind with every part as it may be beyond the first order."""
        slope, (shift, bend) = lead.coupling.slope, lead.aside
        course = np.tan(min(slope / (1.0 - min(bend * lead.coupling.offset, 0.5)), 1.5)) + 2.0 * bend * shift
        swing = share * (np.tan(min(omega + course + heading, 1.5)) - np.tan(omega))
        return float(np.tan(min(heading + swing + ARCTAN * swing**2 + 2.0 * turned, 1.5)))


class Body(NamedTuple):
    """One body at one pose: itself, as many poses before and after as it has, and what it strays."""

    unit: np.void
    number: int
    at: float
    poses: Records  # (3,): before, at, after
    stray: np.void
    by_axle: FloatArray  # (2,), of the links around it
    by_offset: float
    axle_off: float

    def points(self, ahead: FloatArray, left: FloatArray) -> FloatArray:
        """Return points of the body at the three poses, (3, n, 2)."""
        x, y, cos, sin = (self.poses[name][:, None] for name in ("x", "y", "cos", "sin"))
        return np.stack([x + ahead * cos - left * sin, y + ahead * sin + left * cos], axis=-1)

    def brushes(
        self, gap: FloatArray, normal: FloatArray, ahead: FloatArray, left: FloatArray, share: FloatArray
    ) -> tuple[Records, FloatArray]:
        """Return pairs of points and kerbs (n,), normals (n, 2) pointing away from these, and how far the points come at most (n,) [m]."""
        points, pose, stray = self.points(ahead, left), self.poses[1], self.stray
        way = np.sum((points[[0, 2]] - points[1]) * normal, axis=-1)
        along, across = normal @ [pose["cos"], pose["sin"]], normal @ [-pose["sin"], pose["cos"]]
        found = np.zeros(len(gap), BRUSH)
        found["gap"] = gap + np.minimum(np.min(share * way, axis=0), 0.0)
        found["at"], found["unit"], found["ahead"] = self.at, self.number, ahead
        found["by_axle"] = along * np.sin(self.axle_off) - across * np.cos(self.axle_off)
        found["by_heading"], found["second"] = left * along - ahead * across, np.abs(ahead * along + left * across)
        found["x"], found["y"] = points[1].T
        third, heading = stray["heading"] - np.sin(stray["heading"]), np.abs(found["by_heading"])
        apart = np.abs(found["by_axle"]) * stray["axle"] + heading * stray["heading"]
        most = np.max(np.abs(found["by_axle"][:, None] - found["by_heading"][:, None] * self.by_axle), axis=1)
        together = most * stray["axle"] + heading * (self.by_offset * (stray["offset"] + stray["residual"] + stray["bow"]) + third)
        return found, np.minimum(apart, together) + found["second"] * (1.0 - np.cos(stray["heading"]))


def brushes(
    units: Records,
    links: Records,
    strays: Records,
    pieces: Records,
    end: float,
    posed: tuple[FloatArray, Records, FloatArray],
    behind: FloatArray,
) -> Records:
    """Return the pairs that may be closed at poses (s, poses, front)."""
    parts = []
    for i, (s, at) in enumerate(zip(posed[0], posed[2], strict=True)):
        for number, unit in enumerate(units):
            low, high = s - behind[number] - unit["rear_overhang"] - WINDOW_M, s - behind[number] + unit["front"] + WINDOW_M
            beside = np.flatnonzero((pieces["s_high"] >= low) & (pieces["s_low"] <= high))
            found = _at(_body(units, links, strays, posed, i, number, float(at)), pieces[beside])
            found["piece"] = beside[found["piece"]]
            parts.append(found[found["s"] < (end if s > end else np.inf)])
    return np.concatenate(parts)


def _body(
    units: Records, links: Records, strays: Records, posed: tuple[FloatArray, Records, FloatArray], i: int, number: int, at: float
) -> Body:
    around = np.clip(int(max(at / SPACING_M - 0.5, 0.0)) + np.arange(2), 0, len(links) - 1)
    most = strays[around[0], number].copy()
    for name in ("axle", "heading", "offset", "residual", "bow"):
        most[name] = np.max(np.abs(strays[around, number][name]))
    neighbours = posed[1][np.clip([i - 1, i, i + 1], 0, len(posed[1]) - 1), number]
    here = links[int(np.clip(at / SPACING_M, 0, len(links) - 1)), number]
    by_axle, by_offset = links[around, number]["by_axle"], float(np.max(links[around, number]["by_offset"]))
    return Body(units[number], number, at, neighbours, most, by_axle, by_offset, float(here["axle_off"]))


def _at(body: Body, pieces: Records) -> Records:
    """Return the pairs of one body; ``piece`` is the index in ``pieces``."""
    unit, found = body.unit, [np.zeros(0, BRUSH)]
    rear = np.where(pieces["wheels"] == 1, 0.0, -unit["rear_overhang"])
    front = np.where(pieces["wheels"] == 1, min(unit["wheelbase"], unit["front"]), unit["front"])
    along, normal = np.stack([pieces["cos"], pieces["sin"]], axis=1), np.stack([-pieces["sin"], pieces["cos"]], axis=1)
    begin = np.stack([pieces["x"], pieces["y"]], axis=1)
    half = np.full((2, len(pieces)), 0.5)

    def keep(pairs: tuple[Records, FloatArray], kept: BoolArray, s: FloatArray) -> None:
        brush, reached = pairs
        brush["s"], brush["piece"] = s, np.arange(len(pieces))
        kept &= brush["gap"] < reached
        found.append(brush[kept])

    for corner in range(4):
        ahead, left = rear if corner < 2 else front, np.full(len(pieces), unit["half_width"] if corner % 2 else -unit["half_width"])
        to = body.points(ahead, left)[1] - begin
        u, v = np.sum(to * along, axis=1), np.sum(to * normal, axis=1)
        on = np.clip(u, 0.0, pieces["length"])
        apart = np.hypot(u - on, v)
        aside = (to - on[:, None] * along) / np.maximum(apart, NEVER_M)[:, None]
        far = body.stray["axle"] + np.hypot(ahead, left) * body.stray["heading"] + REACH_M
        own, slanting = body.brushes(v, normal, ahead, left, half), body.brushes(apart, aside, ahead, left, half)
        beside = u == on
        better = beside | ((v > 0.0) & (own[0]["gap"] * slanting[1] > slanting[0]["gap"] * own[1]))
        kept = np.where(beside, (v >= 0.0) & (pieces["length"] > 0.0), apart > NEVER_M) & (apart <= far)
        share = np.divide(on, pieces["length"], out=np.zeros(len(on)), where=pieces["length"] > 0.0)
        s = pieces["s_begin"] + share * (pieces["s_end"] - pieces["s_begin"])
        keep((np.where(better, own[0], slanting[0]), np.where(better, own[1], slanting[1])), kept, s)
    pose, sign = body.poses[1], np.where(pieces["left"] == 1, 1.0, -1.0)
    to = begin - [pose["x"], pose["y"]]
    u, v = to @ [pose["cos"], pose["sin"]], to @ [-pose["sin"], pose["cos"]]
    room = sign * v - unit["half_width"]
    beside = (pieces["corner"] == 1) & (u >= rear) & (u <= front) & (room >= -2.0 * unit["half_width"])
    steps = np.stack([np.diff(body.poses[name]) for name in ("x", "y")], axis=1)
    ways = np.sum(steps * np.stack([body.poses[name][:2] for name in ("cos", "sin")], axis=1), axis=1)
    left = np.stack([front - u, u - rear])  # of the body, before the corner is past its end
    shares = np.where(left < ways[:, None], left / np.where(ways == 0.0, 1.0, ways)[:, None], 0.5)
    towards = sign[:, None] * np.array([pose["sin"], -pose["cos"]])
    side = body.brushes(room, towards, u, sign * unit["half_width"], shares)
    longest = np.hypot(max(unit["front"], unit["rear_overhang"]), unit["half_width"])
    keep(side, beside & (room <= body.stray["axle"] + longest * body.stray["heading"] + REACH_M), pieces["s_begin"])
    return np.concatenate(found)
