"""One comparison from end to end: what is named is made ready, measured and compared, and nothing is left of it but its results."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from hdvplan.bench.against import Contender, Settings, measure_against
from hdvplan.bench.checkout import checkout
from hdvplan.bench.compare import Comparison, failed
from hdvplan.bench.environment import base_named, base_program, cache_folder, new_program
from hdvplan.bench.processes import Scratch, ended_by_signals, scratch_folder
from hdvplan.bench.programs import Program, ProgramError
from hdvplan.bench.suite import Suite
from hdvplan.bench.work import CommandWork, SuiteWork, Work, placed, suite_entries, suite_text
from hdvplan.errors import MeasurementError


@dataclass(frozen=True)
class Told:
    """Who wants to hear how a comparison goes on."""

    step: Callable[[str], None]  # what is being done, in words
    progress: Callable[[float], None]  # the done share of the measurement


def guard(against: str, wanted: Suite | CommandWork, settings: Settings, out: Path, told: Told) -> Comparison:
    """Return the comparison of what ``against`` names with what is here, doing ``wanted``; measured into ``out``.

    Whatever ends it, signals too, takes its processes and temporary files away. What stays is ``out``, and revisions in the user's cache.

    Raises:
        OptionError: ``against`` names nothing, or ``out`` holds something else.
        OSError: ``out`` cannot be written.

    """
    with ended_by_signals(), scratch_folder() as scratch:
        here = checkout()
        named = base_named(against, here)
        cache = cache_folder(scratch)
        out.mkdir(parents=True, exist_ok=True)
        side = "base"
        try:
            base = base_program(named, here, scratch, cache, told.step)
            base_work = _work(base, wanted, scratch, side)
            side = "new"
            new = new_program(here, scratch, cache, told.step)
            new_work = _work(new, wanted, scratch, side)
        except MeasurementError as error:
            return failed(side, str(error), error.tail if isinstance(error, ProgramError) else "")
        if isinstance(wanted, Suite):
            (out / "suite.toml").write_text(suite_text(suite_entries(placed(wanted), wanted.to_dict())), encoding="utf-8")
        told.step(f"base: {base.name}; new: {new.name}")
        return measure_against(Contender(base, base_work), Contender(new, new_work), settings, out.absolute(), scratch, told.progress)


def _work(program: Program, wanted: Suite | CommandWork, scratch: Scratch, side: str) -> Work:
    """Return the work of one side; a suite is written out in full, so that no side's defaults count.

    Raises:
        MeasurementError: it cannot do what is wanted.

    """
    if isinstance(wanted, CommandWork):
        return wanted
    file = scratch.folder / f"{side}.toml"
    file.write_text(suite_text(suite_entries(placed(wanted), program.suite_defaults(scratch))), encoding="utf-8")
    return SuiteWork(file)
