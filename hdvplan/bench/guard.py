"""One comparison from end to end: both sides are prepared, measured and compared, and only the results are left."""

from __future__ import annotations

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path

from hdvplan.bench.against import REPORTS, Contender, Settings, measure_against
from hdvplan.bench.bisect import clearest_symptom, most_trials, origin_of
from hdvplan.bench.checkout import checkout
from hdvplan.bench.compare import Comparison, failed
from hdvplan.bench.environment import Base, base_named, base_program, cache_folder, new_program
from hdvplan.bench.gate import Verdict
from hdvplan.bench.hotspots import hotspots, profile_of
from hdvplan.bench.origin import Origin
from hdvplan.bench.processes import Scratch, ended_by_signals, scratch_folder
from hdvplan.bench.programs import Program, ProgramError, UnreachedError
from hdvplan.bench.revisions import Revision, revisions_since
from hdvplan.bench.suite import Suite
from hdvplan.bench.work import CommandWork, SuiteWork, Work, placed, suite_entries, suite_text
from hdvplan.errors import MeasurementError, OptionError
from hdvplan.texts import encoded

_BASE, _NEW = "base", "new"


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


def suspects(against: str) -> tuple[Revision, ...]:
    """Return the revisions between what ``against`` names and what is here, which ``traced`` would look at; oldest first.

    Raises:
        OptionError: it is no revision of a checkout, or there is nothing between.

    """
    here = checkout()
    named = base_named(against, here)
    if here is None or named.commit is None:
        msg = f"--bisect needs a revision to begin at, and {against!r} is none"
        raise OptionError(msg, hint="name a commit, branch or tag with --against")
    found = revisions_since(here, named.commit)
    if not found:
        msg = f"there is no revision between {against!r} and the working tree"
        raise OptionError(msg, hint="leave out --bisect")
    return found


def traced(wanted: Wanted, comparison: Comparison, revisions: tuple[Revision, ...], told: Told) -> Origin:
    """Return where what a red ``comparison`` shows most clearly began; ``revisions`` are the ``suspects``. Nothing is left of it.

    Raises:
        OptionError: as ``guard``.

    """
    with ended_by_signals(), scratch_folder() as scratch:
        here = checkout()
        named = base_named(wanted.against, here)
        cache = cache_folder(scratch)
        numbers, most = count(1), most_trials(len(revisions))

        def compared(revision: Revision) -> Comparison:
            told.step(f"bisect, {next(numbers)} of at most {most}: {revision.words}")
            out = scratch.folder / "bisect"
            shutil.rmtree(out, ignore_errors=True)
            return _compared(
                lambda: base_program(named, here, scratch, cache, told.step),
                lambda: base_program(Base(str(revision.commit)[:9], commit=revision.commit), here, scratch, cache, told.step),
                replace(wanted, settings=replace(wanted.settings, profile=False)), out, scratch, told,
            )  # fmt: skip

        return origin_of(clearest_symptom(comparison), revisions, compared)


def _compared(
    base: Callable[[], Program], new: Callable[[], Program], wanted: Wanted, out: Path, scratch: Scratch, told: Told
) -> Comparison:
    """Make both programs ready, measure them into ``out`` and compare; whichever is not ready is a failure."""
    contenders: dict[str, Contender] = {}
    side = _BASE
    try:
        for side, made in ((_BASE, base), (_NEW, new)):
            program = made()
            contenders[side] = Contender(program, _work(program, wanted.work, scratch, side))
    except MeasurementError as error:
        tail = error.tail if isinstance(error, ProgramError) else ""
        return failed(side, str(error), tail, blameless=isinstance(error, UnreachedError))
    told.step(f"base: {contenders[_BASE].program.name}; new: {contenders[_NEW].program.name}")
    comparison = measure_against(contenders[_BASE], contenders[_NEW], wanted.settings, out, scratch, told.progress)
    if not wanted.settings.profile or comparison.verdict is not Verdict.REGRESSED or comparison.failure is not None:
        return comparison
    told.step("profiling both")
    try:
        profiles = [profile_of(contenders[side].program, contenders[side].work, scratch) for side in (_BASE, _NEW)]
    except ProgramError as error:
        told.step(f"no profile: {error}")
        return comparison
    return replace(comparison, hotspots=hotspots(*profiles))


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
