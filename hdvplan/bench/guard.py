"""One comparison from end to end: both sides are prepared, measured and compared, and only the results are left."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from hdvplan.bench.against import REPORTS, SIDES, Contender, Settings, measure_against
from hdvplan.bench.checkout import checkout
from hdvplan.bench.compare import Comparison, failed
from hdvplan.bench.environment import base_named, base_program, cache_folder, new_program
from hdvplan.bench.processes import Scratch, ended_by_signals, scratch_folder
from hdvplan.bench.programs import Program, ProgramError, UnreachedError
from hdvplan.bench.suite import Suite
from hdvplan.bench.work import CommandWork, SuiteWork, Work, placed, suite_entries, suite_text
from hdvplan.errors import MeasurementError, OptionError
from hdvplan.texts import encoded


@dataclass(frozen=True)
class Told:
    """Who wants to hear how a comparison goes on."""

    step: Callable[[str], None]  # what is being done, in words
    progress: Callable[[float], None]  # the done share of the measurement


@dataclass(frozen=True)
class Wanted:
    """What is compared, and how."""

    against: str
    work: Suite | CommandWork
    settings: Settings


def guard(wanted: Wanted, out: Path, told: Told) -> Comparison:
    """Return the comparison of what is named with what is here; measured into ``out``.

    However it ends, also by signals, its processes and temporary files are removed. What stays is ``out``, and revisions in the user's
    cache. The reports of an earlier comparison go first, so that none is taken for this one's.

    Raises:
        OptionError: ``against`` names nothing, ``out`` holds something else or is in use, or the checkout cannot be read.
        OSError: ``out`` cannot be written.

    """
    with ended_by_signals(), scratch_folder() as scratch:
        here = checkout()
        named = base_named(wanted.against, here)
        cache = cache_folder(scratch)
        out.mkdir(parents=True, exist_ok=True)
        with _alone_in(out):
            for report in REPORTS:
                (out / report).unlink(missing_ok=True)
            if isinstance(wanted.work, Suite):
                (out / "suite.toml").write_bytes(encoded(suite_text(suite_entries(placed(wanted.work), wanted.work.to_dict()))))
            return _compared(
                lambda: base_program(named, here, scratch, cache, told.step),
                lambda: new_program(here, scratch, cache, told.step, out),
                wanted, out.absolute(), scratch, told,
            )  # fmt: skip


@contextmanager
def _alone_in(out: Path) -> Iterator[None]:
    """Keep a second comparison out of a folder, where the system has such locks; this one goes with the process and leaves no file.

    Raises:
        OptionError: another comparison measures into it.

    """
    try:
        import fcntl  # noqa: PLC0415 - not on Windows
    except ImportError:
        yield
        return
    folder = os.open(out, os.O_RDONLY)
    try:
        with suppress(OSError):  # some network file systems have none
            try:
                fcntl.flock(folder, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                msg = f"another comparison measures into {out}"
                raise OptionError(msg, hint="choose another folder with --out") from error
        yield
    finally:
        os.close(folder)


def _compared(
    base: Callable[[], Program], new: Callable[[], Program], wanted: Wanted, out: Path, scratch: Scratch, told: Told
) -> Comparison:
    """Make both programs ready, measure them into ``out`` and compare; whichever is not ready is a failure."""
    contenders: list[Contender] = []
    for side, made in zip(SIDES, (base, new), strict=True):
        try:
            program = made()
            contenders.append(Contender(program, _work(program, wanted.work, scratch, side)))
        except MeasurementError as error:
            tail = error.tail if isinstance(error, ProgramError) else ""
            return failed(side, str(error), tail, blameless=isinstance(error, UnreachedError))
    old, now = contenders
    told.step(f"base: {old.program.name}; new: {now.program.name}")
    return measure_against(old, now, wanted.settings, out, scratch, told.progress)


def _work(program: Program, wanted: Suite | CommandWork, scratch: Scratch, side: str) -> Work:
    """Return the work of one side; a suite is written out in full, so that no side's defaults count.

    Raises:
        MeasurementError: it cannot do what is wanted.

    """
    if isinstance(wanted, CommandWork):
        return wanted
    file = scratch.folder / f"{side}.toml"
    file.write_bytes(encoded(suite_text(suite_entries(placed(wanted), program.suite_defaults(scratch)))))
    return SuiteWork(file)
