"""Options of ``hdvplan bench`` besides those of its suite. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from hdvplan.bench import ENVELOPE_M, FACTOR, FLOOR_S, PATIENCE_S, TIME_LIMIT_S
from hdvplan.errors import OptionError
from hdvplan.report import PICTURES
from hdvplan.settings import Setting, choice

if TYPE_CHECKING:
    from collections.abc import Mapping

    from hdvplan.bench.comparing.against import Settings

_MEASURES = ("step_limit", "cell_limit", "memory_limit")  # that need a process which can be ended


@dataclass(frozen=True)
class Decision:
    """What a regression is."""

    factor: Annotated[float, Setting("A cell that takes more than X times as long has regressed.", "X")] = FACTOR
    floor: Annotated[float, Setting("Smaller differences of the mean planning step do not count [ms].", "MS")] = 1e3 * FLOOR_S
    envelope_tolerance: Annotated[float, Setting("Envelopes that differ by less are equal [m].", "M")] = ENVELOPE_M
    expect_changes: Annotated[bool, Setting("Show changed counters and envelopes, but do not count them as a regression.")] = False
    patience: Annotated[float, Setting("Where noise hides the answer, measure on for so long [s].", "S")] = PATIENCE_S
    time_limit: Annotated[float, Setting("A process that takes longer is ended, and named [s].", "S")] = TIME_LIMIT_S

    def settings(self) -> Settings:
        """Return how two programs, or runs, are compared; an ``OptionError`` where a value is outside its range."""
        from hdvplan.bench.comparing.against import Settings
        from hdvplan.bench.comparing.decision import Rule

        for name, seconds in (("--patience", self.patience), ("--time-limit", self.time_limit)):
            if not seconds >= 0.0 or (seconds == 0.0 and name == "--time-limit"):
                msg = f"{name} must be a positive number of seconds, not {seconds:g}"
                raise OptionError(msg)
        return Settings(Rule(self.factor, 1e-3 * self.floor), self.expect_changes, patience=self.patience, time_limit=self.time_limit)

    def words(self) -> list[str]:
        """Return the options that make another decision than the usual one."""
        usual, numbers = Decision(), ("factor", "floor", "patience", "time_limit")
        changed = [name for name in numbers if getattr(self, name) != getattr(usual, name)]
        words = [word for name in changed for word in (f"--{name.replace('_', '-')}", f"{getattr(self, name):g}")]
        return words + ["--expect-changes"] * self.expect_changes


@dataclass(frozen=True)
class Report:
    """How a comparison is told."""

    reports: Annotated[Path | None, Setting("Also write the comparison as JSON, JUnit XML, Markdown and for dashboards.", "DIR")] = None
    format_: Annotated[
        str,
        Setting("github: an annotation on stdout, tables in the step summary.", names=("--format",), choices=("text", "github")),
    ] = "text"
    json: Annotated[bool, Setting("Write JSON to stdout, and nothing else.")] = False
    quiet: Annotated[bool, Setting("No progress, notes or tables; errors remain.")] = False


@dataclass(frozen=True)
class BenchOptions:
    """What a benchmark does besides measuring its suite."""

    suite: Annotated[Path | None, Setting("Read settings from a file; options override them.", "FILE.toml")] = None
    no_limits: Annotated[bool, Setting("Plan without limits.")] = False
    in_process: Annotated[bool, Setting("Measure in this process: of the limits only --budget applies, and a crash ends the run.")] = False
    against: Annotated[
        str | None,
        Setting("Measure in alternation with a revision, a release (hdvplan==X) or another interpreter, and compare.", "REV"),
    ] = None
    command: Annotated[str | None, Setting("With --against: measure your own command, which prints planning times as JSON.", "CMD")] = None
    extras: Annotated[str | None, Setting("With --command: install these extras of the project, too, on both sides.", "NAME,...")] = None
    counters: Annotated[Path | None, Setting("Compare iterations, sizes and envelopes with a committed baseline.", "FILE.csv")] = None
    renew: Annotated[bool, Setting("Write FILE.csv of --counters instead of comparing.")] = False
    strict: Annotated[
        bool, Setting("End with exit code 1 if a cell is not ok; with --against with 3 if noise could hide a change of anything.")
    ] = False

    def check(self, files: BenchFiles, given: Mapping[str, object], decision: Decision) -> None:
        """Refuse, by an ``OptionError``, options that contradict each other; ``given`` are those of the suite."""
        if files.plot is not None:
            choice("the picture's ending", Path(files.plot).suffix.lower().removeprefix("."), PICTURES)
        compared = self.against is not None
        for contradictory, words, hint in (
            (compared and files.plot is not None, "--plot draws one benchmark, and --against measures several", "leave out --plot"),
            (
                not compared and (decision != Decision() or self.command is not None),
                "--factor, --floor, --expect-changes, --patience, --time-limit and --command need --against",
                None,
            ),
            (self.extras is not None and self.command is None, "--extras needs --command", None),
            (self.renew and self.counters is None, "--renew needs --counters", None),
            (
                self.strict and (self.counters is not None or files.export_qps is not None),
                "--strict speaks of a benchmark's own cells, or of --against: with --counters and --export-qps exit codes say more",
                "leave out --strict",
            ),
            (
                compared and self.counters is not None,
                "--against compares counters with those of REV, not with a file",
                "leave out --counters",
            ),
            (
                self.in_process and any(name in given for name in _MEASURES),
                "--step-limit, --cell-limit and --memory-limit need a process that can be ended",
                "leave out --in-process",
            ),
            (
                files.export_qps is not None and (compared or self.counters is not None or files.plot is not None),
                "--export-qps measures nothing, so --against, --counters and --plot do not apply",
                "leave them out",
            ),
        ):
            if contradictory:
                raise OptionError(words, hint=hint)


@dataclass(frozen=True)
class BenchFiles:
    """What a benchmark writes."""

    out: Annotated[Path, Setting("Where to write, and where a stopped run continues.", "DIR")] = Path("hdvplan-bench")
    fresh: Annotated[bool, Setting("Delete what an earlier run has left in DIR.")] = False
    plot: Annotated[
        str | None,
        Setting("Draw the run [default file: DIR/bench.png]: png, pdf, svg.", "[FILE]"),
    ] = None
    export_qps: Annotated[Path | None, Setting("Measure nothing: write the QPs of the drives of the first of --solvers.", "DIR")] = None
    qp_format: Annotated[
        str,
        Setting(
            "Of --export-qps: matrices, dense (needs pyarrow, of the extra study) or sparse, or stages.",
            choices=("qpbenchmark", "npz", "acados"),
        ),
    ] = "qpbenchmark"
