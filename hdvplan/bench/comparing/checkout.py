"""A git checkout as a comparison uses it: it is read, and nothing is registered in it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from hdvplan.bench.comparing.programs import ProgramError
from hdvplan.errors import OptionError
from hdvplan.texts import printable


@dataclass(frozen=True)
class Checkout:
    """The git checkout that a comparison starts in; ``below`` is the folder within it, ``extras`` of its package are wanted."""

    top: Path
    below: Path
    extras: tuple[str, ...] = ()

    @property
    def is_ours(self) -> bool:
        """Whether it is one of hdvplan itself."""
        return (self.top / "hdvplan" / "__init__.py").is_file()

    @property
    def package(self) -> Path | None:
        """The folder that pip can install, within the checkout: the nearest at or above ``below``; None where there is none."""
        return next((folder for folder in (self.below, *self.below.parents) if _can_be_installed(self.top / folder)), None)


def checkout(extras: tuple[str, ...] = ()) -> Checkout | None:
    """Return the git checkout that the working directory is in; None outside.

    Raises:
        OptionError: there is one that cannot be read: git is not installed, or does not trust its owner.

    """
    ended, here = _run(None, "rev-parse", "--show-toplevel"), Path.cwd()
    if ended is not None and ended.returncode == 0:
        top = Path(_text(ended.stdout))
        return Checkout(top, here.resolve().relative_to(top.resolve()), extras)
    found = next((folder for folder in (here, *here.parents) if os.path.lexists(folder / ".git")), None)
    if found is None:
        return None
    lines = [] if ended is None else _text(ended.stderr).splitlines()
    why = "git is not installed" if ended is None else (lines or ["git says nothing"])[0].removeprefix("fatal: ")
    advice = "install git" if ended is None else next((line for line in lines if "--add safe.directory" in line), None)
    msg = f"the git checkout {found} cannot be read: {why}"
    raise OptionError(msg, hint=advice)


def export(top: Path, commit: str, source: Path, folder: Path) -> None:
    """Write the files of a commit, through an index of our own.

    Raises:
        ProgramError: git cannot, such as on a full disk.

    """
    index = {"GIT_INDEX_FILE": str(folder / "index")}
    source.mkdir()
    for command in (("read-tree", commit), ("checkout-index", "--all", "--force", f"--prefix={source}/")):
        ended = _run(top, *command, variables=index)
        if ended is None or ended.returncode != 0:
            tail = "" if ended is None else _text(ended.stderr)
            why = ([line for line in tail.splitlines() if line] or ["git says nothing"])[-1].removeprefix("fatal: ")
            msg = f"git cannot check {commit[:9]} out into {source}: {printable(why)}"
            raise ProgramError(msg, tail=tail)


def copy_tree(top: Path, target: Path, apart: Sequence[Path] = ()) -> None:
    """Copy the files of a working tree that git knows or would add; links as links, as ``export`` writes them.

    Of the folders in ``apart``, which hold results, only what git knows is copied: build systems would take them for packages.
    """
    within = [folder.resolve().relative_to(top.resolve()) for folder in apart if top.resolve() in folder.resolve().parents]
    without = [f"--exclude=/{_literal(folder.as_posix())}/" for folder in within]
    listed = git(top, "ls-files", "-z", "--cached", "--others", "--exclude-standard", *without) or ""
    for name in filter(None, listed.split("\0")):
        if (top / name).is_symlink() or (top / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(top / name, target / name, follow_symlinks=False)


def git(top: Path | None, *arguments: str, variables: dict[str, str] | None = None) -> str | None:
    """Return what git prints in a checkout, the working directory without one; None where it fails or there is no git."""
    ended = _run(top, *arguments, variables=variables)
    return _text(ended.stdout) if ended is not None and ended.returncode == 0 else None


def _run(top: Path | None, *arguments: str, variables: dict[str, str] | None = None) -> subprocess.CompletedProcess[bytes] | None:
    """Run git; None where there is none."""
    program = shutil.which("git")
    if program is None:
        return None
    where = [] if top is None else ["-C", str(top)]
    return subprocess.run(  # noqa: S603 - no shell
        [program, *where, *arguments], capture_output=True, check=False, env=os.environ | (variables or {}), stdin=subprocess.DEVNULL
    )


def _text(output: bytes) -> str:
    return os.fsdecode(output).strip()


def _literal(path: str) -> str:
    """Return a path as a pattern of git that matches nothing else."""
    return re.sub(r"([*?\[\]\\])", r"\\\1", path)


def _can_be_installed(folder: Path) -> bool:
    """Tell whether pip finds a project in a folder; a pyproject.toml may only set up tools."""
    if (folder / "setup.py").is_file():
        return True
    try:
        entries = tomllib.loads((folder / "pyproject.toml").read_text(encoding="utf-8"))
    except OSError:
        return False
    except ValueError:
        return True  # pip says what is wrong with it
    return not {"project", "build-system"}.isdisjoint(entries) or (folder / "setup.cfg").is_file()
