"""Measure two programs in the same job: interleaved fresh processes, and a repeat before anything but a fine verdict."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Mapping
from pathlib import Path

from hdvplan.bench.compare import Comparison, compare, read_side
from hdvplan.bench.counters import Tolerance
from hdvplan.bench.environment import Program
from hdvplan.bench.gate import BATCH, Rule, Verdict
from hdvplan.bench.suite import Suite
from hdvplan.errors import OptionError

# Two roads, both kinds of vehicles, both schemes, the default solver: half a second of driving, so that six rounds are
# quick and a process takes 4 s, most of which is its start.
SUITE: Mapping[str, object] = {"roads": ("uturn", "monaco_fairmont_hairpin"), "solvers": ("riccati",), "rounds": 6}
SIDES = ("base", "new")


def measure_against(
    base: Program,
    new: Program,
    suite: Suite,
    rule: Rule,
    out: Path,
    *,
    expect_changes: bool,
    on_progress: Callable[[float], None],
) -> Comparison:
    """Return the comparison of two programs, measured into ``out``/base and ``out``/new; ``on_progress`` receives the done share.

    Both run the suite once for their compiled code, at the same time. Then five pairs of processes follow, each with the
    other side first. Unless all times are fine then, five more pairs are measured, and all ten decide.

    Raises:
        OptionError: ``out`` holds something else.
        MeasurementError: a process failed.
        OSError: ``out`` cannot be written.

    """
    programs = dict(zip(SIDES, (base, new), strict=True))
    for side in SIDES:
        _clear(out / side)
    arguments = ("bench", *options_of(suite), "--quiet", "--fresh", "--out")
    compiling = [(program, program.start(*arguments, str(out / side / "warm"), "--rounds", "1")) for side, program in programs.items()]
    try:
        for program, process in compiling:
            program.finish(process)
    finally:
        for _, process in compiling:
            with process:
                process.kill()  # does nothing to one that has ended
    for side in SIDES:
        shutil.rmtree(out / side / "warm")
    for pair in range(2 * BATCH):
        for side in SIDES if pair % 2 == 0 else reversed(SIDES):
            programs[side].finish(programs[side].start(*arguments, str(out / side / f"{pair:02d}")))
        on_progress((pair + 1) / (2 * BATCH))
        if pair + 1 == BATCH:
            first = _compared(out, rule, expect_changes)
            if all(entry.decision is None or entry.decision.verdict is Verdict.FINE for entry in first.times):
                return first
    return _compared(out, rule, expect_changes)


def options_of(suite: Suite) -> list[str]:
    """Return the options of ``hdvplan bench`` that ask for a suite; only such as differ from the defaults, or are lists."""
    usual, options = Suite(), []
    for name, value in suite.to_dict().items():
        if isinstance(value, list) and not value:
            continue
        if isinstance(value, list):
            options += [f"--{name}", ",".join(value)]
        elif name == "limits":
            options += [] if value else ["--no-limits"]
        elif name == "rounds" or value != getattr(usual, name):
            options += [f"--{name.replace('_', '-')}", str(value)]
    return options


def _compared(out: Path, rule: Rule, expect_changes: bool) -> Comparison:
    base, new = (read_side(out / side) for side in SIDES)
    return compare(base, new, rule, Tolerance(), expect_changes=expect_changes)


def _clear(folder: Path) -> None:
    """Delete the runs of an earlier comparison."""
    if not folder.exists():
        return
    if not folder.is_dir() or any(not (entry.name.isdigit() or entry.name == "warm") for entry in folder.iterdir()):
        msg = f"{folder} holds something else than an earlier comparison"
        raise OptionError(msg, hint="choose another folder with --out")
    shutil.rmtree(folder)
