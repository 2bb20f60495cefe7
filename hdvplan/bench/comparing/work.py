"""What is measured of a program: a suite of hdvplan's, or a user's command that says how long its planning steps took."""

from __future__ import annotations

import json
import os
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.checkout import Checkout
from hdvplan.bench.comparing.processes import Ended
from hdvplan.bench.comparing.programs import Program, ProgramError
from hdvplan.bench.suite import Suite
from hdvplan.errors import MeasurementError, OptionError
from hdvplan.fileio import json_bytes, write_atomically
from hdvplan.plugins import OBJECTIVE, SOLVER, is_reference, offers

STEPS = "steps.json"  # in the folder of a process: what a user's command has printed
ABOUT = "process.json"  # in the folder of a process: what was measured of it as a whole
_HINT = '{"cells": {"depot": {"steps_s": [0.0012, 0.0011]}}} is the least; docs/guarding-timing.md has the rest'
_FILE, _WRITTEN = "{json}", "written.json"


class Work(Protocol):
    """What both programs do in every process."""

    @property
    def on_one_thread(self) -> bool:
        """Whether it never uses more than one core at a time, so that both programs can share one."""

    def command(self, program: Program, out: Path, *, warm: bool) -> list[str]:
        """Return the command line; ``warm``: only so that what it does but once is done."""

    def keep(self, ended: Ended, out: Path) -> None:
        """Leave in ``out`` what a process has measured, if it has not done so itself; MeasurementError where that is nothing."""


@dataclass(frozen=True)
class SuiteWork:
    """A benchmark of hdvplan, defined by a file in which every entry stands that this program knows."""

    file: Path
    on_one_thread: ClassVar = True

    def command(self, program: Program, out: Path, *, warm: bool) -> list[str]:
        """See ``Work``."""
        once = ("--rounds", "1") if warm else ()
        return program.hdvplan("bench", "--suite", str(self.file), "--quiet", "--fresh", "--out", str(out), *once)

    def keep(self, ended: Ended, out: Path) -> None:
        """See ``Work``: the benchmark has written its run directory."""
        if not (out / "run.json").is_file():
            msg = f"it ended with exit code 0, but there is no benchmark in {out}"
            raise ProgramError(msg, tail=ended.tail)


@dataclass(frozen=True)
class CommandWork:
    """A command whose last line on stdout is JSON, or which writes it into the file that replaces ``{json}`` in its words."""

    words: tuple[str, ...]
    extras: tuple[str, ...] = ()  # of the project, that it needs
    on_one_thread: ClassVar = False

    def command(self, program: Program, out: Path, *, warm: bool) -> list[str]:  # noqa: ARG002 - see ``Work``
        """See ``Work``."""
        out.mkdir(parents=True, exist_ok=True)
        return [word.replace(_FILE, str(out / _WRITTEN)) for word in self.words]

    def keep(self, ended: Ended, out: Path) -> None:
        """See ``Work``."""
        try:
            written = (out / _WRITTEN).read_text(encoding="utf-8") if any(_FILE in word for word in self.words) else ended.stdout
        except (OSError, ValueError):
            written = ""
        lines = written.strip().splitlines()
        try:
            report = json.loads(lines[-1] if lines[-1].lstrip().startswith("{") else written, parse_constant=_refused)
            _refuse_longer(steps_of(report), ended.spent.get("ran_s", np.inf))
        except (ValueError, IndexError, RecursionError) as error:
            reason = str(error) if lines and lines[-1].lstrip().startswith("{") else f"its last line is {(lines or ['nothing'])[-1][:80]!r}"
            msg = f"{self.words[0]} prints no planning times: {reason}"
            raise ProgramError(msg, tail=ended.tail, hint=_HINT) from error
        out.mkdir(parents=True, exist_ok=True)
        write_atomically(out / STEPS, json_bytes(report))
        (out / _WRITTEN).unlink(missing_ok=True)


def _refuse_longer(cells: Mapping[str, OwnSteps], ran: float) -> None:
    """Refuse steps that cannot have fitted into the time for which their process ran [s], each core with its own."""
    lasted = sum(float(np.sum(cell.steps) + np.sum(cell.first)) for cell in cells.values())
    if lasted > ran * (os.cpu_count() or 1):
        msg = f"its steps add up to {lasted:.3g} s, and it ran for {ran:.3g} s: are they in seconds?"
        raise ValueError(msg)


SHORTEST_S, LONGEST_S = 1e-12, 1e9  # of a time: no clock shows others, and ratios of them come to the end of what floats hold


@dataclass(frozen=True)
class OwnSteps:
    """What a user's command says about one cell."""

    steps: FloatArray  # (rounds, steps) times of planning steps [s]
    first: FloatArray  # (rounds,) or empty: the first plan, made from nothing [s]
    s: FloatArray  # (steps,) arclength where each begins [m]; NaN where it is not told
    counters: Mapping[str, object]


def _refused(name: str) -> None:
    """Refuse what Python's reader of JSON takes for a number, and no other does."""
    msg = f"{name} is no number"
    raise ValueError(msg)


_KEYS = ("steps_s", "first_s", "s_m", "counters")


def steps_of(report: object) -> dict[str, OwnSteps]:
    """Return the cells of the protocol: ``{"cells": {NAME: {"steps_s": [...] or [[...], ...], "first_s", "s_m", "counters"}}}``.

    A cell that is a list is its ``steps_s``; one list is one round. A report of pytest-benchmark has a cell of one step for each benchmark.

    Raises:
        ValueError: anything else.

    """
    if isinstance(report, dict) and isinstance(report.get("benchmarks"), list):
        report = {"cells": dict(map(_benchmark, report["benchmarks"]))}
    cells = report.get("cells") if isinstance(report, dict) else None
    if not isinstance(cells, dict) or not cells:
        msg = "there are no cells"
        raise ValueError(msg)
    return {str(name): _cell(str(name), cell if isinstance(cell, dict) else {"steps_s": cell}) for name, cell in cells.items()}


def _benchmark(report: object) -> tuple[str, list[list[object]]]:
    try:
        return str(report["fullname"]), [[time] for time in report["stats"]["data"]]  # type: ignore[index] # refused below
    except (LookupError, TypeError) as error:
        msg = "a benchmark has no fullname and stats.data"
        raise ValueError(msg) from error


def _cell(name: str, cell: Mapping[str, object]) -> OwnSteps:
    if unknown := [key for key in cell if key not in _KEYS]:
        msg = f"{name}: {unknown[0]!r} is none of {', '.join(_KEYS)}"
        raise ValueError(msg)
    if "steps_s" not in cell:
        msg = f"{name}: 'steps_s' is missing"
        raise ValueError(msg)
    steps = np.atleast_2d(_numbers(name, "steps_s", cell["steps_s"]))
    first, s = (np.atleast_1d(_numbers(name, key, cell.get(key, []))) for key in ("first_s", "s_m"))
    counters = cell.get("counters", {})
    shown = all(np.all((times >= SHORTEST_S) & (times <= LONGEST_S)) for times in (steps, first))
    if steps.ndim != 2 or not steps.size or not shown:  # noqa: PLR2004 - a table
        msg = f"{name}: steps_s are positive times in seconds, one list or one a round, all of one length"
        raise ValueError(msg)
    if len(s) not in {0, steps.shape[1]} or not isinstance(counters, dict):
        msg = f"{name}: s_m has one place a step, counters are names with values"
        raise ValueError(msg)
    return OwnSteps(steps, first, s if len(s) else np.full(steps.shape[1], np.nan), counters)


def _numbers(name: str, key: str, value: object) -> FloatArray:
    rounds = {len(one) for one in value if isinstance(one, list)} if isinstance(value, list) else set()
    if len(rounds) > 1:
        msg = f"{name}: {key} has rounds of {min(rounds)} and of {max(rounds)} steps; all need the same"
        raise ValueError(msg)
    try:
        numbers = np.array(value, dtype=np.float64)
    except (TypeError, ValueError, OverflowError) as error:
        msg = f"{name}: {key} is not a list of numbers"
        raise ValueError(msg) from error
    if not np.all(np.isfinite(numbers)):
        msg = f"{name}: {key} is not finite throughout"
        raise ValueError(msg)
    return numbers


def suite_entries(suite: Suite, known: Mapping[str, object]) -> dict[str, object]:
    """Return a suite with every entry that a program knows, none left to its own defaults; ``known`` are those.

    Raises:
        MeasurementError: it cannot be told to do the same: an entry that it does not know has a value, or one that has none has a default.

    """
    usual, entries = Suite().to_dict(), {}
    for name, value in suite.to_dict().items():
        if name not in known and value != usual[name]:
            msg = f"the other program knows no {name} in suites, which is {value} here"
            raise MeasurementError(msg)
        if name in known and value is None and known[name] is not None:
            msg = f"the other program has {name} = {known[name]} where none is wanted"
            raise MeasurementError(msg)
        if name in known and value is not None:
            entries[name] = value
    return entries


def suite_text(entries: Mapping[str, object]) -> str:
    """Return entries of a suite as TOML; words, numbers, truth values and lists of words stand there as in JSON.

    TOML has no surrogate pairs and no bare delete, which JSON has.
    """
    lines = (f"{name} = {json.dumps(value, ensure_ascii=False)}\n" for name, value in entries.items())
    return "".join(lines).replace("\x7f", "\\u007f")


def has_files(suite: Suite) -> bool:
    """Return whether any road or vehicle of a suite is a file."""
    return any(map(suite.file, (*suite.roads, *suite.vehicles)))


def placed(suite: Suite) -> Suite:
    """Return a suite whose road and vehicle files have absolute paths: both programs read the same, wherever they run."""
    named = (suite.roads, suite.vehicles)
    roads, vehicles = (tuple(str(file.absolute()) if (file := suite.file(one)) else one for one in names) for names in named)
    return replace(suite, roads=roads, vehicles=vehicles, files={})


def refuse_nothing(here: Checkout, suite: Suite) -> None:
    """Refuse a suite in which nothing differs between two revisions of a checkout: roads and vehicles are the working tree's for both.

    Raises:
        OptionError: both sides would be the program that runs this.

    """
    own = any(is_reference(name) or name in offers(SOLVER) for name in suite.solvers)
    own = own or is_reference(suite.objective) or suite.objective in offers(OBJECTIVE)
    if not own and not here.is_ours and here.package is None:
        msg = f"nothing of {here.top} is measured: this would compare hdvplan with itself"
        hint = (
            "--against hdvplan==X compares releases, --counters FILE.csv keeps results of your roads and vehicles, "
            "--command 'python -m ours.bench' measures your own planner, --suite your solver"
        )
        raise OptionError(msg, hint=hint)


def command_words(text: str) -> tuple[str, ...]:
    """Return the words of a command as a shell would split it; nothing else of a shell's is done.

    Raises:
        OptionError: there are none, or a quotation is not closed.

    """
    try:
        words = shlex.split(text)
    except ValueError as error:
        msg = f"the command {text!r} cannot be split into words: {str(error).lower()}"
        raise OptionError(msg, hint="close every quotation; a quotation mark itself has a backslash before it") from error
    if shell := {"&&", "||", "|", ";"}.intersection(words):
        msg = f"the command {text!r} is for a shell: {shell.pop()}"
        raise OptionError(msg, hint=f"--command {shlex.quote(f'sh -c {shlex.quote(text)}')}")
    if not words or "\0" in text:
        msg = f"the command is {'empty' if not words else 'no text'}"
        raise OptionError(msg, hint="--command 'python -m ours.bench' measures your own planner")
    return tuple(words)
