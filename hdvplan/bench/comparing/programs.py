"""A program that can be measured: how its hdvplan or a user's command is started, and which entries of suites it knows."""

from __future__ import annotations

import json
import os
import re
import site
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hdvplan.bench.comparing.processes import Ended, Scratch, Started, Turns, finish, run, start
from hdvplan.errors import MeasurementError

_ABOUT = """
import json, hdvplan
from hdvplan.bench.suite import Suite
print(json.dumps([hdvplan.__file__, Suite().to_dict()]))
"""


class ProgramError(MeasurementError):
    """A program cannot be installed, imported or run, or gives nothing that can be compared; ``tail`` is the end of what it says."""

    def __init__(self, message: str, *, tail: str = "", code: int | None = None, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.tail, self.code = tail, code


class UnreachedError(ProgramError):
    """A program cannot be installed because no package index answers, which says nothing about the program."""


@dataclass(frozen=True)
class Home:
    """Where a process that is measured finds its home, caches and temporary files, and for how long it may run [s]."""

    folder: Path
    limit: float | None = None

    def variables(self) -> dict[str, str]:
        """Return the variables that say so; its folders are made. Python's packages of the user stay where they are."""
        cache, temporary = self.folder / ".cache", self.folder / "tmp"
        for one in (cache, temporary):
            one.mkdir(parents=True, exist_ok=True)
        names = {self.folder: ("HOME", "USERPROFILE"), cache: ("XDG_CACHE_HOME", "LOCALAPPDATA"), temporary: ("TMPDIR", "TEMP", "TMP")}
        own = {name: str(one) for one, all_ in names.items() for name in all_}
        own |= {f"XDG_{kind}_HOME": str(self.folder / f".{kind.lower()}") for kind in ("CONFIG", "DATA", "STATE")}
        return own | {"PYTHONUSERBASE": site.getuserbase()}

    @property
    def is_used(self) -> bool:
        """Whether a process has left a file there."""
        return any(path.is_file() for path in self.folder.rglob("*"))


@dataclass(frozen=True)
class Program:
    """A program in a separate environment: an interpreter, where it finds packages that are not installed there, and a folder."""

    name: str
    python: Path = Path(sys.executable)
    source: Path | None = None  # a folder that holds the package hdvplan
    folder: Path | None = None  # where it runs; None: where we do

    def hdvplan(self, *arguments: str) -> list[str]:
        """Return the command line of its ``hdvplan``."""
        return [str(self.python), "-P", "-m", "hdvplan", *arguments]  # -P: never the package that lies where it runs

    def environment(self) -> dict[str, str]:
        """Return the environment to start it in."""
        mine = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        path = {} if self.source is None else {"PYTHONPATH": str(self.source)}
        first = os.pathsep.join([str(self.python.parent), *filter(None, [mine.get("PATH")])])
        return mine | path | {"PATH": first, "PYTHONHASHSEED": "0"}

    def start(self, command: Sequence[str], scratch: Scratch, home: Home, turns: Turns | None = None) -> Started:
        """Start a command of this program, with ``turns`` as one of two that take them.

        Raises:
            ProgramError: there is no such command.

        """
        variables = self.environment() | home.variables() | {"PYTHONPROFILEIMPORTTIME": "1"}
        if variables.pop("PYTHONDONTWRITEBYTECODE", ""):  # a side that lacks bytecode would be the slower: both have some, elsewhere
            variables["PYTHONPYCACHEPREFIX"] = str(scratch.folder / "bytecode")
        try:
            return start(command, variables, scratch, self.folder, turns, home.limit)
        except (OSError, ValueError) as error:
            msg = f"{self.name} cannot be started: {error}"
            raise ProgramError(msg) from error

    def finish(self, started: Started) -> Ended:
        """Wait until a started command has ended well.

        Raises:
            ProgramError: it did not.

        """
        ended = finish(started)
        if ended.expired:
            msg = f"{self.name} did not end within {started.limit:g} s"
            raise ProgramError(msg, tail=ended.tail, code=ended.code, hint="--time-limit S allows more")
        if ended.code != 0:
            msg = f"{self.name} ended with {ended.how} and says: {ended.words}"
            missing = "is its name right? --extras NAME installs an extra of the project, too"
            alone = f"start it yourself with {self.python}{'' if self.folder is None else f' in {self.folder}'}"
            hint = missing if "No module named" in ended.words else alone
            raise ProgramError(msg, tail=ended.tail, code=ended.code, hint=hint)
        return ended

    def suite_defaults(self, scratch: Scratch) -> Mapping[str, object]:
        """Return what its hdvplan benchmarks unless it is told otherwise, and so the names that its suites know.

        Raises:
            ProgramError: it has no hdvplan, one that cannot be imported, or not the one that is meant.

        """
        ended = run([str(self.python), "-P", "-c", _ABOUT], self.environment(), scratch, self.folder)
        file, defaults = "", {}
        if ended.code == 0:
            with suppress(ValueError):
                file, defaults = json.loads(ended.stdout)
        if not file:
            none = "No module named 'hdvplan'" in ended.words
            says = "it has no hdvplan, which drives the suite: list that in the project's dependencies, or measure with --command"
            msg = f"{self.name} cannot be started: {says if none else f'its hdvplan says: {ended.words}'}"
            raise ProgramError(msg, tail=ended.tail, code=ended.code)
        if self.source is not None and not Path(file).resolve().is_relative_to(self.source.resolve()):
            msg = f"{self.name} cannot be started: the package is {file}"
            raise ProgramError(msg)
        return dict(defaults)


PYTHON = Path("Scripts/python.exe" if os.name == "nt" else "bin/python")  # in an environment
_NO_ANSWER = re.compile(r"WARNING: Retrying|connection broken by|Could not fetch URL|ConnectionError|timed out", re.IGNORECASE)
_NO_VERSION = re.compile(r"\(from versions: none\)|Max retries exceeded|ReadTimeoutError")
_NO_EXTRA = re.compile(r"does not provide the extra '([^']*)'")
_NOT_OURS = {"PYTHONPATH", "PIP_REQUIRE_VIRTUALENV", "VIRTUAL_ENV"}


def environment(folder: Path, scratch: Scratch) -> Path:
    """Make an environment with pip and return its interpreter.

    Raises:
        ProgramError: it cannot be made.

    """
    ended = run([sys.executable, "-I", "-m", "venv", str(folder)], _variables(scratch), scratch)
    if ended.code != 0:
        msg = f"no environment can be made in {folder}: {(ended.stdout.strip().splitlines() or [ended.words])[-1]}"
        raise ProgramError(msg, tail=ended.tail)
    return folder / PYTHON


def install(source: Path, folder: Path, name: str, scratch: Scratch, *, extras: Sequence[str] = (), again: bool = False) -> None:
    """Install a source tree into the environment ``folder``; ``again``: only itself, into one that has its requirements.

    Raises:
        UnreachedError: pip got no answer from a package index.
        ProgramError: it cannot be installed.

    """
    python = folder / PYTHON if again else environment(folder, scratch)
    what = f"{source.absolute()}[{','.join(extras)}]" if extras else source.as_uri()
    ended = pip(python, scratch, what, *(("--no-deps", "--force-reinstall") if again else ()))
    if missing := _NO_EXTRA.search(ended.stderr):
        msg = f"{name} cannot be installed: it has no extra {missing[1]!r}"
        raise ProgramError(msg, tail=ended.tail)
    if ended.code != 0:
        if is_unreached(ended) and _NO_VERSION.search(ended.stderr):  # a build that fails after a retry is the program's own failure
            msg = f"{name} cannot be installed: no package index answers"
            raise UnreachedError(msg, tail=ended.tail, code=ended.code)
        msg = f"{name} cannot be installed: {reason(ended)}"
        raise ProgramError(msg, tail=ended.tail, code=ended.code)


def pip(python: Path, scratch: Scratch, what: str, *options: str) -> Ended:
    """Have pip install one thing; it is never taken for an option."""
    command = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-input", *options, "--", what]
    return run(command, _variables(scratch), scratch)


def reason(ended: Ended) -> str:
    """Return why nothing was installed: the exception of a build, else the installer's own error."""
    lines = [" ".join(line.split()) for line in ended.stderr.splitlines() if line.strip()]
    raised = [line for line in lines if re.match(r"\w*(?:Error|Exception)\b.*:", line) and not line.startswith("ERROR")]
    errors = [line.partition(": ")[2] for line in lines if line.lower().startswith("error: ") and not line.endswith("Exception:")]
    return (raised or errors or lines or ["the installer says nothing"])[-1]


def is_unreached(ended: Ended) -> bool:
    """Tell whether pip got no answer from a package index: in the end it says then, too, that there is no such version."""
    return _NO_ANSWER.search(ended.stderr) is not None


def _variables(scratch: Scratch) -> dict[str, str]:
    """Return the variables with which something is installed. Versions are not read from tags: there is no repository."""
    mine = {name: value for name, value in os.environ.items() if name not in _NOT_OURS}
    versions = {"SETUPTOOLS_SCM_PRETEND_VERSION": os.environ.get("SETUPTOOLS_SCM_PRETEND_VERSION", "0")}
    return mine | versions | {"TMPDIR": str(scratch.folder)}
