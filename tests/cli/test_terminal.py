"""What a person at a terminal sees."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest

from hdvplan.cli.console import progress

pty = pytest.importorskip("pty", reason="needs pseudo-terminals")

CODES = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
COLOURS = re.compile(r"\x1b\[[0-9;]*3[0-7][0-9;]*m")


def at_a_terminal(folder: Path, *arguments: str, **environment: str) -> str:
    """Return everything that a terminal of 80 columns receives from a command."""
    settings = os.environ | {"TERM": "xterm-256color", "COLUMNS": "80", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))} | environment
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(folder)
        os.execve(sys.executable, [sys.executable, "-m", "hdvplan", *arguments], settings)  # noqa: S606 - our own
    chunks = []
    while True:
        try:
            chunk = os.read(terminal, 65536)
        except OSError:  # how Linux says that the other end has closed
            break
        if not chunk:
            break
        chunks.append(chunk)
    os.waitpid(child, 0)
    os.close(terminal)
    return b"".join(chunks).decode()


@pytest.mark.slow
def test_a_terminal_gets_progress_with_the_time_left_and_no_colour_if_it_asks_for_none(tmp_path: Path) -> None:
    arguments = ("plan", "sturn", "--vehicle", "bus", "--no-plot", "--horizon", "50")
    coloured, plain = at_a_terminal(tmp_path, *arguments), at_a_terminal(tmp_path, *arguments, NO_COLOR="1")
    assert COLOURS.search(coloured)
    assert not COLOURS.search(plain)
    for seen in (coloured, plain):
        assert re.search(r"planning bus along sturn \S+ +\d+% \d:\d\d:\d\d", CODES.sub("", seen))
        assert "expected half width" in seen


def test_without_a_terminal_a_line_every_ten_seconds_has_the_time_left(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("hdvplan.cli.console._TELL_S", 10.0)
    seconds = iter([0.0, 4.0, 11.0, 13.0, 90.0])
    monkeypatch.setattr("hdvplan.cli.console.monotonic", lambda: next(seconds))
    with progress("planning 8 cells", quiet=False) as tell:
        for share in (0.25, 0.5, 0.5, 0.75):  # an earlier run has done a quarter
            tell(share)
    assert capsys.readouterr() == ("", "planning 8 cells: 50 %, about 14 s left\nplanning 8 cells: 75 %, about 1 min left\n")


def test_who_wants_silence_gets_it_without_a_terminal_too(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setattr("hdvplan.cli.console._TELL_S", 0.0)
    with progress("planning", quiet=True) as tell:
        tell(0.0)
        tell(0.5)
    assert capsys.readouterr() == ("", "")
