"""What is told of programs that cannot be installed."""

from __future__ import annotations

from pathlib import Path

import pytest

from hdvplan.bench.comparing import programs
from hdvplan.bench.comparing.processes import Ended, scratch_folder
from hdvplan.bench.comparing.programs import ProgramError, UnreachedError, install, reason


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
