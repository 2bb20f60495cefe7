"""Programs to be measured against each other: how to start the working tree's hdvplan, and that of another revision or release."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
import tomllib
import venv
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from hdvplan.errors import MeasurementError, OptionError

_PACKAGE = Path(__file__).parents[1]
_WHERE = "import hdvplan; print(hdvplan.__file__)"


@dataclass(frozen=True)
class Program:
    """An hdvplan that can be started: an interpreter, and where it finds the package if it is not installed there."""

    name: str
    python: Path
    source: Path | None = None  # the folder that holds the package
    variables: Mapping[str, str] = field(default_factory=dict)

    def command(self, *arguments: str) -> list[str]:
        """Return the command line that runs ``hdvplan`` with ``arguments``; never that of the working directory by accident."""
        return [str(self.python), "-P", "-m", "hdvplan", *arguments]

    def environment(self) -> dict[str, str]:
        """Return the environment to start it in."""
        mine = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        path = {} if self.source is None else {"PYTHONPATH": str(self.source)}
        return mine | path | {"PYTHONHASHSEED": "0"} | dict(self.variables)

    def start(self, *arguments: str) -> subprocess.Popen[str]:
        """Start ``hdvplan`` with ``arguments``; what it prints is kept for ``finish``."""
        return subprocess.Popen(  # noqa: S603 - our own command
            self.command(*arguments), env=self.environment(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        )

    def finish(self, process: subprocess.Popen[str]) -> None:
        """Wait until a started process has ended well.

        Raises:
            MeasurementError: it did not.

        """
        with process:
            try:
                _, said = process.communicate()
            except BaseException:
                process.kill()
                raise
        if process.returncode != 0:
            error = next((line for line in said.splitlines() if line.startswith("error: ")), (said.strip().splitlines() or ["nothing"])[-1])
            msg = f"{self.name} ended with {process.returncode} and says: {error.removeprefix('error: ')}"
            raise MeasurementError(msg, hint="run the benchmark there by itself")

    def check(self) -> None:
        """Make sure that the package which will run is the one that is meant.

        Raises:
            MeasurementError: there is none, or it lies elsewhere.

        """
        ended = subprocess.run(  # noqa: S603 - our own command
            [str(self.python), "-P", "-c", _WHERE], env=self.environment(), capture_output=True, text=True, check=False
        )
        found = Path(ended.stdout.strip()) if ended.returncode == 0 else None
        if found is None or (self.source is not None and not found.resolve().is_relative_to(self.source.resolve())):
            msg = f"{self.name} cannot be started: {f'the package is {found}' if found else 'it has no hdvplan'}"
            raise MeasurementError(msg)


def working_tree() -> Program:
    """Return the checkout of hdvplan that the working directory is in; elsewhere the hdvplan that is running."""
    top = _checkout()
    return Program("the working tree" if top else "the running hdvplan", Path(sys.executable), top or _PACKAGE.parent)


@contextmanager
def base_program(against: str, on_step: Callable[[str], None]) -> Iterator[Program]:
    """Provide the program that ``against`` names, in a temporary folder that goes afterwards.

    ``against`` is a release or wheel to install (``hdvplan==0.1.0``, ``dist/hdvplan-0.1.0-py3-none-any.whl``), the Python
    interpreter of an environment that has hdvplan, or a revision of the checkout that the working directory is in. A
    revision with the same dependencies uses those of the present environment; another one is installed with its own.
    ``on_step`` receives what is being done, in words.

    Raises:
        OptionError: no such revision, release or interpreter.
        MeasurementError: it cannot be installed or started.

    """
    with tempfile.TemporaryDirectory(prefix="hdvplan-base-", ignore_cleanup_errors=True) as name:
        folder = Path(name)
        variables = {"NUMBA_CACHE_DIR": str(folder / "compiled")}  # numba keeps code by its source's path: useless later
        if _is_interpreter(against):
            program = Program(against, Path(against))  # with its own, lasting cache
            program.check()
            yield program
        elif "==" in against or against.endswith((".whl", ".tar.gz")):
            on_step(f"installing {against}")
            program = Program(against, _installed(against, folder / "venv"), None, variables)
            program.check()
            yield program
        else:
            with _worktree(against, folder / "base") as (top, source):
                if _dependencies(source) == _dependencies(top):
                    program = Program(against, Path(sys.executable), source, variables)
                else:
                    on_step(f"installing {against}, whose dependencies are others")
                    program = Program(against, _installed(str(source), folder / "venv"), None, variables)
                program.check()
                yield program


def _checkout() -> Path | None:
    """Return the top of the checkout of hdvplan that the working directory is in; None outside."""
    top = _git("rev-parse", "--show-toplevel")
    return Path(top) if top and (Path(top) / "hdvplan" / "__init__.py").is_file() else None


@contextmanager
def _worktree(revision: str, folder: Path) -> Iterator[tuple[Path, Path]]:
    """Check a revision out beside the checkout; provide the checkout's folder and the revision's."""
    top = _checkout()
    if top is None:
        msg = f"{revision!r} names a revision, but this is no git checkout of hdvplan"
        raise OptionError(msg, hint="name a release (hdvplan==0.1.0), or the Python of an environment that has one")
    if _git("rev-parse", "--verify", "--quiet", f"{revision}^{{commit}}") is None:
        msg = f"no revision {revision!r} in {top}"
        raise OptionError(msg, hint="a shallow clone lacks other branches: fetch them first")
    if _git("worktree", "add", "--detach", "--force", str(folder), f"{revision}^{{commit}}") is None:
        msg = f"git cannot check {revision!r} out into {folder}"
        raise MeasurementError(msg)
    try:
        yield top, folder
    finally:
        _git("-C", str(top), "worktree", "remove", "--force", str(folder))


def _git(*arguments: str) -> str | None:
    git = shutil.which("git")
    if git is None:
        return None
    ended = subprocess.run([git, *arguments], capture_output=True, text=True, check=False)  # noqa: S603 - no shell
    return ended.stdout.strip() if ended.returncode == 0 else None


def _dependencies(source: Path) -> Sequence[object]:
    project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    return project.get("dependencies", []), project.get("requires-python")


def _installed(what: str, folder: Path) -> Path:
    """Install a requirement, file or source tree into a new environment and return its interpreter."""
    venv.create(folder, with_pip=True)
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", what]
    ended = subprocess.run(pip, capture_output=True, text=True, check=False)  # noqa: S603 - no shell
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines() or ["pip says nothing"]
        msg = f"{what} cannot be installed: {said[-1].removeprefix('ERROR: ')}"
        raise OptionError(msg)
    return python


def _is_interpreter(against: str) -> bool:
    path = Path(against)
    return path.name.lower().startswith("python") and path.is_file() and os.access(path, os.X_OK)
