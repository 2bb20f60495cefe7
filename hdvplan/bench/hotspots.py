"""The functions that take longer: both programs run once more under cProfile."""

from __future__ import annotations

import pstats
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePath

from hdvplan.bench.processes import Scratch
from hdvplan.bench.programs import Program, ProgramError
from hdvplan.bench.work import Work

_MOST = 10  # functions that are listed
_LEAST = 0.01  # of the base's time: differences below this are noise of single runs
_BUILT_IN = "~"  # cProfile's name of the file of what is not Python
_ADDRESS = re.compile(r" at 0x[0-9A-Fa-f]+")  # in the names of some of these; another one in every process
Functions = Mapping[str, tuple[float, int]]  # by name: own time [s], calls


@dataclass(frozen=True)
class Hotspot:
    """A function, its own time [s] without what it calls, and its calls, on both sides."""

    function: str
    base: float
    new: float
    base_calls: int
    new_calls: int


def hotspots(base: Functions, new: Functions) -> tuple[Hotspot, ...]:
    """Return the functions that gained most time, the most first."""
    nothing = (0.0, 0)
    found = [
        Hotspot(name, base.get(name, nothing)[0], new.get(name, nothing)[0], base.get(name, nothing)[1], new.get(name, nothing)[1])
        for name in {**base, **new}
    ]
    least = _LEAST * sum(seconds for seconds, _ in base.values())
    gained = [one for one in found if one.new - one.base > least]
    return tuple(sorted(gained, key=lambda one: one.base - one.new)[:_MOST])


def profile_of(program: Program, work: Work, scratch: Scratch) -> Functions:
    """Return what a program's functions take while it does its work once under cProfile.

    Raises:
        ProgramError: it fails, or its work cannot be profiled.

    """
    file = scratch.folder / "profile"
    file.unlink(missing_ok=True)
    command = work.profiled(program, scratch.folder / "profiled", file)
    if command is None:
        msg = f"{program.name} cannot be profiled: its command does not begin with python and a file or -m"
        raise ProgramError(msg)
    program.finish(program.start(command, scratch))
    return functions_in(file, [path for path in (program.source, program.folder) if path is not None])


def functions_in(file: Path, roots: list[Path]) -> Functions:
    """Return the functions of a file of cProfile's by names that both sides share: files relative to ``roots`` or site-packages, no lines.

    Raises:
        ProgramError: the file is not there, or not of cProfile.

    """
    try:
        # mypy knows no attribute stats, which is documented only in the source
        told: dict[tuple[str, int, str], tuple[int, int, float, float, object]] = pstats.Stats(str(file)).stats  # type: ignore[attr-defined]
    except (OSError, EOFError, TypeError, ValueError) as error:
        msg = f"the profile cannot be read: {error}"
        raise ProgramError(msg) from error
    found: dict[str, tuple[float, int]] = {}
    for (source, _, function), (_, calls, own, _, _) in told.items():
        name = _ADDRESS.sub("", function) if source == _BUILT_IN else f"{_short(source, roots)}: {function}"
        seconds, before = found.get(name, (0.0, 0))
        found[name] = (seconds + own, before + calls)
    return found


def _short(source: str, roots: list[Path]) -> str:
    path = PurePath(source)
    if "site-packages" in path.parts:
        return PurePath(*path.parts[path.parts.index("site-packages") + 1 :]).as_posix()
    for root in roots:
        if path.is_relative_to(root):
            return path.relative_to(root).as_posix()
    return path.name


def hotspots_json(found: tuple[Hotspot, ...]) -> list[dict[str, object]]:
    """Return functions for other programs."""
    return [
        {"function": one.function, "base_s": one.base, "new_s": one.new, "base_calls": one.base_calls, "new_calls": one.new_calls}
        for one in found
    ]
