"""A path in a closed loop: what theory says of followers without noise, runs that are judged, followers of one's own."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import hdvplan
from hdvplan.arrays import FloatArray
from hdvplan.driving.given import GivenPath
from hdvplan.errors import OptionError
from hdvplan.judging.result import Result
from hdvplan.judging.straying import SPACING_M
from hdvplan.loop import LoopSettings
from hdvplan.loop.closed import STEP_S, ClosedLoop, closed_loop
from hdvplan.loop.track import Seen, Track, follower_named

_EXACT = LoopSettings(delay=0.0, gain_error=0.0, noise=0.0, runs=1)
_MISSED_M = {"driver": 0.1, "stanley": 0.02}  # the driver lets 0.1 m pass; steps of 0.05 s on a bend that changes


def result_on(folder: Path, rows: str, vehicle: str = "bus", reach: float | None = 4.0) -> Result:
    """Return the drive along the line of a road itself, judged."""
    (folder / "line.csv").write_text(f"s,kappa\n{rows}\n", encoding="utf-8")
    road = hdvplan.load_road(folder / "line.csv")
    road = road if reach is None else road.with_limits(reach, reach)
    s = np.arange(0.0, road.path.length, 0.25)
    at = road.path.at(s)
    return hdvplan.judge(hdvplan.Case(road, hdvplan.load_vehicle(vehicle)), GivenPath(np.column_stack([at.x, at.y]), at.heading))


@pytest.fixture
def bend(tmp_path: Path) -> Result:
    """Return a drive round a bend to the left."""
    return result_on(tmp_path, "0,0\n30,0\n50,0.04\n70,0.04\n90,0\n130,0")


@pytest.fixture
def circle(tmp_path: Path) -> Result:
    """Return a drive round a circle to the left, nearly twice."""
    return result_on(tmp_path, "0,0.04\n300,0.04")


@pytest.mark.parametrize("follower", ["driver", "stanley"])
@pytest.mark.parametrize("vehicle", ["bus", "tractor-trailer"])
def test_a_follower_that_knows_the_path_drives_it_where_nothing_errs(tmp_path: Path, follower: str, vehicle: str) -> None:
    result = result_on(tmp_path, "0,0\n30,0\n50,0.04\n70,0.04\n90,0\n130,0", vehicle)
    loop = closed_loop(result, follower, _EXACT)
    assert loop.driven.error(1) < _MISSED_M[follower]
    assert repr(loop).startswith("<ClosedLoop: in a closed loop ")  # what a notebook shows
    assert loop.verdicts[0] is not None
    assert loop.verdicts[0].spare == pytest.approx(
        result.balance.min_clearance, abs=1.2 * _MISSED_M[follower]
    )  # the rear corner strays by a fifth more


@pytest.mark.parametrize("follower", ["driver", "pure-pursuit", "stanley"])
@pytest.mark.parametrize("road", ["bend", "circle"])
def test_a_path_is_followed_to_its_end(request: pytest.FixtureRequest, road: str, follower: str) -> None:
    """The last 15 m were left out, and what was too narrow there was kept by all runs."""
    result = request.getfixturevalue(road)
    loop = closed_loop(result, follower, _EXACT)
    front = loop.driven.way[np.isfinite(loop.driven.offset[:, 0]), 0]
    whole = Track.of(result.drive, 30.0 / 3.6, 1.0).length
    assert whole == pytest.approx(result.drive.road.path.length, rel=0.1)  # of the front axle, which runs outside the rear one
    assert whole - front[-1] < 0.5  # a step
    assert np.all(np.abs(loop.driven.offset[np.isfinite(loop.driven.offset[:, 0]), 0][-40:]) < 0.6)  # nor does it leave it there


def test_a_driver_who_knows_the_delay_looks_past_it_and_a_controller_does_not(bend: Result) -> None:
    late = replace(_EXACT, delay=6 * STEP_S)
    assert closed_loop(bend, "driver", late).driven.error(1) < _MISSED_M["driver"]  # as without: the wheels turn at the right place
    assert closed_loop(bend, "stanley", late).driven.error(1) > 10 * _MISSED_M["stanley"]


@pytest.mark.parametrize("gain", [0.9, 1.1])
def test_a_wrong_gain_leaves_stanley_the_offset_that_its_law_says(circle: Result, gain: float) -> None:
    loop = closed_loop(circle, "stanley", replace(_EXACT, gain_error=abs(gain - 1.0)))
    run = 0 if gain < 1.0 else 2
    offset = loop.driven.offset[np.isfinite(loop.driven.offset[:, run]), run][-100:].mean()
    track = Track.of(circle.drive, 30.0 / 3.6, 1.0)
    speed, radius = track.speed[len(track.speed) // 2], SPACING_M / np.diff(track.course).mean()
    # on a circle the angle is gain (angle - arctan(k e / v)): the front axle runs e inside, on a circle of which it has the angle
    angle = np.arcsin(track.wheelbase / (radius - offset))
    assert np.arctan(0.8 * offset / speed) == pytest.approx(angle * (1.0 - 1.0 / gain), abs=1e-3)


@pytest.mark.slow
def test_runs_are_those_of_their_seed_and_their_gain(bend: Result) -> None:
    first, again = (closed_loop(bend, settings=LoopSettings(seed=3)) for _ in range(2))
    assert first.frame.equals(again.frame)
    assert list(first.frame["gain"]) == pytest.approx(np.tile([0.9, 1.0, 1.1], 4))
    assert first.frame["error_m"].nunique() == len(first.frame)
    assert not first.frame.equals(closed_loop(bend, settings=LoopSettings(seed=4)).frame)


def test_more_runs_come_behind_fewer_so_that_the_worst_one_only_gets_worse(bend: Result) -> None:
    few, many = (closed_loop(bend, settings=LoopSettings(runs=runs)).frame for runs in (1, 2))
    for name in ("gain", "error_m", "spare_m"):  # to rounding, of which vectors of other lengths may have another
        assert list(many[name][: len(few)]) == pytest.approx(list(few[name]), abs=1e-9)


def test_the_worst_run_is_the_one_with_the_least_room_and_none_of_it_is_clearance(bend: Result) -> None:
    asked = replace(bend, case=replace(bend.case, settings=replace(bend.case.settings, clearance=5.0)))
    loop = closed_loop(asked)
    assert loop.fits
    assert loop.worst == loop.frame.set_index("run")["spare_m"].idxmin()
    assert f"run {loop.worst} is the worst" in repr(loop)
    assert loop.driven.error(loop.worst) == loop.frame.set_index("run")["error_m"][loop.worst]


def away(track: Track, seen: Seen) -> FloatArray:
    """Turn right, for ever."""
    return np.full_like(seen.way, -track.most)


def test_wheels_turn_no_faster_than_the_vehicle_steers(bend: Result) -> None:
    def dithering(track: Track, seen: Seen) -> FloatArray:
        return track.at(track.wheels, seen.way) + (0.3 if round(seen.time / seen.step) % 2 else -0.3)

    driven = closed_loop(bend, dithering, _EXACT).driven
    frame, wheelbase = driven.frame(1), bend.drive.vehicle.lead.wheelbase
    rear = np.hypot(np.diff(frame["x"]), np.diff(frame["y"]))
    rate = np.abs(np.diff(np.tan(frame["wheels"].to_numpy()) / wheelbase)) / rear
    assert rate.max() == pytest.approx(
        bend.drive.vehicle.max_curvature_rate, rel=0.05
    )  # its way is that with the angle before, up to 0.3 rad away


def test_noise_has_its_deviation_from_the_first_step_on(bend: Result) -> None:
    first: list[FloatArray] = []

    def watching(_track: Track, seen: Seen) -> FloatArray:
        first.append(seen.offset)
        return broken(_track, seen)

    with pytest.raises(OptionError, match="no idea"):
        closed_loop(bend, watching, LoopSettings(runs=100))
    assert first[0].std() == pytest.approx(0.05, rel=0.15)  # of 300 numbers: a deviation's own is 4 %


def scalar(_track: Track, _seen: Seen) -> float:
    """Return no angle for each run."""
    return 0.0


def broken(_track: Track, _seen: Seen) -> FloatArray:
    """Fail."""
    msg = "no idea"
    raise ValueError(msg)


def test_a_run_that_loses_the_path_is_no_run_that_fits(bend: Result, tmp_path: Path) -> None:
    lost: ClosedLoop = closed_loop(bend, away, _EXACT)
    assert lost.fits is False
    assert lost.results == (None,) * 3
    assert lost.frame["spare_m"].isna().all()
    free = result_on(tmp_path, "0,0\n130,0", reach=None)
    assert closed_loop(free, away, _EXACT).fits is False
    assert closed_loop(free, "driver", _EXACT).fits is None


def test_what_a_follower_of_one_s_own_does_wrong_is_one_line(bend: Result) -> None:
    with pytest.raises(
        OptionError, match=re.escape("follower 'tests.loop.test_closed:broken' raises ValueError: no idea (test_closed.py, line ")
    ):
        closed_loop(bend, broken, _EXACT)
    with pytest.raises(
        OptionError, match=r"follower 'tests.loop.test_closed:scalar' returns an array that cannot be steered by\nhint: one finite angle"
    ):
        closed_loop(bend, scalar, _EXACT)  # type: ignore[arg-type] # what is to be refused
    with pytest.raises(OptionError, match=r"unknown follower 'stanly'\nhint: did you mean"):
        follower_named("stanly")
