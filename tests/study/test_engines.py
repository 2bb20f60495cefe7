"""Processes that plan: killed, hanging and failing ones cost their cell at most, and all engines give the same."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import CancelledError, Future
from pathlib import Path

import pandas as pd
import pytest

import hdvplan.study
from hdvplan.errors import HdvplanError, OptionError
from hdvplan.study import work
from hdvplan.study.cells import Cell, cells_of
from hdvplan.study.conduct import run
from hdvplan.study.engine import FAILED, KILLED, PLANNED, Outcome, _Queue, ended, run_in
from hdvplan.study.pools import DaskEngine, LocalEngine, _DaskPool, _within, connected
from hdvplan.study.spec import study_of
from tests.study.conftest import InHere
from tests.study.test_run import exact

FAULTY = """
import ctypes, os, pathlib, signal, time
from hdvplan.solvers.riccati import RiccatiWorkspace

class Killing:
    name, starts_warm = "killing", False
    def __init__(self, shape):
        os.kill(os.getpid(), signal.SIGKILL)

class KillingOnce(RiccatiWorkspace):
    def __init__(self, shape):
        marker = pathlib.Path("killed")
        if not marker.exists():
            marker.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        super().__init__(shape)

class Raising:
    name, starts_warm = "raising", False
    def __init__(self, shape):
        pass
    def solve(self, qp, guess):
        raise RuntimeError("no licence")

class Leaving:
    name, starts_warm = "leaving", False
    def __init__(self, shape):
        ctypes.CDLL(None).exit(0)

class Hanging:
    name, starts_warm = "hanging", False
    def __init__(self, shape):
        time.sleep(3600)
"""
posix = pytest.mark.skipif(sys.platform == "win32", reason="needs signals")


class Scripted:
    """A pool whose cells end as they are told to, attempt by attempt; ``breaks`` is how often it breaks before that."""

    width = 2

    def __init__(self, endings: Iterable[str], breaks: int = 0) -> None:
        """Begin with the first ending."""
        self._endings, self._breaks, self._broken = iter(endings), breaks, False
        self.submitted: list[str] = []

    def submit(self, cell: Cell) -> Future[Outcome]:
        """End the cell as the next ending says; an error is one of the pool's."""
        self.submitted.append(cell.key)
        future: Future[Outcome] = Future()
        if self._breaks:
            self._broken = True
            return future
        ending = next(self._endings)
        if ending == "cancelled":
            future.cancel()
            future.set_running_or_notify_cancel()  # as Dask does it
        elif ending == "error":
            future.set_exception(OSError("gone"))
        else:
            future.set_result(Outcome({"outcome": ending}))
        return future

    def outcome_of(self, error: BaseException) -> Outcome:
        """Take every error for a killed process."""
        return ended(KILLED, str(error))

    def renewed(self) -> bool:
        """Mend what broke."""
        if not self._broken:
            return False
        self._breaks, self._broken = self._breaks - 1, False
        return True


def _cells(folder: Path, count: int) -> list[Cell]:
    widths = [2.0 + 0.1 * number for number in range(count)]
    return list(cells_of(study_of({"roads": ["bend.csv"], "vehicles": ["bus"], "half_widths": widths}, folder)))


def test_a_cell_that_is_not_answered_is_tried_again_as_often_as_allowed(folder: Path) -> None:
    (cell,) = _cells(folder, 1)
    (mended,) = run_in(Scripted(["error", PLANNED]), [cell], retries=1)
    assert (mended.outcome.ending, mended.attempts) == (PLANNED, 2)
    (given_up,) = run_in(Scripted(["error", FAILED, "error"]), [cell], retries=2)
    assert (given_up.outcome.row, given_up.attempts) == ({"outcome": KILLED, "reason": "gone"}, 3)
    (cancelled,) = run_in(Scripted(["cancelled"]), [cell], retries=0)
    assert cancelled.outcome.ending == KILLED
    (refused,) = run_in(Scripted(["refused"]), [cell], retries=5)
    assert refused.attempts == 1


def test_cells_that_were_under_way_when_a_pool_broke_run_once_more_without_blame(folder: Path) -> None:
    cells, pool = _cells(folder, 3), Scripted([PLANNED] * 3, breaks=1)
    done = list(run_in(pool, cells, retries=0))
    assert {one.cell.key for one in done} == {cell.key for cell in cells}
    assert {one.attempts for one in done} == {1}
    assert len(pool.submitted) == 4  # the first one twice


def test_a_pool_that_breaks_for_ever_is_an_error(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.study.engine._LOOK_S", 0.01)
    with pytest.raises(HdvplanError, match="before any cell did"):
        list(run_in(Scripted([], breaks=100), _cells(folder, 1), retries=1))


@pytest.mark.slow
@posix
def test_killed_and_hanging_processes_cost_their_cell_and_no_other(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    Path("faulty.py").write_text(FAULTY, encoding="utf-8")
    entries = {
        "roads": ["bend.csv"],
        "vehicles": ["bus"],
        "half_widths": [3.0, 3.5],
        "solvers": ["riccati", "faulty.py:Killing", "faulty.py:KillingOnce", "faulty.py:Hanging", "faulty.py:Leaving"],
        "settings": {"horizon": 30},
    }
    results = run(study_of(entries), "out", LocalEngine(workers=2, limit=8.0, retries=1))
    table = results.cells()
    ends = table.groupby("outcome")["solver"].unique()
    assert sorted(ends["planned"]) == ["faulty.py:KillingOnce", "riccati"]
    assert sorted(ends["killed"]) == ["faulty.py:Killing", "faulty.py:Leaving"]
    assert list(ends["hung"]) == ["faulty.py:Hanging"]
    reasons = table.groupby("outcome")["reason"].unique()
    assert sorted(reasons["killed"]) == ["its process ended with SIGKILL", "its process ended with code 1"]
    assert list(reasons["hung"]) == ["it took longer than 8 s"]
    assert table[table["solver"] == "faulty.py:KillingOnce"]["parallel_attempts"].sum() == 3
    assert results.unanswered == 6


@pytest.mark.slow
def test_processes_give_what_this_process_gives(folder: Path, tiny: dict[str, object]) -> None:
    here = run(study_of(tiny, folder), folder / "here", InHere())
    for workers in (1, 2):
        there = run(study_of(tiny, folder), folder / f"there{workers}", LocalEngine(workers))
        pd.testing.assert_frame_equal(exact(here.cells()), exact(there.cells()))
        pd.testing.assert_frame_equal(here.places(), there.places())
        pd.testing.assert_frame_equal(here.ranking(), there.ranking())


@pytest.mark.slow
@pytest.mark.filterwarnings("default")  # Dask's own
def test_a_dask_cluster_gives_what_this_process_gives(folder: Path, tiny: dict[str, object]) -> None:
    distributed = pytest.importorskip("distributed")
    here = run(study_of(tiny, folder), folder / "here", InHere())
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        there = run(study_of(tiny, folder), folder / "there", connected(client))
    pd.testing.assert_frame_equal(exact(here.cells()), exact(there.cells()))
    pd.testing.assert_frame_equal(here.places(), there.places())


def test_a_cluster_without_dask_is_refused_in_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(OptionError, match="needs Dask, which is not installed") as caught:
        connected("tcp://127.0.0.1:1")
    assert "hdvplan[dask]" in str(caught.value.hint)


@pytest.mark.parametrize("missing", ["pebble", "pyarrow"])
def test_a_study_without_its_extra_is_refused_in_one_line(missing: str, tmp_path: Path) -> None:
    (tmp_path / "lines.toml").write_text('roads = ["uturn"]\nvehicles = ["bus"]\n', encoding="utf-8")
    study = "run(['study', 'lines.toml', '--out', 'out'])"
    program = f"import sys; sys.modules['{missing}'] = None; from hdvplan.cli.app import run; sys.exit({study})"
    command = [sys.executable, "-c", program]
    ended = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)  # noqa: S603 - ours
    assert (ended.returncode, ended.stdout) == (2, "")
    assert f"a study needs {missing}, which is not installed" in ended.stderr
    assert "pip install pebble pyarrow" in ended.stderr


def test_any_other_module_that_is_missing_is_no_matter_of_the_extra(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(_: str) -> None:
        raise ModuleNotFoundError(name="numexpr")

    monkeypatch.setattr(hdvplan.study, "import_module", missing)
    with pytest.raises(ModuleNotFoundError):
        hdvplan.study.LocalEngine  # noqa: B018 - loads it


class Gone:
    """A client of a Dask cluster whose scheduler has ended."""

    def get_executor(self, **_: object) -> None:
        """Give nothing to hand cells to."""

    def nthreads(self) -> dict[str, int]:
        """Find nobody who knows."""
        msg = "in <Client>: Stream is closed"
        raise OSError(msg)


def test_a_scheduler_that_ends_is_one_line_that_says_how_to_go_on(folder: Path) -> None:
    with pytest.raises(HdvplanError, match="the Dask scheduler does not answer any more: OSError: in <Client>") as caught:
        list(DaskEngine(Gone()).run(_cells(folder, 1)))
    assert "continues with the cells that are missing" in str(caught.value.hint)
    given_up = _DaskPool(Gone(), 60.0).outcome_of(CancelledError())
    assert given_up.ending == KILLED
    assert "somebody cancelled it" in str(given_up.row["reason"])


def test_a_worker_with_another_version_answers_no_cell(folder: Path) -> None:
    (cell,) = _cells(folder, 1)
    outcome = _within(cell, 60.0, "another source")
    assert outcome.ending == FAILED
    assert "another version of hdvplan" in str(outcome.row["reason"])


def test_the_first_cell_of_a_road_goes_alone_and_the_others_wait_for_it(folder: Path) -> None:
    entries = {"roads": ["bend.csv", "lane.geojson"], "vehicles": ["bus"], "half_widths": [3.0, 3.1, 3.2]}
    cells = list(cells_of(study_of(entries, folder)))
    queue = _Queue(cells)
    assert [queue.take(), queue.take(), queue.take()] == [(cells[0], 1), (cells[3], 1), None]
    queue.again(cells[0], 2)  # its process was killed: the others still wait
    assert [queue.take(), queue.take()] == [(cells[0], 2), None]
    queue.ended(cells[0])
    assert [queue.take(), queue.take(), queue.take()] == [(cells[1], 1), (cells[2], 1), None]
    queue.ended(cells[3])
    assert [queue.take(), queue.take(), queue.take()] == [(cells[4], 1), (cells[5], 1), None]
    assert queue.empty


def test_cells_wait_for_their_road_only_so_long(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    cells = _cells(folder, 3)
    queue = _Queue(cells)
    assert [queue.take(), queue.take()] == [(cells[0], 1), None]
    monkeypatch.setattr("hdvplan.study.engine._PATIENCE_S", -1.0)  # it has passed
    assert [queue.take(), queue.take()] == [(cells[1], 1), (cells[2], 1)]
    queue.ended(cells[0])
    assert queue.take() is None
    assert queue.empty


def test_a_smoothed_road_is_kept_for_other_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work, "_folder", lambda _: tmp_path)
    monkeypatch.setattr(work, "KEPT_ROADS", 2)
    made: list[str] = []

    def make(name: str) -> str:
        made.append(name)
        return name.upper()

    for name in ("a", "a", "b", "c"):
        assert work.spooled(name, lambda name=name: make(name)) == name.upper()  # type: ignore[misc] # a lambda's default
        time.sleep(0.02)  # files differ in age
    assert made == ["a", "b", "c"]
    assert len(list(tmp_path.iterdir())) == 2  # the newest
    newest = max(tmp_path.iterdir(), key=lambda path: path.stat().st_mtime)
    newest.write_bytes(newest.read_bytes()[:-1])  # what a crash of the machine may leave
    assert work.spooled("c", lambda: make("c")) == "C"
    assert made == ["a", "b", "c", "c"]
    monkeypatch.setattr(work, "_folder", lambda _: None)
    assert work.spooled("a", lambda: make("a")) == "A"
