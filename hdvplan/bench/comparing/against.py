"""Measure two programs in the same job: pairs of fresh processes that take turns, and a repeat before anything but a fine verdict."""

from __future__ import annotations

import shutil
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from time import monotonic
from uuid import uuid4

from hdvplan.bench import PATIENCE_S, TIME_LIMIT_S
from hdvplan.bench.comparing.checkout import checkout
from hdvplan.bench.comparing.compare import Comparison, compare, failed
from hdvplan.bench.comparing.counters import Tolerance
from hdvplan.bench.comparing.decision import FEWEST, LOOKS, GateVerdict, Rule
from hdvplan.bench.comparing.environment import base_named, base_program, cache_folder, new_program
from hdvplan.bench.comparing.processes import Scratch, Started, Turns, in_turn, scratch_folder, shared_cores
from hdvplan.bench.comparing.programs import Home, Program, ProgramError, UnreachedError
from hdvplan.bench.comparing.sides import COLD, COMPARISON, LOAD, MACHINE, read_side
from hdvplan.bench.comparing.words import verdict_line
from hdvplan.bench.comparing.work import ABOUT, CommandWork, SuiteWork, Work, has_files, placed, refuse_nothing, suite_entries, suite_text
from hdvplan.bench.suite import Suite
from hdvplan.errors import MeasurementError, OptionError
from hdvplan.fileio import json_bytes, locked, write_atomically
from hdvplan.machine import load_average, machine_facts, machine_words
from hdvplan.process import ended_by_signals
from hdvplan.texts import encoded

# Two roads, both kinds of vehicles, both schemes, the default solver: half a second of driving, so that six rounds are
# quick and a process takes 4 s, most of which is its start.
SUITE: Mapping[str, object] = {"roads": ("uturn", "monaco_fairmont_hairpin"), "solvers": ("riccati",), "rounds": 6}
SIDES = ("base", "new")
REPORTS = ("comparison.json", "junit.xml", "benchmark.json", "bencher.json", "summary.md", "suite.toml")  # beside the sides' folders
WARM = "warm"  # of a process that does its work once before, and of the home that it leaves


class _SideError(Exception):
    """The program of one side failed."""

    def __init__(self, side: str, error: ProgramError) -> None:
        super().__init__(str(error))
        self.side, self.error = side, error


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
    strict: bool = False
    patience: float = PATIENCE_S
    time_limit: float = TIME_LIMIT_S


@dataclass(frozen=True)
class Listener:
    """Who wants to hear how a comparison goes on."""

    step: Callable[[str], None]  # what is being done, in words
    progress: Callable[[float], None]  # the done share of the measurement


@dataclass(frozen=True)
class _Measuring:
    """Two programs that are measured: where, how, and the last process of each."""

    sides: Mapping[str, Contender]
    settings: Settings
    out: Path
    scratch: Scratch
    begun: dict[str, tuple[Started, Path]] = field(default_factory=dict)
    name: str = field(default_factory=lambda: uuid4().hex)

    def home(self, side: str, name: str = "") -> Home:
        """Return where a process has its home: each side has one that stays; that of a cold process is empty."""
        return Home(self.scratch.folder / f"home-{side}" / (name if COLD in name else WARM), self.settings.time_limit)

    def begin(self, side: str, name: str, turns: Turns | None = None) -> Started:
        """Start a process of one side, which measures into its folder ``name``."""
        target, one = self.out / side / name, self.sides[side]
        with _blamed(side):
            command = one.work.command(one.program, target, warm=turns is None)
            self.begun[side] = one.program.start(command, self.scratch, self.home(side, name), turns), target
        return self.begun[side][0]

    def complete(self) -> None:
        """Wait for both; the base first: of what fails on both sides the new one is not to blame."""
        for side in SIDES:
            started, target = self.begun[side]
            with _blamed(side):
                ended = self.sides[side].program.finish(started)
                self.sides[side].work.keep(ended, target)
            load = load_average()
            if target.is_dir():
                about = {**ended.spent, LOAD: load[0] if load else None, MACHINE: machine_facts(), COMPARISON: self.name}
                write_atomically(target / ABOUT, json_bytes(about))

    def warm_up(self) -> Sequence[str]:
        """Run both once, at the same time, and return where pairs of processes go: cold ones too if any side keeps files in its home."""
        for side in SIDES:
            self.begin(side, WARM)
        self.complete()
        for side in SIDES:
            shutil.rmtree(self.out / side / WARM, ignore_errors=True)
        return [f"{COLD}/", ""] if any(self.home(side).is_used for side in SIDES) else [""]

    def pair(self, number: int, kinds: Sequence[str]) -> None:
        """Measure a pair of processes of each kind, which take turns; in every second one the new side begins."""
        cores = shared_cores(one_is_enough=all(one.work.on_one_thread for one in self.sides.values()))
        for kind in kinds:
            turns = Turns(cores[number % len(cores)])
            in_turn(self.begin(side, f"{kind}{number:02d}", turns) for side in (SIDES if number % 2 == 0 else reversed(SIDES)))
            self.complete()


def measure_against(base: Contender, new: Contender, settings: Settings, out: Path, scratch: Scratch, listener: Listener) -> Comparison:
    """Return the comparison of two programs, measured into ``out``/base and ``out``/new.

    Both do their work once before, so that what a program compiles or loads but once is there. Then pairs of fresh processes follow, on
    one core if that is enough for both. It is decided after five pairs if all is fine, else after ten; while noise hides the answer, after
    as many again, within the patience. A program that fails ends it: a new one that fails beside a base that does not is a regression.

    Raises:
        OptionError: ``out`` holds something else, or neither program can use what it is given.
        OSError: ``out`` cannot be written.

    """
    for side in SIDES:
        _clear(out / side)
    began, measuring = monotonic(), _Measuring(dict(zip(SIDES, (base, new), strict=True)), settings, out, scratch)
    try:
        kinds = measuring.warm_up()
        if len(kinds) > 1:
            listener.step("a side keeps files in its home folder: it is measured with an empty one too")
        for done in range(1, LOOKS[-1] + 1):
            measuring.pair(done - 1, kinds)
            listener.progress(min(done / LOOKS[1], 1.0))
            left = settings.patience - (monotonic() - began)
            impatient = done >= LOOKS[1] and left <= 0.0
            if done in LOOKS or impatient:
                found = compared(out, settings)
                if _is_answer(found) or impatient:
                    return found
                if done >= LOOKS[1]:
                    listener.step(f"{verdict_line(found, settings.rule)}; measuring on, for at most {left:.0f} s")
    except _SideError as failure:
        side, error = failure.side, failure.error
        if side == SIDES[0] and _fails_too(measuring.begun.get(SIDES[1]), new):
            raise _neither(error) from error
        return failed(side, str(error), error.tail)
    return found


def _is_answer(found: Comparison) -> bool:
    """Tell whether more pairs would change nothing. Once there are enough to prove something, an answer may leave noise elsewhere."""
    return found.failure is not None or found.is_settled or (found.processes >= FEWEST and found.verdict is not GateVerdict.UNMEASURABLE)


@contextmanager
def _blamed(side: str) -> Iterator[None]:
    """Say of a program that fails in the block which side it is."""
    try:
        yield
    except ProgramError as error:
        raise _SideError(side, error) from error


def compared(out: Path, settings: Settings) -> Comparison:
    """Return the comparison of what is in ``out``; a side that cannot be read is one that failed."""
    sides = {}
    for side in SIDES:
        try:
            sides[side] = read_side(out / side)
        except OptionError as error:  # what was measured a moment ago: its program wrote something else
            return failed(side, str(error), "")
    base, new = (sides[side] for side in SIDES)
    return compare(base, new, settings.rule, Tolerance(), expect_changes=settings.expect_changes, strict=settings.strict)


def _neither(failure: MeasurementError) -> OptionError:
    """Return the refusal of what no side can do, with the failure of the base."""
    return OptionError(f"neither side can be measured: {failure}", hint=failure.hint)


def _fails_too(begun: tuple[Started, Path] | None, new: Contender) -> bool:
    """Tell whether the other program fails as well: then what was asked for is wrong, not a program."""
    if begun is None:
        return False
    try:
        new.work.keep(new.program.finish(begun[0]), begun[1])
    except ProgramError:
        return True
    return False


def _clear(folder: Path) -> None:
    if not folder.exists():
        return
    if not folder.is_dir() or any(not (entry.name.isdigit() or entry.name in {WARM, COLD}) for entry in folder.iterdir()):
        msg = f"{folder} holds files that are not of an earlier comparison"
        raise OptionError(msg, hint="choose another folder with --out")
    shutil.rmtree(folder)


def guard(against: str, work: Suite | CommandWork, settings: Settings, out: Path, listener: Listener) -> Comparison:
    """Return the comparison of what ``against`` names with what is here; measured into ``out``.

    However it ends, also by signals, its processes and temporary files are removed; after SIGKILL by the next comparison. What stays is
    ``out``, and revisions in the user's cache. The reports of an earlier comparison go first, so that none is taken for this one's.

    Raises:
        OptionError: ``against`` names nothing, ``out`` holds something else or is in use, the checkout cannot be read, or nothing of it
            is measured.
        OSError: ``out`` cannot be written.

    """
    with ended_by_signals(), scratch_folder() as scratch:
        here = checkout(work.extras if isinstance(work, CommandWork) else ())
        named = base_named(against, here)
        if named.commit is not None and here is not None and isinstance(work, Suite):
            refuse_nothing(here, work)
            if has_files(work):
                listener.step("files of roads and vehicles are the working tree's on both sides")
        cache = cache_folder(scratch)
        out.mkdir(parents=True, exist_ok=True)
        with locked(out, wait=False) as is_ours:
            if not is_ours:
                msg = f"another comparison measures into {out}"
                raise OptionError(msg, hint="choose another folder with --out")
            for report in REPORTS:
                (out / report).unlink(missing_ok=True)
            if isinstance(work, Suite):
                (out / "suite.toml").write_bytes(encoded(suite_text(suite_entries(placed(work), work.to_dict()))))
            return _compared(
                lambda: base_program(named, here, scratch, cache, listener.step),
                lambda: new_program(named, here, scratch, cache, listener.step, out),
                work, settings, out.absolute(), scratch, listener,
            )  # fmt: skip


def _compared(
    base: Callable[[], Program], new: Callable[[], Program], work: Suite | CommandWork, settings: Settings, out: Path, scratch: Scratch,
    listener: Listener,
) -> Comparison:  # fmt: skip
    """Make both programs ready, measure them into ``out`` and compare; whichever is not ready is a failure."""
    contenders, failures = list[Contender](), list[tuple[str, MeasurementError]]()
    for side, made in zip(SIDES, (base, new), strict=True):
        try:
            program = made()
            contenders.append(Contender(program, _work(program, work, scratch, side)))
        except UnreachedError as error:
            return failed(side, str(error), error.tail, blameless=True)
        except MeasurementError as error:
            failures.append((side, error))
    if not contenders:
        raise _neither(failures[0][1])
    if failures:
        (side, failure), *_ = failures
        return failed(side, str(failure), failure.tail if isinstance(failure, ProgramError) else "")
    old, now = contenders
    about = f"base: {old.program.name}; new: {now.program.name}"
    listener.step(about)
    found = measure_against(old, now, settings, out, scratch, listener)
    return replace(found, about=f"{about}; both on {machine_words(machine_facts())}")


def _work(program: Program, wanted: Suite | CommandWork, scratch: Scratch, side: str) -> Work:
    """Return the work of one side; a suite is written out in full, so that no side's defaults count."""
    if isinstance(wanted, CommandWork):
        return wanted
    file = scratch.folder / f"{side}.toml"
    file.write_bytes(encoded(suite_text(suite_entries(placed(wanted), program.suite_defaults(scratch)))))
    return SuiteWork(file)
