"""One long road planned by several processes: the same files, and one line where a process is killed."""

from __future__ import annotations

import json
import multiprocessing as mp
import os
import signal
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from hdvplan.case import Case
from hdvplan.errors import HdvplanError
from hdvplan.machine import THREADS
from hdvplan.planning.settings import PlannerSettings
from hdvplan.stretches.cutting import reach_of, stretches_of_line, stretches_of_road
from hdvplan.stretches.planning import plan_in_stretches
from hdvplan.stretches.processes import processes
from hdvplan.vehicle.load import load_vehicle
from tests.cli.conftest import Cli
from tests.stretches.lanes import lane_with_a_post
from tests.stretches.test_cutting import ROAD, case_on

FILES = ("path.csv", "envelope.csv", "profile.csv", "swept.geojson", "regions.json")


@pytest.fixture(autouse=True)
def _threads_stay_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.setenv(name, os.environ.get(name, "1"))


@pytest.mark.slow
def test_processes_smooth_and_plan_the_same_as_this_process(tmp_path: Path) -> None:
    line, bus = lane_with_a_post(tmp_path), load_vehicle("bus")
    cut = partial(stretches_of_line, line, partial(Case, vehicle=bus), reach=reach_of(bus, PlannerSettings()), core=500.0)
    alone = plan_in_stretches(cut(), tmp_path / "one")
    with processes(2) as each:
        beside = plan_in_stretches(cut(each=each), tmp_path / "two", each=each)
    for name in FILES:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    digests = [json.loads((tmp_path / name / "run.json").read_bytes())["stretches"]["digest"] for name in ("one", "two")]
    assert digests[0] == digests[1]  # of all that was planned
    assert [near["name"] for near in beside["obstacles"]] == ["post"]
    assert alone["stretches"] == {"count": 4, "processes": 1, "apart_m": beside["stretches"]["apart_m"]}
    measured = {"time_ms": None, "stretches": None}
    assert alone | measured == beside | measured


def test_one_process_is_this_one() -> None:
    with processes(1) as each:
        assert each is map


def _killed(_: object) -> Any:  # noqa: ANN401 - it never returns
    os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
def test_a_process_that_is_killed_is_an_error_with_a_hint() -> None:
    with pytest.raises(HdvplanError, match="ended before it was done") as caught, processes(2) as each:
        list(each(_killed, stretches_of_road(case_on(), core=300.0)))
    assert "--workers" in str(caught.value.hint)


def test_no_process_is_refused(cli: Cli) -> None:
    outcome = cli("plan", ROAD, "--vehicle", "bus", "--workers", "0")
    assert (outcome.code, outcome.err.splitlines()[0]) == (2, "error: --workers must be a positive number, not 0")


def _left_early(error: BaseException | type[BaseException]) -> None:
    with processes(2) as each:
        for _ in each(time.sleep, [0.0, 600.0, 600.0]):
            raise error


@pytest.mark.slow
@pytest.mark.parametrize("error", [KeyboardInterrupt, SystemExit, HdvplanError("no plan")])
def test_nobody_waits_for_what_is_under_way_once_it_is_over(error: BaseException | type[BaseException]) -> None:
    before = set(mp.active_children())
    began = time.monotonic()
    with pytest.raises((KeyboardInterrupt, SystemExit, HdvplanError)):
        _left_early(error)
    assert time.monotonic() - began < 60.0  # takes as long as processes need to start: seconds, where the machine has other work more
    while set(mp.active_children()) != before and time.monotonic() - began < 60.0:
        time.sleep(0.05)  # they are dead; a thread of the executor may be about to note it
    assert set(mp.active_children()) == before


def test_more_processes_than_any_machine_has_cores_are_refused(cli: Cli) -> None:
    for command in (("plan", ROAD, "--vehicle", "bus"), ("study", "study.toml", "--out", "out")):
        outcome = cli(*command, "--workers", "100000")
        assert (outcome.code, outcome.err.splitlines()[0]) == (2, "error: --workers must be at most 1000, not 100000")
