"""One long road planned by several processes: the same files, and one line where a process is killed."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest

from hdvplan.errors import HdvplanError
from hdvplan.machine import THREADS
from hdvplan.stretches.cutting import stretches_of_road
from hdvplan.stretches.planning import plan_in_stretches
from hdvplan.stretches.processes import processes
from tests.cli.conftest import Cli
from tests.stretches.test_cutting import ROAD, case_on

FILES = ("path.csv", "envelope.csv", "profile.csv", "swept.geojson", "regions.json")


@pytest.fixture(autouse=True)
def _threads_stay_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in THREADS:
        monkeypatch.setenv(name, os.environ.get(name, "1"))


@pytest.mark.slow
def test_processes_plan_the_same_as_this_process(tmp_path: Path) -> None:
    case = case_on(half_width=3.5)
    alone = plan_in_stretches(stretches_of_road(case, core=300.0), tmp_path / "one")
    with processes(2) as each:
        beside = plan_in_stretches(stretches_of_road(case, core=300.0), tmp_path / "two", each=each)
    for name in FILES:
        assert (tmp_path / "one" / name).read_bytes() == (tmp_path / "two" / name).read_bytes()
    assert alone["stretches"] == {"count": 6, "processes": 1, "apart_m": beside["stretches"]["apart_m"]}
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
