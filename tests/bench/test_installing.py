"""How environments are made: which installer gets which words."""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import pytest

from hdvplan.bench.comparing import programs
from hdvplan.bench.comparing.processes import Ended, Scratch, scratch_folder
from hdvplan.bench.comparing.programs import ProgramError, UnreachedError, install, reason

Command = tuple[list[str], dict[str, str], Path | None]


@pytest.fixture
def commands(monkeypatch: pytest.MonkeyPatch) -> list[Command]:
    """Return the commands that would have been run."""
    found: list[Command] = []

    def noted(command: Sequence[str], variables: Mapping[str, str], _: Scratch, cwd: Path | None = None) -> Ended:
        found.append((list(command), dict(variables), cwd))
        return Ended(0, "", "")

    monkeypatch.setattr(programs, "run", noted)
    monkeypatch.setattr("shutil.which", lambda name: f"/bin/{name}")
    return found


@pytest.fixture
def source(tmp_path: Path) -> Path:
    """Return a project with a lock file of uv."""
    folder = tmp_path / "theirs"
    folder.mkdir()
    (folder / "pyproject.toml").write_text('[project]\nname = "theirs"\nversion = "1"\n', encoding="utf-8")
    (folder / "uv.lock").write_text("version = 1\n", encoding="utf-8")
    return folder


def test_a_project_with_a_lock_file_is_installed_by_uv_as_it_says(
    commands: list[Command], source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VIRTUAL_ENV", "/elsewhere")
    monkeypatch.setenv("UV_PROJECT_ENVIRONMENT", "/elsewhere")
    with scratch_folder() as scratch:
        install(source, tmp_path / "venv", "theirs", scratch)
        install(source, tmp_path / "venv", "theirs", scratch, again=True)
    (first, variables, cwd), (again, _, _) = commands
    assert first[:2] == ["/bin/uv", "sync"]
    assert {"--frozen", "--no-editable"} <= set(first)
    assert first[first.index("--python") + 1] == sys.executable
    assert (variables["UV_PROJECT_ENVIRONMENT"], "VIRTUAL_ENV" in variables, cwd) == (str(tmp_path / "venv"), False, source)
    assert again == [*first, "--reinstall-package", "theirs"]


@pytest.mark.parametrize("lacking", ["uv", "lock"])
def test_without_uv_or_its_lock_file_it_is_pip(
    commands: list[Command], source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, lacking: str
) -> None:
    if lacking == "uv":
        monkeypatch.setattr("shutil.which", lambda _: None)
    else:
        (source / "uv.lock").unlink()
    with scratch_folder() as scratch:
        install(source, tmp_path / "venv", "theirs", scratch)
    assert [command[1:4] for command, _, _ in commands] == [["-I", "-m", "venv"], ["-m", "pip", "install"]]
    assert commands[1][0][-2:] == ["--", source.as_uri()]


@pytest.mark.usefixtures("commands")
def test_a_project_without_a_name_cannot_be_installed_again(source: Path, tmp_path: Path) -> None:
    (source / "pyproject.toml").write_text("[project\n", encoding="utf-8")
    with scratch_folder() as scratch, pytest.raises(ProgramError, match="names no project"):
        install(source, tmp_path / "venv", "theirs", scratch, again=True)


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("warning: old\nerror: No interpreter found\n", "No interpreter found"),
        ("x\nERROR: No matching distribution found for y\n\n", "No matching distribution found for y"),
        ("Traceback\nValueError: no version\nERROR: Failed to build\n", "ValueError: no version"),
        ("something\nelse\n", "else"),
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
@pytest.mark.usefixtures("commands")
def test_an_index_that_does_not_answer_is_told_from_a_project_that_cannot_be_installed(
    source: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, said: str, *, unreached: bool
) -> None:
    monkeypatch.setattr("shutil.which", lambda _: None)
    monkeypatch.setattr(programs, "run", lambda *_: Ended(1, "", said))
    with scratch_folder() as scratch, pytest.raises(ProgramError) as raised:
        install(source, tmp_path / "venv", "theirs", scratch, again=True)
    assert isinstance(raised.value, UnreachedError) == unreached
