"""A git checkout as a comparison uses it: it is read, and nothing is registered in it."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from hdvplan.bench.programs import ProgramError


@dataclass(frozen=True)
class Checkout:
    """The git checkout that a comparison starts in; ``below`` is the folder within it."""

    top: Path
    below: Path

    @property
    def is_ours(self) -> bool:
        """Whether it is one of hdvplan itself."""
        return (self.top / "hdvplan" / "__init__.py").is_file()

    @property
    def is_package(self) -> bool:
        """Whether pip can install it."""
        return any((self.top / name).is_file() for name in ("pyproject.toml", "setup.py"))


def checkout() -> Checkout | None:
    """Return the git checkout that the working directory is in; None outside."""
    top = git(None, "rev-parse", "--show-toplevel")
    return Checkout(Path(top), Path.cwd().resolve().relative_to(Path(top).resolve())) if top else None


def export(top: Path, commit: str, source: Path, folder: Path) -> None:
    """Write the files of a commit, through an index of our own."""
    index = {"GIT_INDEX_FILE": str(folder / "index")}
    source.mkdir()
    if git(top, "read-tree", commit, variables=index) is None or (
        git(top, "checkout-index", "--all", "--force", f"--prefix={source}/", variables=index) is None
    ):
        msg = f"git cannot check {commit[:9]} out into {source}"
        raise ProgramError(msg)


def copy_tree(top: Path, target: Path) -> None:
    """Copy the files of a working tree that git knows or would add."""
    listed = git(top, "ls-files", "-z", "--cached", "--others", "--exclude-standard") or ""
    for name in filter(None, listed.split("\0")):
        if (top / name).is_file():
            (target / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(top / name, target / name)


def git(top: Path | None, *arguments: str, variables: dict[str, str] | None = None) -> str | None:
    """Return what git prints in a checkout, the working directory without one; None where it fails or there is no git."""
    program = shutil.which("git")
    if program is None:
        return None
    where = [] if top is None else ["-C", str(top)]
    ended = subprocess.run(  # noqa: S603 - no shell
        [program, *where, *arguments], capture_output=True, check=False, env=os.environ | (variables or {}), stdin=subprocess.DEVNULL
    )
    return os.fsdecode(ended.stdout).strip() if ended.returncode == 0 else None
