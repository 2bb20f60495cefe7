"""Options of ``hdvplan bench``. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from hdvplan.cli import completion
from hdvplan.cli.help import OUTPUT


def _option(group: str, name: str, metavar: str | None, words: str, complete: Callable[..., Any] | None = None) -> Any:  # noqa: ANN401 - Typer's
    return typer.Option(name, metavar=metavar, help=words, autocompletion=complete, rich_help_panel=group)


_what, _limits = partial(_option, "What to measure"), partial(_option, "Limits")
_how, _compare, _output = partial(_option, "How to measure"), partial(_option, "Comparison"), partial(_option, OUTPUT)

Solvers = Annotated[
    str | None, _what("--solvers", "A,B", "Names from `hdvplan solvers`, or your own: file.py:Class.", completion.solver_list)
]
Vehicles = Annotated[
    str | None, _what("--vehicles", "A,B", "Names from `hdvplan vehicles list`, or vehicle files.", completion.vehicle_list)
]
Roads = Annotated[str | None, _what("--roads", "A,B", "Names from `hdvplan roads list`, or road files.", completion.road_list)]
Schemes = Annotated[str | None, _what("--schemes", "rti,sqp", "rti: the real-time iteration, one QP a step; sqp: QPs to convergence.")]
Objective = Annotated[str | None, _what("--objective", "NAME", "What all plans centre, as in `plan` [default: geometric].")]
Suite = Annotated[Path | None, _what("--suite", "FILE.toml", "Read settings from a file; options override them.")]
HalfWidth = Annotated[float | None, _limits("--half-width", "M", "Limits at M to either side of the line [m].")]
Slack = Annotated[float | None, _limits("--slack", "M", "Limits this far beyond the geometric half width [m].")]
NoLimits = Annotated[bool, _limits("--no-limits", None, "Plan without limits.")]
Pinch = Annotated[float | None, _limits("--pinch", "M", "Move the outer limit of the tightest bend inwards over 6 m of road [m].")]
Classes = Annotated[str | None, _limits("--classes", "A,B", "Measure classes of limits side by side: off, inactive, binding, unkeepable.")]
Rounds = Annotated[int | None, _how("--rounds", "N", "How often every cell is driven.")]
Accuracy = Annotated[
    float | None, _how("--accuracy", "M", "Give every solver the loosest tolerance that keeps the path this near the optimum [m].")
]
Sample = Annotated[int | None, _how("--sample", "N", "Solve N recorded QPs of every drive instead of driving.")]
Horizon = Annotated[float | None, _how("--horizon", "M", "How far each plan looks ahead [m].")]
Step = Annotated[float | None, _how("--step", "M", "Distance between stations [m].")]
Replan = Annotated[float | None, _how("--replan", "M", "Distance driven before the next plan [m].")]
Budget = Annotated[float | None, _how("--budget", "S", "Most planning time of one drive [s].")]
StepLimit = Annotated[float | None, _how("--step-limit", "S", "Longest planning step; a longer one ends its cell [s].")]
CellLimit = Annotated[
    float | None, _how("--cell-limit", "S", "Longest drive, including its check by the reference; a longer one is ended [s].")
]
MemoryLimit = Annotated[float | None, _how("--memory-limit", "GB", "Most memory of the measuring process, where the system can limit it.")]
InProcess = Annotated[
    bool, _how("--in-process", None, "Measure in this process: of the limits only --budget applies, and a crash ends the run.")
]
Against = Annotated[
    str | None,
    _compare("--against", "REV", "Measure in alternation with a revision, a release (hdvplan==X) or another interpreter, and compare."),
]
Command = Annotated[
    str | None, _compare("--command", "CMD", "With --against: measure your own command, which prints planning times as JSON.")
]
Counters = Annotated[Path | None, _compare("--counters", "FILE.csv", "Compare iterations, sizes and envelopes with a committed baseline.")]
Renew = Annotated[bool, _compare("--renew", None, "Write FILE.csv of --counters instead of comparing.")]
Out = Annotated[Path, _output("--out", "DIR", "Where to write, and where a stopped run continues.")]
Fresh = Annotated[bool, _output("--fresh", None, "Delete what an earlier run has left in DIR.")]
Plot = Annotated[
    str | None,
    _output("--plot", "[FILE]", "Draw the run [default file: DIR/bench.png]: png, pdf, svg; tex, pgf: performance profiles as TikZ."),
]
ExportQps = Annotated[
    Path | None,
    _output("--export-qps", "DIR", "Measure nothing: write the QPs of all drives as a test set for solvers, in qpbenchmark's format."),
]
