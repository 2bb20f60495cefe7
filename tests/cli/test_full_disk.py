"""On a disk without room a command leaves the former result or the new one, and says so in a line. Only root can mount such a disk."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from tests.cli.conftest import Cli, small_disk
from tests.fuzz.kills import digests, is_torn
from tests.nightly import nightly

pytestmark = pytest.mark.slow  # every command runs three times
ROOMS_KB = (
    nightly(0),
    24,
    nightly(64),
)  # nothing fits; some files; some results
_STUDY = 'roads = ["short.csv"]\nvehicles = ["bus"]\nhalf_widths = [{}]\n'


def _two(command: str, one: str, other: str) -> tuple[list[str], list[str]]:
    return command.replace("?", one).split(), command.replace("?", other).split()


COMMANDS = {  # each twice: what is there before, and what has no room
    "plan": _two("plan short.csv --vehicle bus --half-width ? --out disk/out", "4", "5"),
    "need": _two("need short.csv --vehicle ? --no-proof --out disk/out", "bus", "rigid-truck"),
    "turn": _two("turn --vehicle bus --radius ? --angle 90 --out disk/out", "15", "16"),
    "study": _two("study ?.toml --workers 1 --out disk/out", "one", "two"),
    "report": _two("report plan --title ? --out disk/page.html", "One", "Two"),
    "bench": _two("bench --roads short.csv --vehicles bus --schemes rti --solvers riccati --rounds 1 --out ?", "elsewhere", "disk/out"),
}
ONE_BY_ONE = {"study", "bench"}  # of the others all files change together


@pytest.fixture
def disk(tmp_path: Path, short_road: str) -> Iterator[Path]:
    """Provide a small disk, and beside it what the commands need."""
    assert short_road == "short.csv"
    for name, widths in (("one", "3.0, 4.0"), ("two", "4.0, 5.0")):
        (tmp_path / f"{name}.toml").write_text(_STUDY.format(widths), encoding="utf-8")
    mounted = tmp_path / "disk"
    mounted.mkdir()
    with small_disk(mounted, "size=8m"):
        yield mounted


@contextmanager
def filled(disk: Path, room_kb: int) -> Iterator[None]:
    """Leave no more room than that."""
    ballast = disk / "ballast"
    with ballast.open("wb") as file:
        os.posix_fallocate(file.fileno(), 0, shutil.disk_usage(disk).free - 1024 * room_kb)
    try:
        yield
    finally:
        ballast.unlink()


@pytest.mark.parametrize("room_kb", ROOMS_KB)
@pytest.mark.parametrize("name", [name if name in {"plan", "study", "bench"} else nightly(name) for name in COMMANDS])
def test_without_room_the_former_result_stays_or_the_new_one_is_there(
    cli: Cli, tmp_path: Path, disk: Path, name: str, room_kb: int
) -> None:
    former, command = COMMANDS[name]
    if name == "report":
        assert cli("plan", "short.csv", "--vehicle", "bus", "--no-plot", "--out", "plan").code == 0
    assert cli(*former).code == 0
    before = digests(disk)
    with filled(disk, room_kb):
        outcome = cli(*command)
        left = {name: digest for name, digest in digests(disk).items() if name != "ballast"}
    assert outcome.code in ({2} if room_kb == 0 else {0, 2}), outcome.err
    errors = [line for line in outcome.err.splitlines() if line.startswith("error:")]
    assert len(errors) == (outcome.code == 2)
    if outcome.code == 2:
        assert "No space left on device" in errors[0]
        assert set(before) <= set(left)
        assert left == before or name in ONE_BY_ONE
    assert not [file for file in left if is_torn(disk / file)]
    assert cli(*command).code == 0  # where there is room again
    assert not [path for path in tmp_path.rglob(".*") if path.is_file()]
