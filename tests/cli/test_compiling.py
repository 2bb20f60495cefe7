"""What a first run shows while kernels compile."""

from __future__ import annotations

import os
import re
import sys
from itertools import pairwise
from pathlib import Path

import numba
import pytest
from numba.core import event
from rich.progress import Progress

from hdvplan.cli.compiling import ABOUT, compilation_shown
from hdvplan.road.path import evaluate


def foreign() -> None:
    """Stand for a kernel of somebody else."""


def test_kernels_are_counted_as_they_compile_and_others_are_not() -> None:
    bar = Progress(disable=True)
    with compilation_shown(bar):
        (task,) = bar.tasks
        assert not task.visible
        with event.trigger_event("numba:compile", data={"dispatcher": numba.njit(foreign)}):
            pass
        assert not task.visible
        for _ in range(ABOUT + 1):
            with event.trigger_event("numba:compile", data={"dispatcher": evaluate}):
                assert task.visible
        assert task.description == f"compiling, once per installation: {ABOUT + 1} of about {ABOUT + 1} kernels"
        assert (task.completed, task.total) == (ABOUT + 1, ABOUT + 1)
    with event.trigger_event("numba:compile", data={"dispatcher": evaluate}):
        assert task.completed == ABOUT + 1  # nobody listens any more


@pytest.mark.slow  # compiles everything: half a minute
def test_a_first_run_counts_its_kernels_at_a_terminal(tmp_path: Path) -> None:
    if sys.platform == "win32":
        pytest.skip("needs pseudo-terminals")
    from tests.cli.test_terminal import CODES, at_a_terminal  # noqa: PLC0415 - see above

    arguments = ("plan", "uturn", "--vehicle", "bus", "--no-plot", "--horizon", "50")
    seen = CODES.sub("", at_a_terminal(tmp_path, *arguments, NUMBA_CACHE_DIR=os.fspath(tmp_path / "cache")))
    counts = [int(number) for number in re.findall(r"compiling, once\s+per\s+installation: (\d+) of", seen)]
    falls = sum(later < earlier for earlier, later in pairwise(counts))
    assert falls <= 1  # a bar while the road is read, and one while it is planned, each counts its own
    assert max(counts) == pytest.approx(ABOUT, rel=0.3)  # what "about" may mean
    again = CODES.sub("", at_a_terminal(tmp_path, *arguments, NUMBA_CACHE_DIR=os.fspath(tmp_path / "cache")))
    assert "compiling" not in again
