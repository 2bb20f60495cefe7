"""The versions that a process has noted beside what it measured. Imports nothing that plans: that may be broken where a gate runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from hdvplan.fileio import read_json


def versions_of(process: Path) -> dict[str, str]:
    """Return the versions of hdvplan and of libraries from the folder of a process; a command of one's own notes none."""
    try:
        told = read_json(process / "run.json")["software"]
        return {"hdvplan": str(told["hdvplan"])} | {str(name): str(version) for name, version in told["packages"].items()}
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return {}


def version_words(before: Mapping[str, str], after: Mapping[str, str]) -> tuple[str, ...]:
    """Return which versions changed, in words."""
    names = {**before, **after}
    return tuple(f"{name} {before.get(name, '-')} -> {after.get(name, '-')}" for name in names if before.get(name) != after.get(name))
