"""A program that can be measured: how its hdvplan or a user's command is started, and which entries of suites it knows."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from hdvplan.bench.processes import Ended, Scratch, Started, Turns, finish, run, start
from hdvplan.errors import MeasurementError
from hdvplan.machine import THREADS

_ABOUT = """
import json, hdvplan
from hdvplan.bench.suite import Suite
print(json.dumps([hdvplan.__file__, Suite().to_dict()]))
"""
# The command line of hdvplan, with the time that loading what plans took before.
_TIMED = f"""
import os, sys, time
os.environ.update(dict.fromkeys({THREADS!r}, "1"))
began = time.perf_counter()
import hdvplan
hdvplan.plan
took = time.perf_counter() - began
with open(sys.argv[1], "w") as file:
    file.write(repr(took))
sys.argv = ["hdvplan", *sys.argv[2:]]
from hdvplan.cli.app import main
main()
"""


class ProgramError(MeasurementError):
    """A program cannot be installed, imported or run, or gives nothing that can be compared; ``tail`` is the end of what it says."""

    def __init__(self, message: str, *, tail: str = "", code: int | None = None, hint: str | None = None) -> None:
        super().__init__(message, hint=hint)
        self.tail, self.code = tail, code


class UnreachedError(ProgramError):
    """A program cannot be installed because no package index answers, which says nothing about the program."""


@dataclass(frozen=True)
class Program:
    """A program in a separate environment: an interpreter, where it finds packages that are not installed there, and a folder."""

    name: str
    python: Path
    source: Path | None = None  # a folder that holds the package hdvplan
    folder: Path | None = None  # where it runs; None: where we do

    def hdvplan(self, *arguments: str, timed: Path) -> list[str]:
        """Return the command line of its ``hdvplan``; the time of its imports [s] are written to ``timed``."""
        return [str(self.python), "-P", "-c", _TIMED, str(timed), *arguments]  # -P: never the package that lies where it runs

    def environment(self) -> dict[str, str]:
        """Return the environment to start it in."""
        mine = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        path = {} if self.source is None else {"PYTHONPATH": str(self.source)}
        first = os.pathsep.join([str(self.python.parent), *filter(None, [mine.get("PATH")])])
        return mine | path | {"PATH": first, "PYTHONHASHSEED": "0"}

    def start(self, command: Sequence[str], scratch: Scratch, turns: Turns | None = None) -> Started:
        """Start a command of this program, with ``turns`` as one of two that take them.

        Raises:
            ProgramError: there is no such command.

        """
        try:
            return start(command, self.environment() | {"TMPDIR": str(scratch.folder)}, scratch, self.folder, turns)
        except (OSError, ValueError) as error:
            msg = f"{self.name} cannot be started: {error}"
            raise ProgramError(msg) from error

    def finish(self, started: Started) -> Ended:
        """Wait until a started command has ended well.

        Raises:
            ProgramError: it did not.

        """
        ended = finish(started)
        if ended.code != 0:
            msg = f"{self.name} ended with {ended.how} and says: {ended.words}"
            raise ProgramError(msg, tail=ended.tail, code=ended.code, hint="run it there alone")
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
                file, defaults = json.loads(ended.printed)
        if not file:
            msg = f"{self.name} cannot be started: its hdvplan says: {ended.words}"
            raise ProgramError(msg, tail=ended.tail, code=ended.code)
        if self.source is not None and not Path(file).resolve().is_relative_to(self.source.resolve()):
            msg = f"{self.name} cannot be started: the package is {file}"
            raise ProgramError(msg)
        return dict(defaults)


def present(name: str, source: Path | None, folder: Path | None = None) -> Program:
    """Return a program that runs by this interpreter."""
    return Program(name, Path(sys.executable), source, folder)
