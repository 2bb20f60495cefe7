"""Benchmarks small enough for a test: a road of 60 m, a horizon of 30 m."""

from __future__ import annotations

import subprocess
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hdvplan.bench.comparing.processes import Scratch, scratch_folder
from hdvplan.bench.measuring.samples import NUMBERS, OK, Judgement, Measurement
from hdvplan.bench.suite import Suite
from hdvplan.cli.app import run
from hdvplan.machine import use_one_thread
from tests.cli.conftest import Cli, cli

__all__ = ["Cli", "cli"]
TINY = ("--in-process", "--horizon", "30", "--rounds", "2", "--solvers", "riccati,piqp", "--vehicles", "bus")


@pytest.fixture(autouse=True)
def _threads_stay_as_they_were(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "RAYON_NUM_THREADS"):
        monkeypatch.setenv(name, "1")
    assert use_one_thread()


@pytest.fixture
def short_road(tmp_path: Path) -> str:
    """Return a road of 60 m with a left bend."""
    (tmp_path / "short.csv").write_text("s,kappa\n0,0\n20,0\n30,0.03\n40,0\n60,0\n", encoding="utf-8")
    return str(tmp_path / "short.csv")


@pytest.fixture
def tiny(short_road: str) -> Suite:
    return Suite(roads=(short_road,), vehicles=("bus",), solvers=("riccati", "piqp"), rounds=2, horizon=30.0)


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a finished benchmark of two cells and three rounds; copy it before you change it."""
    folder = tmp_path_factory.mktemp("finished")
    (folder / "short.csv").write_text("s,kappa\n0,0\n20,0\n30,0.03\n40,0\n60,0\n", encoding="utf-8")
    command = ("bench", "--roads", str(folder / "short.csv"), *TINY, "--rounds", "3", "--schemes", "rti", "--quiet")
    assert run([*command, "--out", str(folder / "out")]) == 0
    return folder / "out"


@pytest.fixture
def scratch() -> Iterator[Scratch]:
    with scratch_folder() as made:
        yield made


def git(folder: Path, *arguments: str) -> str:
    """Return what git says in a folder, as somebody."""
    command = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@example.org", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()  # noqa: S603 - fixed


def made_up(
    seconds: list[float], *, iterations: int = 1, usable: bool = True, outcome: str = OK, message: str = "", shift: float | None = 0.0
) -> Measurement:
    """Return a measurement of given total times [s]; ``shift`` moves the executed path and envelope, None: there is none."""
    steps = np.zeros((len(seconds), len(NUMBERS)))
    steps[:, 4] = seconds
    steps[:, 0] = 0.5 * np.array(seconds)
    steps[:, 5:7], steps[:, 7], steps[:, 8] = [1, iterations], usable, 1e-9
    steps[:, NUMBERS.index("cpu_s")] = seconds
    steps[:, NUMBERS.index("outer_s")] = seconds
    line = np.zeros(5)
    judged = Judgement(2.0, 1.5, 0.1, 2.1, np.nan, 0.0, line, line + 2.0, line - 1.5)
    if shift is not None:
        judged = replace(judged, e_y=line + shift, left=line + 2.0 + shift)
    return Measurement(steps, ("solved",) * len(seconds), outcome, message, 100, None if shift is None else judged)
