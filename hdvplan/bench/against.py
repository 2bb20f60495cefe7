"""Measure two programs in the same job: interleaved fresh processes, and a repeat before anything but a fine verdict."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from itertools import count
from pathlib import Path

from hdvplan.bench.compare import Comparison, compare, failed
from hdvplan.bench.counters import Tolerance
from hdvplan.bench.gate import BATCH, Rule, Verdict
from hdvplan.bench.processes import Ended, Scratch, Started
from hdvplan.bench.programs import Program, ProgramError
from hdvplan.bench.sides import IMPORT, PEAK, read_side
from hdvplan.bench.work import ABOUT, Work
from hdvplan.errors import OptionError
from hdvplan.fileio import json_bytes, write_atomically

# Two roads, both kinds of vehicles, both schemes, the default solver: half a second of driving, so that six rounds are
# quick and a process takes 4 s, most of which is its start.
SUITE: Mapping[str, object] = {"roads": ("uturn", "monaco_fairmont_hairpin"), "solvers": ("riccati",), "rounds": 6}
SIDES = ("base", "new")
REPORTS = ("comparison.json", "junit.xml", "benchmark.json", "bencher.json", "summary.md", "suite.toml")  # beside the sides' folders
_BAD_USE = (2, 126, 127)  # exit codes: of hdvplan, and of what cannot be started


@dataclass(frozen=True)
class Contender:
    """A program and what it is to do."""

    program: Program
    work: Work


@dataclass(frozen=True)
class Settings:
    """How two programs are compared."""

    rule: Rule
    expect_changes: bool
    profile: bool = False  # what became worse, function by function


def measure_against(
    base: Contender, new: Contender, settings: Settings, out: Path, scratch: Scratch, on_progress: Callable[[float], None]
) -> Comparison:
    """Return the comparison of two programs, measured into ``out``/base and ``out``/new; ``on_progress`` receives the done share.

    Both do their work once for their compiled code, at the same time. Then five pairs of processes follow, each with the
    other side first. Unless all is fine then, five more pairs are measured, and all ten decide. A program that fails ends it: a new
    one that fails beside a base that does not is a regression.

    Raises:
        OptionError: ``out`` holds something else, or neither program can use what it is given.
        OSError: ``out`` cannot be written.

    """
    sides = dict(zip(SIDES, (base, new), strict=True))
    for side in SIDES:
        _clear(out / side)
    numbers = count()

    def begin(side: str, name: str, *, warm: bool = False) -> tuple[Started, Path, Path]:
        timed, target = scratch.folder / f"import-{next(numbers)}", out / side / name
        command = sides[side].work.command(sides[side].program, target, timed, warm=warm)
        return sides[side].program.start(command, scratch), target, timed

    def complete(side: str, begun: tuple[Started, Path, Path]) -> None:
        started, target, timed = begun
        ended = sides[side].program.finish(started)
        sides[side].work.keep(ended, target)
        _note(target, ended, timed)

    side = SIDES[0]
    try:
        begun = {}
        for side in SIDES:
            begun[side] = begin(side, "warm", warm=True)
        for side in SIDES:  # the base first: of what fails on both sides the new one is not to blame
            complete(side, begun[side])
        for side in SIDES:
            shutil.rmtree(out / side / "warm", ignore_errors=True)
        for pair in range(2 * BATCH):
            for side in SIDES if pair % 2 == 0 else reversed(SIDES):
                complete(side, begin(side, f"{pair:02d}"))
            on_progress((pair + 1) / (2 * BATCH))
            if pair + 1 == BATCH and (first := compared(out, settings)).verdict is Verdict.FINE:
                return first
            if pair + 1 == BATCH and first.verdict is Verdict.REGRESSED and not _in_times(first):
                return first  # counters are the same in every process
    except ProgramError as error:
        if side == SIDES[0] and error.code in _BAD_USE and _fails_too(begun.get(SIDES[1]), new.program):
            raise OptionError(str(error), hint=error.hint) from error
        return failed(side, str(error), error.tail)
    return compared(out, settings)


def compared(out: Path, settings: Settings) -> Comparison:
    """Return the comparison of what is in ``out``; a side that cannot be read is one that failed."""
    sides = {}
    for side in SIDES:
        try:
            sides[side] = read_side(out / side)
        except OptionError as error:  # what was measured a moment ago: its program wrote something else
            return failed(side, str(error), "")
    return compare(sides[SIDES[0]], sides[SIDES[1]], settings.rule, Tolerance(), expect_changes=settings.expect_changes)


def _in_times(comparison: Comparison) -> bool:
    """Tell whether there is something in a comparison's times that a repeat could settle."""
    cells = [entry.decision.verdict for entry in comparison.times if entry.decision]
    return any(verdict is not Verdict.FINE for verdict in [*cells, *(one.verdict for one in comparison.found)])


def _fails_too(begun: tuple[Started, Path, Path] | None, program: Program) -> bool:
    """Tell whether the other program ends with bad use as well: then what was asked for is wrong, not a program."""
    if begun is None:
        return False
    try:
        program.finish(begun[0])
    except ProgramError as error:
        return error.code in _BAD_USE
    return False


def _note(target: Path, ended: Ended, timed: Path) -> None:
    """Leave beside what a process measured how long its imports took, and its largest memory."""
    known: dict[str, object] = {PEAK: ended.peak_bytes}
    with suppress(OSError, ValueError):
        known[IMPORT] = float(json.loads(timed.read_text(encoding="utf-8")))
        timed.unlink()
    if target.is_dir():
        write_atomically(target / ABOUT, json_bytes(known))


def _clear(folder: Path) -> None:
    """Delete the runs of an earlier comparison."""
    if not folder.exists():
        return
    if not folder.is_dir() or any(not (entry.name.isdigit() or entry.name == "warm") for entry in folder.iterdir()):
        msg = f"{folder} holds something else than an earlier comparison"
        raise OptionError(msg, hint="choose another folder with --out")
    shutil.rmtree(folder)
