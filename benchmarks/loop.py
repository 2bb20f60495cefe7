"""Plans in a closed loop: a simulated driver and two controllers, with delay, noise and gain errors; what they err by, judged.

python benchmarks/loop.py [--out results/loop] [--roads a,b] [--vehicles a,b]

Streets and clearances are those of results/tracking/roads.csv. Writes loop.csv, loop.md and run.json.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from cases import case_within, free_case, words, write_results
from scipy.interpolate import CubicSpline
from scipy.ndimage import minimum_filter1d

import hdvplan
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.followed import GivenPath
from hdvplan.judging.result import Result
from hdvplan.judging.straying import SPACING_M, chain_of
from hdvplan.judging.tracking import tracking_of
from hdvplan.report.grid import markdown_table
from hdvplan.road.arcs import wrapped

STREETS = Path(__file__).parents[1] / "results" / "tracking" / "roads.csv"
STEP_S, DELAY_S = 0.05, 0.3  # of the simulation; from what is seen to what the wheels do
GAINS = (0.9, 1.0, 1.1)  # of the wheels' angle over the one that is wanted
SEEDS = 4  # runs with each gain
NOISES = {"offset": (0.05, 2.0), "heading": (np.radians(0.3), 1.0), "wheels": (np.radians(0.3), 0.5)}  # deviation [m], [rad]; time [s]
FASTEST, SIDEWAYS = 30.0 / 3.6, 1.0  # [m/s], [m/s2]: a bus with people standing in it
SLOWING_M = 10.0  # before and beyond a bend, along which it is driven as slowly as there
AHEAD_S, UNNOTICED_M = 1.5, 0.1  # the driver: how far ahead an error shall be gone, and how much of it is let pass
LOOKAHEAD_M, LOOKAHEAD_S = 3.0, 0.8  # pure pursuit
BACK_PER_S = 0.8  # Stanley: by how much of the offset it turns back
END_M = 15.0  # of the plan that is left out: there is nothing to pursue behind it


@dataclass(frozen=True)
class Track:
    """A plan at nodes every SPACING_M of its front axle's track: what is followed."""

    front: CubicSpline  # over the front axle's way [m]
    rear: FloatArray  # (n, 2) [m]
    course: FloatArray  # of the front axle's track, without jumps [rad]
    wheels: FloatArray  # angle of the front wheels [rad]
    speed: FloatArray  # [m/s]
    behind: FloatArray  # the rear axle's way until there [m]
    wheelbase: float
    most: float  # angle of the wheels [rad]

    @classmethod
    def of(cls, result: Result) -> Track:
        """Return the track of a plan."""
        chain = chain_of(result.drive)
        lead, unit = chain.nodes[:, 0], chain.vehicle.lead
        rear = np.stack([lead["x"], lead["y"]], axis=1)
        front = rear + unit.wheelbase * np.stack([lead["cos"], lead["sin"]], axis=1)
        course = np.unwrap(np.arctan2(*np.gradient(front, axis=0).T[::-1]))
        bend = np.abs(np.gradient(course, SPACING_M))
        speed = np.minimum(FASTEST, np.sqrt(SIDEWAYS / np.maximum(bend, 1e-6)))
        way = SPACING_M * np.arange(len(front))
        return cls(
            CubicSpline(way, front),
            rear,
            course,
            wrapped(course - np.arctan2(lead["sin"], lead["cos"])),
            minimum_filter1d(speed, 1 + 2 * int(SLOWING_M / SPACING_M), mode="nearest"),
            np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(rear, axis=0).T))]),
            unit.wheelbase,
            float(np.arctan(unit.wheelbase * result.drive.vehicle.max_curvature)),
        )

    @property
    def length(self) -> float:
        """Of the part that is followed [m]."""
        return float(self.front.x[-1]) - END_M

    def at(self, values: FloatArray, way: FloatArray) -> FloatArray:
        """Return values that are given at nodes, (n,) or (n, 2), at places of the front axle's way (runs,) [m]."""
        place = np.clip(way / SPACING_M, 0.0, len(values) - 1.001)
        low = place.astype(int)
        part = (place - low).reshape(-1, *(1,) * (values.ndim - 1))
        found: FloatArray = values[low] + part * (values[low + 1] - values[low])
        return found


@dataclass(frozen=True)
class Seen:
    """What a driver knows: the place beside the plan, and how the vehicle stands there; (runs,)."""

    way: FloatArray  # of the front axle along its track [m]
    offset: FloatArray  # to its left [m]
    askew: FloatArray  # of the body, against the plan [rad]
    speed: FloatArray  # [m/s]


def driver(track: Track, seen: Seen) -> FloatArray:
    """Return what a driver does who knows the plan: steers as it does once the delay is over, and corrects what is to be seen ahead."""
    ahead = AHEAD_S * seen.speed
    error = seen.offset + ahead * seen.askew
    noticed = np.sign(error) * np.maximum(np.abs(error) - UNNOTICED_M, 0.0)
    return track.at(track.wheels, seen.way + DELAY_S * seen.speed) - np.arctan(noticed / ahead)


def pure_pursuit(track: Track, seen: Seen) -> FloatArray:
    """Return the wheels' angle of the arc from the rear axle to the point of its planned track some way ahead."""
    ahead = LOOKAHEAD_M + LOOKAHEAD_S * seen.speed
    heading = track.at(track.course, seen.way) - track.at(track.wheels, seen.way) + seen.askew
    left = track.at(track.course, seen.way) + 0.5 * np.pi
    front = track.front(seen.way) + seen.offset[:, None] * np.stack([np.cos(left), np.sin(left)], axis=1)
    goal = track.at(track.rear, np.interp(track.at(track.behind, seen.way) + ahead, track.behind, track.front.x))
    dx, dy = (goal - front + track.wheelbase * np.stack([np.cos(heading), np.sin(heading)], axis=1)).T
    angles: FloatArray = np.arctan(2.0 * track.wheelbase * (dy * np.cos(heading) - dx * np.sin(heading)) / (dx**2 + dy**2))
    return angles


def stanley(track: Track, seen: Seen) -> FloatArray:
    """Return the wheels' angle along the track, and towards it the more the further off the front axle is."""
    return track.at(track.wheels, seen.way) - seen.askew - np.arctan(BACK_PER_S * seen.offset / seen.speed)


FOLLOWERS: dict[str, Callable[[Track, Seen], FloatArray]] = {"driver": driver, "pure pursuit": pure_pursuit, "Stanley": stanley}


@dataclass(frozen=True)
class Driven:
    """What followers did, at every step: (steps, runs). NaN from a run's end on."""

    way: FloatArray  # of the front axle along its planned track [m]
    offset: FloatArray  # to its left [m]
    rear: FloatArray  # (steps, runs, 2) [m]
    heading: FloatArray  # [rad]

    def error(self, run: int) -> float:
        """Return the largest offset of a run [m]."""
        return float(np.nanmax(np.abs(self.offset[:, run])))

    def length(self, run: int) -> float:
        """Return its tracking length: its largest offset over the largest change of it [m]."""
        slope = np.diff(self.offset[:, run]) / np.diff(self.way[:, run])
        return self.error(run) / float(np.nanmax(np.abs(slope)))

    def path(self, run: int) -> GivenPath:
        """Return what a run drove."""
        own = np.isfinite(self.offset[:, run])
        return GivenPath(self.rear[own, run], self.heading[own, run])


def follow(track: Track, follower: Callable[[Track, Seen], FloatArray], gains: FloatArray, rng: np.random.Generator) -> Driven:
    """Drive along a track from where it begins, a run with each of some gains."""
    runs, delay = len(gains), round(DELAY_S / STEP_S)
    front, heading = np.tile(track.front(0.0), (runs, 1)), np.full(runs, track.course[0] - track.wheels[0])
    way, offset, noise, rows = np.zeros(runs), np.zeros(runs), {name: np.zeros(runs) for name in NOISES}, []
    wanted = [np.full(runs, track.wheels[0])] * delay
    while np.min(way) < track.length:
        for name, (deviation, time) in NOISES.items():
            kept = np.exp(-STEP_S / time)
            noise[name] = kept * noise[name] + np.sqrt(1.0 - kept**2) * deviation * rng.standard_normal(runs)
        speed = track.at(track.speed, way)
        askew = heading - (track.at(track.course, way) - track.at(track.wheels, way))
        rear = front - track.wheelbase * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        rows.append(np.where(way < track.length, [way, offset, *rear.T, heading], np.nan))
        wanted.append(follower(track, Seen(way, offset + noise["offset"], askew + noise["heading"], speed)))
        wheels = np.clip(gains * wanted.pop(0) + noise["wheels"], -track.most, track.most)
        turned = STEP_S * speed * np.sin(wheels) / track.wheelbase
        course = heading + wheels + 0.5 * turned
        front = front + (STEP_S * speed)[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1)
        heading, way = heading + turned, way + STEP_S * speed
        for _ in range(3):  # where the front axle is beside its track: Newton's method, nearly
            along, aside = track.at(track.course, way), front - track.front(way)
            way = np.minimum(way + aside[:, 0] * np.cos(along) + aside[:, 1] * np.sin(along), track.front.x[-1])
        offset = aside[:, 1] * np.cos(along) - aside[:, 0] * np.sin(along)
    way, offset, x, y, heading = np.moveaxis(np.array(rows), 1, 0)
    return Driven(way, offset, np.stack([x, y], axis=-1), heading)


def rows_of(case: Case) -> list[dict[str, object]]:
    """Return a row for each follower of a case's plan: what it erred by in all runs, and the verdict on the widest one."""
    result = hdvplan.plan(case)
    track, gains, found = Track.of(result), np.repeat(GAINS, SEEDS), []
    for name, follower in FOLLOWERS.items():
        driven = follow(track, follower, gains, np.random.default_rng(5))
        errors = [driven.error(run) for run in range(len(gains))]
        lengths = [driven.length(run) for run in range(len(gains))]
        widest = int(np.argmax(errors))
        allowed, judged = tracking_of(result.drive, result.balance, lengths[widest]), hdvplan.judge(case, driven.path(widest))
        row: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "follower": name}
        row |= {"deviation_m": float(np.nanstd(driven.offset)), "error_m": float(np.median(errors)), "length_m": float(np.median(lengths))}
        row |= {"error_widest_m": errors[widest], "length_widest_m": lengths[widest]}
        row |= {"allowed_m": None if allowed is None else allowed.error, "spare_planned_m": result.balance.min_clearance}
        row |= {"spare_driven_m": judged.balance.min_clearance}
        print(*row.values(), sep="  ", flush=True)
        found.append(row)
    return found


def main(arguments: Sequence[str] | None = None) -> None:
    """Follow a plan on every road with every vehicle and write the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("results/loop"))
    parser.add_argument("--roads", type=words)
    parser.add_argument("--vehicles", type=words)
    options = parser.parse_args(arguments)
    rows, cases = [], []
    for street in pd.read_csv(STREETS).to_dict("records"):
        if street["road"] in (options.roads or [street["road"]]) and street["vehicle"] in (options.vehicles or [street["vehicle"]]):
            case = case_within(free_case(street["road"], street["vehicle"]), street["half_width_m"])
            cases.append(replace(case, settings=replace(case.settings, clearance=street["clearance_m"])))
            rows += rows_of(cases[-1])
    table = pd.DataFrame(rows)
    write_results(options.out, "loop", table, markdown(table), cases)


def markdown(table: pd.DataFrame) -> str:
    """Return the table as it is read."""
    names = {
        "deviation_m": "deviation [m]", "error_m": "E [m]", "length_m": "l [m]", "error_widest_m": "widest E [m]",
        "length_widest_m": "its l [m]", "allowed_m": "E that the bound allows [m]", "spare_planned_m": "spare, planned [m]",
        "spare_driven_m": "spare, driven [m]",
    }  # fmt: skip
    shown = table.rename(columns=names)
    for name in names.values():
        shown[name] = shown[name].map("{:.2f}".format)
    held, fits = table["error_widest_m"] <= table["allowed_m"], table["spare_driven_m"] >= 0.0
    offset, *angles = (deviation for deviation, _ in NOISES.values())
    heading, wheels = np.degrees(angles)
    return f"""# Plans in a closed loop

A simulated driver, pure pursuit and Stanley's controller follow the plans with the largest clearance of [the ten
roads](../tracking/roads.md), {len(GAINS) * SEEDS} runs each, at up to {3.6 * FASTEST:.0f} km/h and {SIDEWAYS:g} m/s2 sideways.
Delay {DELAY_S} s; wheels turn by {GAINS[0]}, {GAINS[1]} or {GAINS[2]} times what is wanted; noise with standard deviations of
{offset:g} m in what is seen of the offset, {heading:.1f} degrees in the heading, {wheels:.1f} degrees in the wheels.

The deviation is the standard deviation of the front axle's offset. E is a run's largest offset, l that over its largest change a metre,
both the median of the runs. The widest run is judged as a path of one's own: of {len(table)} such runs {held.sum()} keep to the E that
the bound allows for their l, of which {(held & fits).sum()} keep the street, as they must; of the others {(~held & fits).sum()} of
{(~held).sum()} do.

{markdown_table(shown, text=("road", "vehicle", "follower"))}
"""


if __name__ == "__main__":
    main()
