"""Two processes take turns: strictly one after the other, and never for ever if one ends, knows nothing of turns, or leaves children."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import pytest

from hdvplan.bench import TURNS, turns
from hdvplan.bench.comparing.processes import Scratch, Started, Turns, finish, in_turn, scratch_folder, start, without_imports

ROOT = Path(__file__).parents[2]
pytestmark = pytest.mark.skipif(os.name != "posix", reason="turns are given by descriptors that a process inherits")

# Writes its name at the beginning and end of every turn; the other one must not be between.
DIARY = """
import os, sys, time
from hdvplan.bench import turns
name, diary, count = sys.argv[1], sys.argv[2], int(sys.argv[3])
def note(word):
    with open(diary, "a") as file:
        file.write(f"{name} {word}\\n")
note("loads")
with turns() as take_turn:
    for _ in range(count):
        take_turn()
        note("begins")
        time.sleep(0.01)
        note("ends")
note("leaves")
"""


def started(scratch: Scratch, *arguments: str) -> Started:
    variables = os.environ | {"PYTHONPATH": str(ROOT)}
    return start([sys.executable, "-c", *arguments], variables, scratch, turns=Turns(None))


def diary_of(scratch: Scratch, programs: Sequence[tuple[str, int]]) -> list[str]:
    """Return what two processes wrote, of which each runs a program that wants so many turns."""
    diary = scratch.folder / "diary"
    in_turn(started(scratch, program, name, str(diary), str(count)) for name, (program, count) in zip("ab", programs, strict=True))
    assert [finish(one).code for one in scratch.started] == [0, 0]
    return diary.read_text(encoding="utf-8").splitlines()


def test_both_load_one_after_the_other_and_then_have_turns_in_alternation(scratch: Scratch) -> None:
    lines = diary_of(scratch, [(DIARY, 3), (DIARY, 3)])
    assert lines[:2] == ["a loads", "b loads"]
    assert lines[2:14] == [f"{name} {word}" for _ in range(3) for name in "ab" for word in ("begins", "ends")]
    assert sorted(lines[14:]) == ["a leaves", "b leaves"]  # no earlier than both have had their turns


def test_who_wants_more_turns_has_them_alone_at_the_end(scratch: Scratch) -> None:
    lines = [line for line in diary_of(scratch, [(DIARY, 1), (DIARY, 4)]) if line.split()[1] in {"begins", "ends"}]
    assert lines == ["a begins", "a ends"] + ["b begins", "b ends"] * 4


UNAWARE = """
import sys, time
with open(sys.argv[2], "a") as file:
    for word in ("begins", "ends"):
        file.write(f"{sys.argv[1]} {word}\\n")
        time.sleep(0.05)
"""


@pytest.mark.parametrize("programs", [[UNAWARE, DIARY], [DIARY, UNAWARE], [UNAWARE, UNAWARE]])
def test_a_program_that_knows_nothing_of_turns_runs_before_or_after_the_other(scratch: Scratch, programs: list[str]) -> None:
    lines = [line for line in diary_of(scratch, [(program, 1) for program in programs]) if line.split()[1] in {"begins", "ends"}]
    one, other = lines[0][0], lines[2][0]
    assert lines == [f"{one} begins", f"{one} ends", f"{other} begins", f"{other} ends"]


CRASHES = "import os, sys; from hdvplan.bench import turns\nwith turns() as take_turn:\n    take_turn(); os.abort()"
CHILD = "import subprocess, sys; subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(60)'], close_fds=False)"


@pytest.mark.parametrize("program", [CRASHES, CHILD, "import sys; sys.exit(3)"])
def test_neither_a_crash_nor_a_child_that_stays_keeps_the_other_waiting(scratch: Scratch, program: str) -> None:
    diary = scratch.folder / "diary"
    in_turn(started(scratch, *arguments) for arguments in ((program,), (DIARY, "b", str(diary), "2")))
    first, second = scratch.started
    assert finish(second).code == 0
    assert finish(first).code in {0, 3, 134}  # 134: ended by SIGABRT
    assert diary.read_text(encoding="utf-8").count("ends") == 2


def test_where_nobody_hands_out_turns_there_is_no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    for told in (None, "", "nonsense", "987654"):
        if told is not None:
            monkeypatch.setenv(TURNS, told)
        with turns() as take_turn:
            take_turn()
        assert TURNS not in os.environ


# Says where its temporary folder is, and has it for ever.
GATE = """
import time
from hdvplan.bench.comparing.processes import scratch_folder
with scratch_folder() as scratch:
    print(scratch.folder, flush=True)
    time.sleep(1e6)
"""


def test_what_a_killed_gate_left_goes_with_the_next_and_what_others_have_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    others = tmp_path / "hdvplan-gate-notes-mine"
    others.mkdir()
    variables = os.environ | {"TMPDIR": str(tmp_path)}
    with ExitStack() as stack:
        folders = []
        for _ in range(2):
            gate = stack.enter_context(subprocess.Popen([sys.executable, "-c", GATE], env=variables, stdout=subprocess.PIPE, text=True))  # noqa: S603 - our own
            stack.callback(gate.kill)
            assert gate.stdout is not None
            folders.append(Path(gate.stdout.readline().strip()))
        gate.kill()
        gate.wait()
        assert folders[1].is_dir()
        with scratch_folder() as scratch:
            assert set(tmp_path.iterdir()) == {others, folders[0], scratch.folder}


@pytest.mark.skipif(not hasattr(os, "sched_getaffinity"), reason="this system does not choose cores")
def test_both_run_on_the_core_that_they_share(scratch: Scratch) -> None:
    core = max(os.sched_getaffinity(0))
    ended = finish(start([sys.executable, "-c", "import os; print(os.sched_getaffinity(0))"], os.environ, scratch, turns=Turns(core)))
    assert ended.stdout.strip() == str({core})


@pytest.mark.slow
def test_a_process_that_runs_longer_than_its_limit_is_ended_and_waiting_for_turns_does_not_count() -> None:
    with scratch_folder() as scratch:
        hung = start([sys.executable, "-c", "import time; time.sleep(1e6)"], os.environ, scratch, limit=0.2)
        ended = finish(hung)
        assert ended.expired
        sleeps = "import time; from hdvplan.bench import turns\nwith turns() as take:\n    take(); time.sleep({})"
        one, other = (
            start([sys.executable, "-c", sleeps.format(seconds)], os.environ, scratch, turns=Turns(None), limit=limit)
            for seconds, limit in ((1e6, 4.0), (0.0, 4.0))
        )
        in_turn([one, other])
        assert one.expired
        assert not other.expired
        assert finish(other).spent["ran_s"] < 4.0  # though it waited for so long


def test_what_python_says_of_imports_is_their_time_and_no_words_of_the_program() -> None:
    lines = ("import time: self [us] | cumulative | package", "import time:   1500 |   2000 | os", "error: no", "import time: 5 | 5 | re")
    said, imported = without_imports("\n".join(lines))
    assert said == "error: no\n"
    assert imported == pytest.approx(1.505e-3)
    assert without_imports("error: no") == ("error: no", None)
