"""Run the command line inside the test's process, in a folder of its own."""

from __future__ import annotations

import subprocess
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import pytest

from hdvplan.cli.app import run


@dataclass(frozen=True)
class Outcome:
    """What a command left: exit code, stdout and stderr."""

    code: int
    out: str
    err: str


Cli = Callable[..., Outcome]


@pytest.fixture
def cli(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Cli:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "80")  # a terminal's: without one tables are not cut
    capsys.readouterr()

    def call(*arguments: str) -> Outcome:
        code = run(arguments)
        captured = capsys.readouterr()
        return Outcome(code, captured.out, captured.err)

    return call


@pytest.fixture
def short_road(tmp_path: Path) -> str:
    """Return a road of 60 m that bends gently: a plan takes a moment."""
    (tmp_path / "short.csv").write_text("s,kappa\n0,0\n20,0\n30,0.03\n40,0\n60,0\n", encoding="utf-8")
    return "short.csv"


@contextmanager
def small_disk(folder: Path, options: str) -> Iterator[None]:
    """Mount a disk of its own at ``folder``."""
    try:
        subprocess.run(["/bin/mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], check=True, capture_output=True)  # noqa: S603 - fixed
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("may not mount a disk")
    try:
        yield
    finally:
        subprocess.run(["/bin/umount", folder], check=True)  # noqa: S603 - fixed
