"""What is told of programs that cannot be installed."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from hdvplan.bench.comparing import programs
from hdvplan.bench.comparing.processes import Ended, scratch_folder
from hdvplan.bench.comparing.programs import Home, Program, ProgramError, UnreachedError, install, reason


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("warning: old\nerror: No interpreter found\n", "No interpreter found"),
        ("x\nERROR: No matching distribution found for y\n\n", "No matching distribution found for y"),
        ("Traceback\nValueError: no version\nERROR: Failed to build\n", "ValueError: no version"),
        ("something\nelse\n", "else"),
        (
            "ERROR: Exception:\nTraceback\npip.InvalidRequirement: Invalid URL: git+file:///x\n",
            "pip.InvalidRequirement: Invalid URL: git+file:///x",
        ),
        ("", "the installer says nothing"),
    ],
)
def test_the_reason_is_the_exception_of_a_build_or_the_installers_own(said: str, words: str) -> None:
    assert reason(Ended(1, "", said)) == words


RETRIED = "WARNING: Retrying (Retry(total=0)) after connection broken by 'NewConnectionError(...)': /simple/numpy/\n"
NONE = "ERROR: Could not find a version that satisfies the requirement numpy (from versions: {})\nERROR: No matching distribution found\n"


@pytest.mark.parametrize(
    ("said", "unreached"),
    [
        (RETRIED + NONE.format("none"), True),
        (NONE.format("none"), False),  # the index answers, and has no such project
        (RETRIED + NONE.format("1.0"), False),
        (RETRIED + "ValueError: half a commit\nERROR: Failed to build\n", False),
    ],
)
def test_an_index_that_does_not_answer_is_told_from_a_project_that_cannot_be_installed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, *, unreached: bool
) -> None:
    monkeypatch.setattr(programs, "run", lambda *_: Ended(1, "", said))
    with scratch_folder() as scratch, pytest.raises(ProgramError) as raised:
        install(tmp_path, tmp_path / "venv", "theirs", scratch, again=True)
    assert isinstance(raised.value, UnreachedError) == unreached


def test_extras_are_asked_of_pip_and_one_that_the_project_lacks_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[str] = []

    def run(command: list[str], *_: object) -> Ended:
        asked.append(command[-1])
        return Ended(0, "", "WARNING: ours 1 does not provide the extra 'tests'\n" if "tests" in command[-1] else "")

    monkeypatch.setattr(programs, "run", run)
    with scratch_folder() as scratch:
        install(tmp_path, tmp_path / "venv", "theirs", scratch, extras=("test", "plot"), again=True)
        assert asked == [f"{tmp_path}[test,plot]"]
        with pytest.raises(ProgramError, match="theirs cannot be installed: it has no extra 'tests'"):
            install(tmp_path, tmp_path / "venv", "theirs", scratch, extras=("tests",), again=True)


@pytest.mark.parametrize("forbidden", [True, False])
def test_both_sides_have_bytecode_where_the_users_shell_forbids_to_write_any(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *, forbidden: bool
) -> None:
    monkeypatch.setenv("PYTHONDONTWRITEBYTECODE", "1" if forbidden else "")
    (tmp_path / "ours.py").write_text("", encoding="utf-8")
    program = Program("ours", Path(sys.executable), tmp_path, tmp_path)
    with scratch_folder() as scratch:
        program.finish(program.start([sys.executable, "-c", "import ours"], scratch, Home(tmp_path / "home")))
        assert len(list((scratch.folder / "bytecode").rglob("ours.*.pyc"))) == forbidden
    assert len(list(tmp_path.glob("__pycache__/ours.*.pyc"))) == (not forbidden)


def test_a_command_that_fails_says_where_to_start_it_by_hand(tmp_path: Path) -> None:
    program = Program("ours", Path(sys.executable), folder=tmp_path)
    with scratch_folder() as scratch, pytest.raises(ProgramError, match="ours ended with 3") as caught:
        program.finish(program.start([sys.executable, "-c", "raise SystemExit(3)"], scratch, Home(tmp_path / "home")))
    assert caught.value.hint == f"start it yourself with {sys.executable} in {tmp_path}"


def test_the_times_that_a_command_printed_are_not_its_last_words() -> None:
    assert Ended(1, 'no licence\n{"cells": {}}\n', "").words == "no licence"
    assert Ended(1, '{"cells": {}}\n', "").words == "nothing"
