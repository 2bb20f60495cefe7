"""What ``--against`` names, and how it is made ready: small repositories, and names that would like to be more than names."""

from __future__ import annotations

import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from hdvplan.bench.comparing import environment, programs
from hdvplan.bench.comparing.checkout import Checkout, checkout, copy_tree
from hdvplan.bench.comparing.environment import Base, base_named, base_program, new_program
from hdvplan.bench.comparing.processes import Ended, Scratch
from hdvplan.bench.comparing.programs import Program, ProgramError
from hdvplan.cli.compare import _cannot_write
from hdvplan.errors import OptionError
from hdvplan.process import ended_by_signals
from tests.bench.conftest import Cli, git
from tests.nightly import nightly

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def committed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a repository that looks like one of hdvplan, with two commits; copy it before you change it."""
    top = tmp_path_factory.mktemp("committed")
    (top / "hdvplan").mkdir(parents=True)
    (top / "pyproject.toml").write_text('[project]\nname = "hdvplan"\ndependencies = ["numpy"]\n', encoding="utf-8")
    git(top, "init", "--quiet")
    for version in ("1", "2"):
        (top / "hdvplan" / "__init__.py").write_text(f"VERSION = {version}\n", encoding="utf-8")
        git(top, "add", ".")
        git(top, "commit", "--quiet", "--message", version)
    return top


@pytest.fixture
def ours(committed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return such a repository of the test's own, and go there."""
    top = tmp_path / "checkout"
    shutil.copytree(committed, top)
    monkeypatch.chdir(top)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return top


def base(against: str, scratch: Scratch) -> Program:
    here = checkout()
    return base_program(base_named(against, here), here, scratch, environment.cache_folder(scratch), lambda _: None)


def new(scratch: Scratch, against: str = "HEAD") -> Program:
    here = checkout()
    return new_program(base_named(against, here), here, scratch, environment.cache_folder(scratch), lambda _: None, Path("gate"))


def version_of(program: Program) -> str:
    code = [str(program.python), "-P", "-B", "-c", "import hdvplan; print(hdvplan.VERSION)"]  # it leaves no bytecode beside the source
    return subprocess.run(code, env=program.environment(), capture_output=True, text=True, check=True).stdout.strip()  # noqa: S603 - ours


def test_a_revision_is_exported_once_and_the_checkout_is_only_read(ours: Path, scratch: Scratch) -> None:
    (ours / "hdvplan" / "__init__.py").write_text("VERSION = 3\n", encoding="utf-8")
    git(ours, "add", ".")  # staged, not committed
    before = git(ours, "status", "--porcelain")
    old = base("HEAD~1", scratch)
    assert version_of(old) == "1"
    assert version_of(new(scratch)) == "3"  # not what is committed, but what is there
    assert git(ours, "status", "--porcelain") == before
    assert len(git(ours, "worktree", "list").splitlines()) == 1
    assert old.source is not None
    marked = old.source / "marked"
    marked.touch()
    assert base(git(ours, "rev-parse", "HEAD~1"), scratch).source == old.source  # by any name
    assert marked.exists()
    assert base("HEAD", scratch).source != old.source


def test_a_revision_without_a_project_file_runs_with_what_is_installed(ours: Path, scratch: Scratch) -> None:
    git(ours, "rm", "--quiet", "pyproject.toml")
    git(ours, "commit", "--quiet", "--message", "bare")
    (ours / "pyproject.toml").write_text('[project]\nname = "hdvplan"\n', encoding="utf-8")
    assert base("HEAD", scratch).python == Path(sys.executable)


def test_a_revision_that_cannot_be_imported_says_so_with_its_last_words(ours: Path, scratch: Scratch) -> None:
    (ours / "hdvplan" / "__init__.py").write_text("raise RuntimeError('half a commit')\n", encoding="utf-8")
    git(ours, "commit", "--quiet", "--all", "--message", "broken")
    with pytest.raises(ProgramError, match=r"cannot be started: its hdvplan says: RuntimeError: half a commit") as caught:
        base("HEAD", scratch).suite_defaults(scratch)
    assert "Traceback" in caught.value.tail


BUILD = """
import pathlib
pathlib.Path("hdvplan/built").write_text(pathlib.Path("hdvplan/core/core.c").read_text())
"""
CORE = """
import pathlib
here = pathlib.Path(__file__).parent
assert (here / "built").read_text() == (here / "core" / "core.c").read_text()
"""


def test_each_side_runs_with_the_c_core_of_its_own_sources(ours: Path, scratch: Scratch) -> None:
    (ours / "hdvplan" / "core").mkdir()
    for name, text in (("hatch_build.py", BUILD), (".gitignore", "hdvplan/built"), ("hdvplan/core.py", CORE), ("hdvplan/core/core.c", "1")):
        (ours / name).write_text(text, encoding="utf-8")
    git(ours, "add", ".")
    git(ours, "commit", "--quiet", "--message", "core")
    (ours / "hdvplan" / "core" / "core.c").write_text("2", encoding="utf-8")
    old = base("HEAD", scratch).source
    assert old is not None
    assert (old / "hdvplan" / "built").read_text(encoding="utf-8") == "1"
    assert new(scratch).source == ours
    built = ours / "hdvplan" / "built"
    assert built.read_text(encoding="utf-8") == "2"
    (ours / "hatch_build.py").write_text("raise SystemExit('error: no compiler')\n", encoding="utf-8")
    new(scratch)  # what is built is not built again
    built.unlink()
    with pytest.raises(ProgramError, match="the core of the working tree cannot be compiled: no compiler"):
        new(scratch)
    (ours / "hatch_build.py").write_text("import hatchling_of_nobody\n", encoding="utf-8")
    with pytest.raises(OptionError, match="the core of the working tree cannot be compiled: hatchling_of_nobody is not installed") as told:
        new(scratch)
    assert str(told.value.hint).startswith("pip install hatchling_of_nobody")
    (ours / "hatch_build.py").write_text("raise SystemExit('error: no compiler')\n", encoding="utf-8")
    git(ours, "commit", "--quiet", "--all", "--message", "nothing compiles")
    with pytest.raises(ProgramError, match=r"the core of HEAD \(\w+\) cannot be compiled: no compiler"):
        base("HEAD", scratch)


@pytest.mark.usefixtures("ours")
def test_what_is_not_complete_is_made_again(scratch: Scratch) -> None:
    source = base("HEAD", scratch).source
    assert source is not None
    (source.parent / "ready").unlink()
    (source / "hdvplan" / "__init__.py").unlink()
    assert version_of(base("HEAD", scratch)) == "2"


@pytest.mark.usefixtures("ours")
def test_only_a_few_revisions_are_kept(scratch: Scratch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(environment, "_KEPT", 1)
    first, second = base("HEAD~1", scratch).source, base("HEAD", scratch).source
    assert first is not None
    assert second is not None
    assert (first.exists(), second.exists()) == (False, True)


@pytest.mark.skipif(sys.platform == "win32", reason="shell scripts stand in for interpreters")
def test_an_interpreter_can_be_the_base(tmp_path: Path, scratch: Scratch) -> None:
    full = tmp_path / "python-full"
    full.write_text(f'#!/bin/sh\nPYTHONPATH={ROOT} exec {sys.executable} "$@"\n', encoding="utf-8")
    full.chmod(0o755)
    program = base(str(full), scratch)
    assert program.hdvplan("bench")[:2] == [str(full), "-P"]
    assert program.suite_defaults(scratch)["rounds"] == 3


def test_a_revision_that_a_shallow_clone_lacks_is_said_to_be_cut_off(
    committed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    git(tmp_path, "clone", "--quiet", "--depth", "1", committed.as_uri(), "shallow")
    git(tmp_path, "clone", "--quiet", committed.as_uri(), "whole")
    for name, words in (("shallow", "this clone is shallow"), ("whole", "git branch --all")):
        monkeypatch.chdir(tmp_path / name)
        with pytest.raises(OptionError, match="no revision 'HEAD~5'") as raised:
            base_named("HEAD~5", checkout())
        assert words in str(raised.value.hint)


HOSTILE = [
    "", " ", "--", "-", "-rrequirements.txt", "-r evil.txt==", "-revil==1.0", "--index-url=http://127.0.0.1:9/==1", "--help",
    "--output=owned", "--upload-pack=touch owned", "hdvplan==", "hdvplan==1.0 evil", "hdvplan==1.0;touch owned", "hdvplan==1.0\nevil",
    "hdvplan==*",
    "hdvplan==1.*", "hdvplan===1.0", "HDVPLAN[x]==1.0", "evil==1.0", "git+file:///tmp/evil==1", "evil @ file:///tmp/evil==1",
    "file:///tmp/evil.whl", "evil-1.0-py3-none-any.whl", "../evil.tar.gz", "python", "python3", "python-evil", "./python-missing",
    "/dev/null", "/", "HEAD;touch owned", "HEAD $(touch owned)", "`touch owned`", "HEAD\0--help", "HEAD\n--help", "HEAD..HEAD", "HEAD^!",
    "HEAD:pyproject.toml", "@{-1}", "\udcff", "x" * 5000, "refs/heads/../../../etc/passwd", "*", "|touch owned", "> owned",
]  # fmt: skip


@pytest.mark.parametrize("against", HOSTILE)
def test_a_name_is_data_and_nothing_of_it_runs(
    cli: Cli, ours: Path, short_road: str, monkeypatch: pytest.MonkeyPatch, against: str
) -> None:
    def nothing(*_: object, **__: object) -> None:
        pytest.fail("something was started")

    evil = ours / "python-evil"  # a file of the repository must not be taken for an interpreter by its bare name
    evil.write_text("#!/bin/sh\ntouch owned\n", encoding="utf-8")
    evil.chmod(0o755)
    monkeypatch.setattr("hdvplan.bench.comparing.programs.run", nothing)
    monkeypatch.setattr("hdvplan.bench.comparing.programs.start", nothing)
    outcome = cli("bench", f"--against={against}", "--roads", short_road, "--quiet")
    assert (outcome.code, outcome.out) == (2, "")
    lines = outcome.err.splitlines()
    assert lines[0].startswith("error: ")
    assert len(lines) <= 2  # the error, and a hint
    assert not (ours / "owned").exists()
    answer = json.loads(cli("bench", f"--against={against}", "--roads", short_road, "--quiet", "--json").out)
    assert answer["error"] == lines[0].removeprefix("error: ")


@pytest.mark.usefixtures("ours")
@pytest.mark.parametrize("version", ["0.1.0", "1!2.0rc1", "2024.1", "1.0.post1", "1.0.dev3", "1.0+local.7", "v1.0a1", "1.0-1"])
def test_a_release_goes_to_pip_behind_the_end_of_its_options(scratch: Scratch, monkeypatch: pytest.MonkeyPatch, version: str) -> None:
    commands: list[list[str]] = []

    def noted(command: list[str], *_: object) -> object:
        commands.append(command)
        return Ended(0, "", "")

    monkeypatch.setattr(programs, "run", noted)
    monkeypatch.setattr(environment, "environment", lambda folder, _: folder / "python")
    base(f"hdvplan=={version}", scratch)
    assert commands[0][-2:] == ["--", f"hdvplan=={version}"]


@pytest.mark.usefixtures("ours")
@pytest.mark.parametrize(
    ("before", "error", "words"),
    [
        ("", OptionError, "No matching distribution found for hdvplan==9"),
        (
            "WARNING: Retrying (Retry(total=0)) after connection broken by 'NewConnectionError(...)': /simple/hdvplan/\n",
            ProgramError,
            "no package index answers",
        ),
        ("WARNING: Could not fetch URL https://index/simple/hdvplan/: there was a problem\n", ProgramError, "no package index answers"),
    ],
)
def test_a_release_that_nobody_can_be_asked_for_is_no_mistake_of_the_user(
    scratch: Scratch, monkeypatch: pytest.MonkeyPatch, before: str, error: type[Exception], words: str
) -> None:
    """Pip ends in the same words whether there is no such version or nobody answers; the first is exit code 2, the second 3."""
    said = f"{before}ERROR: Could not find a version that satisfies hdvplan==9\nERROR: No matching distribution found for hdvplan==9\n"
    monkeypatch.setattr(programs, "run", lambda *_: Ended(1, "", said))
    monkeypatch.setattr(environment, "environment", lambda folder, _: folder / "python")
    with pytest.raises(error, match=f"hdvplan==9 cannot be installed: {words}"):
        base("hdvplan==9", scratch)


@pytest.mark.usefixtures("ours")
def test_a_wheel_goes_to_pip_as_the_address_of_a_file(tmp_path: Path) -> None:
    wheel = tmp_path / "hdvplan-1.0-py3-none-any; evil @ http.whl"
    wheel.touch()
    named = base_named(str(wheel), checkout())
    assert named == Base(str(wheel), install=wheel.as_uri())
    assert ";" not in wheel.as_uri()


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="process groups")
@pytest.mark.parametrize("number", [signal.SIGINT, nightly(signal.SIGTERM)])
def test_a_comparison_that_is_killed_leaves_neither_processes_nor_temporary_files(
    ours: Path, tmp_path: Path, number: signal.Signals
) -> None:
    temporary, token = tmp_path / "temporary", f"token-{os.getpid()}-{number}"
    temporary.mkdir()
    forever = f"sh -c 'sleep 600 & echo $! > {tmp_path}/{token}; sleep 600'"
    gate = ["bench", "--against", "HEAD~1", "--command", forever, "--out", str(tmp_path / "gate")]
    as_at_a_shell = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"  # ignored where pytest runs in the background
    command = [sys.executable, "-P", "-c", f"{as_at_a_shell}; from hdvplan.cli.entry import main; main()", *gate]
    environment_ = os.environ | {"PYTHONPATH": str(ROOT), "TMPDIR": str(temporary)}
    process = subprocess.Popen(command, cwd=ours, env=environment_, stderr=subprocess.PIPE, text=True)  # noqa: S603 - ours
    with process:
        for _ in range(600):  # a minute
            if (tmp_path / token).exists() or process.poll() is not None:
                break
            time.sleep(0.1)
        process.send_signal(number)
        _, said = process.communicate(timeout=60)
    assert process.returncode == 128 + number, said
    assert "Traceback" not in said
    assert not list(temporary.iterdir())
    child = int((tmp_path / token).read_text(encoding="utf-8"))
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(child)], capture_output=True, text=True, check=False)  # noqa: S603, S607 - fixed
    assert state.stdout.strip()[:1] in {"", "Z"}  # gone; a container may have nobody who takes note of it


def _ended_while_another_signal_is_ignored() -> None:
    with ended_by_signals():
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        signal.raise_signal(signal.SIGTERM)


@pytest.mark.skipif(sys.platform == "win32", reason="there is no such signal")
def test_a_signal_that_is_ignored_stays_so() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as behind nohup
    try:
        with pytest.raises(SystemExit) as left:
            _ended_while_another_signal_is_ignored()
        assert left.value.code == 143
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_a_checkout_of_another_user_is_refused_with_what_git_advises(
    cli: Cli, ours: Path, short_road: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ours / "hdvplan")
    monkeypatch.setenv("GIT_TEST_ASSUME_DIFFERENT_OWNER", "1")  # as in a container whose user is not that of the checkout
    monkeypatch.setenv("GIT_CONFIG_GLOBAL", os.devnull)
    monkeypatch.setenv("GIT_CONFIG_NOSYSTEM", "1")
    for against in ("HEAD~1", "hdvplan==0.1.0"):  # a release too is compared with what is here
        outcome = cli("bench", "--against", against, "--roads", short_road, "--quiet")
        assert (outcome.code, outcome.out) == (2, "")
        words, hint = outcome.err.splitlines()
        assert words.startswith(f"error: the git checkout {ours} cannot be read: detected dubious ownership")
        assert hint == f"hint: git config --global --add safe.directory {ours}"


@pytest.mark.usefixtures("ours")
def test_a_checkout_without_git_says_that_it_is_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("hdvplan.bench.comparing.checkout.shutil.which", lambda _: None)
    with pytest.raises(OptionError, match="cannot be read: git is not installed"):
        checkout()


PROJECT, TOOLS = '[project]\nname = "ours"\nversion = "1"\n', "[tool.ruff]\n"


@pytest.mark.parametrize(
    ("files", "package"),
    [
        ({}, None),
        ({"pyproject.toml": PROJECT}, ""),
        ({"pyproject.toml": "[build-system]\n"}, ""),
        ({"setup.py": ""}, ""),
        ({"planner/pyproject.toml": PROJECT, "pyproject.toml": PROJECT}, "planner"),
        ({"planner/pyproject.toml": TOOLS, "pyproject.toml": PROJECT}, ""),
        ({"map/pyproject.toml": PROJECT}, None),
        ({"pyproject.toml": TOOLS}, None),
        ({"pyproject.toml": TOOLS, "setup.cfg": "[metadata]\nname = ours\n"}, ""),
        ({"pyproject.toml": "["}, ""),  # pip says what is wrong with it
    ],
)
def test_the_nearest_project_is_what_is_installed_and_a_file_for_tools_is_none(
    tmp_path: Path, files: dict[str, str], package: str | None
) -> None:
    for name, content in files.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content, encoding="utf-8")
    assert Checkout(tmp_path, Path("planner", "gate")).package == (None if package is None else Path(package))


def test_a_project_below_the_top_of_its_repository_is_installed_at_both_revisions(
    tmp_path: Path, scratch: Scratch, monkeypatch: pytest.MonkeyPatch
) -> None:
    top = tmp_path / "all"
    (top / "planner").mkdir(parents=True)
    (top / "planner" / "pyproject.toml").write_text(PROJECT, encoding="utf-8")
    git(tmp_path, "init", "--quiet", str(top))
    git(top, "add", ".")
    git(top, "commit", "--quiet", "--message", "one")
    monkeypatch.chdir(top / "planner")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    installed: list[Path] = []
    monkeypatch.setattr(environment, "install", lambda source, *_, **__: installed.append(source))
    programs = [base("HEAD", scratch), new(scratch)]
    assert [source.name for source in installed] == ["planner", "planner"]
    assert sys.executable not in {str(program.python) for program in programs}  # which would be the same program twice
    assert [program.folder is not None and program.folder.name for program in programs] == ["planner", "planner"]
    assert new(scratch, sys.executable).name == "the running hdvplan"  # it was the project's own: a slower one was never measured


def test_a_working_tree_is_copied_with_links_as_links_and_without_results(ours: Path, tmp_path: Path) -> None:
    for name in ("new.py", "gate/base/00/run.json", "gate/tracked.txt", "hdvplan/gate/data.csv", "a[b]/x"):
        (ours / name).parent.mkdir(parents=True, exist_ok=True)
        (ours / name).write_text("", encoding="utf-8")
    (ours / "data").symlink_to("hdvplan")
    (ours / "nowhere").symlink_to("missing")
    git(ours, "add", "gate/tracked.txt")
    copy_tree(ours, tmp_path / "copy", [ours / "gate", Path("a[b]"), ours, tmp_path])
    found = {str(path.relative_to(tmp_path / "copy")) for path in (tmp_path / "copy").rglob("*") if path.is_symlink() or path.is_file()}
    assert found == {
        "pyproject.toml", "hdvplan/__init__.py", "new.py", "gate/tracked.txt", "hdvplan/gate/data.csv", "data", "nowhere"
    }  # fmt: skip
    assert (tmp_path / "copy" / "data").readlink() == Path("hdvplan")


def test_where_no_cache_can_be_written_a_temporary_one_does(tmp_path: Path, scratch: Scratch, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    assert environment.cache_folder(scratch) == tmp_path / "cache" / "hdvplan" / "gate"
    monkeypatch.setattr("hdvplan.bench.comparing.environment.os.access", lambda *_: False)  # root may write everywhere
    assert environment.cache_folder(scratch).parent == scratch.folder


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="on Windows each user's folders are closed to others")
@pytest.mark.parametrize("shared", ["", "hdvplan", "hdvplan/gate"])
def test_environments_whose_code_runs_are_not_taken_from_a_folder_of_others(
    tmp_path: Path, scratch: Scratch, monkeypatch: pytest.MonkeyPatch, shared: str
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    kept = environment.cache_folder(scratch)
    assert kept == tmp_path / "cache" / "hdvplan" / "gate"
    (tmp_path / "cache" / shared).chmod(0o777)
    assert environment.cache_folder(scratch).parent == scratch.folder


@pytest.mark.parametrize(
    ("file", "words", "hint"),
    [
        (None, "cannot measure into gate: no space left", "--out"),
        ("gate/new/00", "cannot measure into gate: no space left", "--out"),
        ("", "cannot measure into gate: no space left", "--out"),
        ("/cache/hdvplan/x.lock", "cannot measure: /cache/hdvplan/x.lock: no space left", "XDG_CACHE_HOME"),
    ],
)
@pytest.mark.skipif(sys.platform == "win32", reason="paths of this kind")
def test_a_file_that_cannot_be_written_is_named_with_what_would_help(file: str | None, words: str, hint: str) -> None:
    error = _cannot_write(OSError(errno.ENOSPC, "no space left", file), Path("gate"))
    assert str(error) == words
    assert hint in str(error.hint)
