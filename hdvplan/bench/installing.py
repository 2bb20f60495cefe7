"""Environments for programs: by uv if a project has its lock file and uv is installed, else by venv and pip."""

from __future__ import annotations

import os
import re
import shutil
import sys
import tomllib
from pathlib import Path

from hdvplan.bench.processes import Ended, Scratch, run
from hdvplan.bench.programs import ProgramError, UnreachedError

PYTHON = Path("Scripts/python.exe" if os.name == "nt" else "bin/python")  # in an environment
_NO_ANSWER = re.compile(r"WARNING: Retrying|connection broken by|Could not fetch URL|ConnectionError|timed out", re.IGNORECASE)
_NO_VERSION = re.compile(r"\(from versions: none\)|Max retries exceeded|ReadTimeoutError")
_NOT_OURS = {"PYTHONPATH", "PIP_REQUIRE_VIRTUALENV", "VIRTUAL_ENV", "UV_PROJECT_ENVIRONMENT", "UV_PYTHON"}


def environment(folder: Path, scratch: Scratch) -> Path:
    """Make an environment with pip and return its interpreter.

    Raises:
        ProgramError: it cannot be made.

    """
    ended = run([sys.executable, "-I", "-m", "venv", str(folder)], _variables(scratch), scratch)
    if ended.code != 0:
        msg = f"no environment can be made in {folder}: {(ended.printed.strip().splitlines() or [ended.words])[-1]}"
        raise ProgramError(msg, tail=ended.tail)
    return folder / PYTHON


def install(source: Path, folder: Path, name: str, scratch: Scratch, *, again: bool = False) -> None:
    """Install a source tree into the environment ``folder``; ``again``: only itself, into one that has its requirements.

    Raises:
        UnreachedError: pip got no answer from a package index.
        ProgramError: it cannot be installed.

    """
    uv = shutil.which("uv")
    if uv is not None and (source / "uv.lock").is_file():
        ended = _uv_sync(uv, source, folder, scratch, again=again)
    else:
        python = folder / PYTHON if again else environment(folder, scratch)
        ended = pip(python, scratch, source.as_uri(), *(("--no-deps", "--force-reinstall") if again else ()))
    if ended.code != 0:
        if is_unreached(ended) and _NO_VERSION.search(ended.said):  # a build that fails after a retry is the program's own failure
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
    lines = [" ".join(line.split()) for line in ended.said.splitlines() if line.strip()]
    raised = [line for line in lines if re.match(r"\w*(?:Error|Exception)\b.*:", line) and not line.startswith("ERROR")]
    errors = [line.partition(": ")[2] for line in lines if line.lower().startswith("error: ")]
    return (raised or errors or lines or ["the installer says nothing"])[-1]


def is_unreached(ended: Ended) -> bool:
    """Tell whether pip got no answer from a package index: in the end it says then, too, that there is no such version."""
    return _NO_ANSWER.search(ended.said) is not None


def _uv_sync(uv: str, source: Path, folder: Path, scratch: Scratch, *, again: bool) -> Ended:
    """Have uv install what the lock file says, with the default groups, and the project as others would install it."""
    afresh = ["--reinstall-package", _project(source)] if again else []
    command = [uv, "sync", "--quiet", "--frozen", "--no-editable", "--no-progress", "--project", str(source), "--python", sys.executable]
    return run([*command, *afresh], _variables(scratch) | {"UV_PROJECT_ENVIRONMENT": str(folder)}, scratch, source)


def _project(source: Path) -> str:
    """Return the name of a project.

    Raises:
        ProgramError: it has none.

    """
    try:
        return str(tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]["name"])
    except (OSError, ValueError, LookupError, TypeError) as error:
        msg = f"{source / 'pyproject.toml'} names no project: {error}"
        raise ProgramError(msg) from error


def _variables(scratch: Scratch) -> dict[str, str]:
    """Return the variables with which something is installed. Versions are not read from tags: there is no repository."""
    mine = {name: value for name, value in os.environ.items() if name not in _NOT_OURS}
    versions = {"SETUPTOOLS_SCM_PRETEND_VERSION": os.environ.get("SETUPTOOLS_SCM_PRETEND_VERSION", "0")}
    return mine | versions | {"TMPDIR": str(scratch.folder)}
