"""The closed loop: runs of one follower with delay, noise and gain errors, each judged as a path of one's own."""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from functools import cached_property

import numpy as np
import pandas as pd

from hdvplan import api
from hdvplan.answers import room_text, word_of, worded
from hdvplan.arrays import FloatArray
from hdvplan.driving.given import GivenPath
from hdvplan.errors import HdvplanError
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import Verdict, verdict_of
from hdvplan.loop import KM_H, LoopSettings
from hdvplan.loop.track import Follower, Seen, Track, follower_named
from hdvplan.settings import of_kind

STEP_S = 0.05  # of the simulation
NOISES = {"offset": (0.05, 2.0), "heading": (np.radians(0.3), 1.0), "wheels": (np.radians(0.3), 0.5)}  # deviation [m], [rad]; time [s]
_LOST_M, _LOST = 10.0, 0.5 * np.pi  # beside its track, or turned from it [rad], a run has lost it and ends
_NEWTON = 3  # steps towards the place beside the front axle


@dataclass(frozen=True)
class Driven:
    """What followers did, at every step: (steps, runs). NaN from a run's end on. Methods take a run's number, from 1."""

    wheels: FloatArray  #: angle of the front wheels [rad]
    way: FloatArray  #: of the front axle along its track [m]
    offset: FloatArray  #: to its left [m]
    rear: FloatArray  #: the rear axle's middle (steps, runs, 2) [m]
    heading: FloatArray  #: [rad]
    lost: tuple[bool, ...]  #: the runs that left the track

    def error(self, run: int) -> float:
        """Return the largest offset of a run [m]."""
        return float(np.nanmax(np.abs(self.offset[:, run - 1])))

    def length(self, run: int) -> float:
        """Return its tracking length: its largest offset over the largest change of it [m]; infinite where the offset never changes."""
        slope = float(np.nanmax(np.abs(np.diff(self.offset[:, run - 1]) / np.diff(self.way[:, run - 1]))))
        return self.error(run) / slope if slope > 0.0 else np.inf

    def path(self, run: int) -> GivenPath:
        """Return what a run drove."""
        own = np.isfinite(self.offset[:, run - 1])
        return GivenPath(self.rear[own, run - 1], self.heading[own, run - 1])

    def frame(self, run: int) -> pd.DataFrame:
        """Return a run as a table, which can be judged as a path of one's own: time [s], rear axle and offset [m], angles [rad]."""
        own, path = np.isfinite(self.offset[:, run - 1]), self.path(run)
        columns = {"t": STEP_S * np.flatnonzero(own), "x": path.points[:, 0], "y": path.points[:, 1], "heading": path.heading}
        return pd.DataFrame(columns | {name: getattr(self, name)[own, run - 1] for name in ("way", "offset", "wheels")})


def followed_by(track: Track, follower: Follower, settings: LoopSettings) -> Driven:
    """Drive a track from where it begins, as often with each gain as is asked for."""
    gains = np.array(settings.gains)
    runs, delay = len(gains), round(settings.delay / STEP_S)
    streams = [np.random.default_rng([settings.seed, run]) for run in range(runs)]  # a run is the same one, however many are driven
    front, heading = np.tile(track.front(0.0), (runs, 1)), np.full(runs, track.course[0] - track.wheels[0])
    way, offset, rows = np.zeros(runs), np.zeros(runs), list[FloatArray]()
    deviations, times = np.array(list(NOISES.values())).T
    kept = np.exp(-STEP_S / times)

    def drawn() -> FloatArray:
        return np.array([settings.noise * deviations * stream.standard_normal(len(NOISES)) for stream in streams])

    noise = drawn()
    wheels, lost = np.full(runs, track.wheels[0]), np.zeros(runs, dtype=bool)
    wanted = [wheels] * delay
    while np.any(driven := (way < track.length) & ~lost):
        noise = kept * noise + np.sqrt(1.0 - kept**2) * drawn()
        beside, turned_by, wheels_by = noise.T
        speed = track.at(track.speed, way)
        askew = heading - (track.at(track.course, way) - track.at(track.wheels, way))
        rear = front - track.wheelbase * np.stack([np.cos(heading), np.sin(heading)], axis=1)
        rows.append(np.where(driven, [wheels, way, offset, *rear.T, heading], np.nan))
        time = STEP_S * (len(rows) - 1)
        seen = Seen(time, STEP_S, way, offset + beside, askew + turned_by, speed, wheels, settings.delay)
        wanted.append(follower(track, seen))
        wheels = _turned(track, wheels, gains * wanted.pop(0) + wheels_by, STEP_S * speed)
        turned = STEP_S * speed * np.sin(wheels) / track.wheelbase
        course = heading + wheels + 0.5 * turned
        front = front + (STEP_S * speed)[:, None] * np.stack([np.cos(course), np.sin(course)], axis=1)
        heading, way = heading + turned, way + STEP_S * speed
        for _ in range(_NEWTON):
            along, aside = track.at(track.course, way), front - track.front(way)
            way = np.minimum(way + aside[:, 0] * np.cos(along) + aside[:, 1] * np.sin(along), track.front.x[-1])
        offset = aside[:, 1] * np.cos(along) - aside[:, 0] * np.sin(along)
        lost |= driven & ((np.abs(offset) > _LOST_M) | (np.abs(askew) > _LOST))
    angle, way, offset, x, y, heading = np.moveaxis(np.array(rows), 1, 0)
    return Driven(angle, way, offset, np.stack([x, y], axis=-1), heading, tuple(map(bool, lost)))


def _turned(track: Track, wheels: FloatArray, wanted: FloatArray, way: FloatArray) -> FloatArray:
    """Return the angles to which front wheels turn while their axle goes ``way`` [m]: as the vehicle steers, and as fast."""
    change = track.rate * way * np.cos(wheels)
    kappa = np.tan(np.clip(wanted, -track.most, track.most)) / track.wheelbase
    before = np.tan(wheels) / track.wheelbase
    return np.arctan(track.wheelbase * np.clip(kappa, before - change, before + change))


@dataclass(frozen=True)
class ClosedLoop:
    """What one follower drove along a path, and what was judged of each run: None where it lost the path, or cannot be judged."""

    settings: LoopSettings
    driven: Driven
    results: tuple[Result | None, ...]

    def __repr__(self) -> str:
        """Return one line, for a notebook."""
        return f"<{type(self).__name__}: {loop_text(self)}>"

    @cached_property
    def verdicts(self) -> tuple[Verdict | None, ...]:
        """The verdict on each run."""
        return tuple(None if result is None else verdict_of(result) for result in self.results)

    @property
    def fits(self) -> bool | None:
        """Whether all runs keep the street; None on a road without limits, unless a run lost the path."""
        fits = [verdict is not None and verdict.fits for verdict in self.verdicts]
        return False if False in fits else None if None in fits else True

    @property
    def kept(self) -> int:
        """How many runs keep the street."""
        return sum(verdict is not None and verdict.fits is not False for verdict in self.verdicts)

    @property
    def worst(self) -> int:
        """The number, from 1, of the run with the least room to spare; without limits of that with the largest error."""

        def rank(run: int) -> tuple[float, float]:
            verdict = self.verdicts[run - 1]
            spare = -np.inf if verdict is None else np.inf if verdict.spare is None else verdict.spare
            return spare, -self.driven.error(run)

        return min(range(1, len(self.results) + 1), key=rank)

    @property
    def frame(self) -> pd.DataFrame:
        """A row for each run: gain, error and tracking length [m], whether it fits, the least room and where, whether it lost the path."""
        gains, rows = self.settings.gains, []
        for run, verdict in enumerate(self.verdicts, start=1):
            fits, *place = (False, None, None, None) if verdict is None else (verdict.fits, verdict.spare, verdict.s, verdict.side)
            rows.append((run, gains[run - 1], self.driven.error(run), self.driven.length(run), fits, *place, self.driven.lost[run - 1]))
        return pd.DataFrame(rows, columns=["run", "gain", "error_m", "length_m", "fits", "spare_m", "s_m", "side", "lost"])


def loop_text(loop: ClosedLoop) -> str:
    """Return the answer in one sentence: how many runs keep the street, what the worst one leaves and where, and how far they stray."""
    runs, driven, worst, verdict = len(loop.results), loop.driven, loop.worst, loop.verdicts[loop.worst - 1]
    errors = [driven.error(run) for run, lost in enumerate(driven.lost, start=1) if not lost]
    strays = f"the front axle strays by {np.median(errors):.2f} m in the median run, by {max(errors):.2f} m at most" if errors else ""
    losing = f"{sum(driven.lost)} lose the path: they were {_LOST_M:.0f} m beside it or turned by 90 degrees" if any(driven.lost) else ""
    if loop.fits is None:
        return f"in a closed loop, {runs} runs: {strays}"
    found = f"in a closed loop {loop.kept} of {runs} runs keep the street"
    if verdict is not None and verdict.spare is not None:
        room = room_text(verdict.spare, fits=verdict.fits is not False)
        found = f"{found}; run {worst} is the worst, {room} ({verdict.side}, s = {verdict.s:z.1f} m)"
    elif not driven.lost[worst - 1]:
        found = f"{found}; run {worst} cannot be judged: it leaves the road"
    return "; ".join(filter(None, (found, losing, strays)))


def loop_json(loop: ClosedLoop) -> dict[str, object]:
    """Return the answer, begun by its word where there are limits, and the worst run, under the names that other programs read."""
    text, worst = loop_text(loop), loop.frame.astype(object).where(loop.frame.notna(), None).iloc[loop.worst - 1].to_dict()
    told = text if loop.fits is None else worded(word_of(loop.fits), text)
    found = {"text": told, "fits": loop.fits, "runs": len(loop.results), "kept": None if loop.fits is None else loop.kept, "worst": worst}
    return found | {"settings": asdict(loop.settings)}


def closed_loop(result: Result, follower: str | Follower = "driver", settings: LoopSettings | None = None) -> ClosedLoop:
    """Follow the path of a planned or judged drive in a closed loop, and judge every run in the street, without clearance.

    ``follower`` is driver, pure-pursuit, stanley, ``package.module:name``, ``file.py:name`` or a function, which is called every 0.05 s::

        def steer(track: Track, seen: Seen) -> FloatArray:  # the front wheels' angles, left positive, (runs,) [rad]
            return track.at(track.wheels, seen.way) - seen.askew - np.arctan(0.5 * seen.offset / seen.speed)

    All runs are driven side by side. They begin on the path; what is seen of the place is noisy. The wheels do what is wanted after the
    delay, times a gain, with noise, as far and as fast as the vehicle steers. Noise has the deviations that ``LoopSettings`` says,
    correlated over 2 s (offset), 1 s (heading) and 0.5 s (wheels).

    Raises:
        OptionError: no such follower, or it raises, or returns what is no angle for each run.

    """
    of_kind("result", result, Result, "hdvplan.plan(case) returns one")
    settings = settings or LoopSettings()
    case = replace(result.case, settings=replace(result.case.settings, clearance=0.0, tracking_error=0.0))
    track = Track.of(result.drive, settings.speed / KM_H, settings.sideways)
    driven = followed_by(track, follower_named(follower), settings)

    def judged(run: int) -> Result | None:
        try:
            return None if driven.lost[run - 1] else api.judge(case, driven.path(run))
        except HdvplanError:  # it left the road, or steered beyond what is a path: no run to be judged
            return None

    return ClosedLoop(settings, driven, tuple(judged(run) for run in range(1, len(driven.lost) + 1)))
