"""Options of ``hdvplan bench``. Only Typer is imported here: ``--help`` stays quick."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.help import OUTPUT

_WHAT, _LIMITS, _HOW, _COMPARE = "What to measure", "Limits", "How to measure", "Comparison"  # groups of options

SolversOption = Annotated[
    str | None,
    typer.Option(
        "--solvers",
        metavar="A,B",
        help="Names from `hdvplan solvers`, or your own: file.py:Class.",
        autocompletion=completion.solver_list,
        rich_help_panel=_WHAT,
    ),
]
VehiclesOption = Annotated[
    str | None,
    typer.Option(
        "--vehicles",
        metavar="A,B",
        help="Names from `hdvplan vehicles list`, or vehicle files.",
        autocompletion=completion.vehicle_list,
        rich_help_panel=_WHAT,
    ),
]
RoadsOption = Annotated[
    str | None,
    typer.Option(
        "--roads",
        metavar="A,B",
        help="Names from `hdvplan roads list`, or road files.",
        autocompletion=completion.road_list,
        rich_help_panel=_WHAT,
    ),
]
SchemesOption = Annotated[
    str | None,
    typer.Option(
        "--schemes",
        metavar="rti,sqp",
        help="rti: the real-time iteration, one QP a step; sqp: QPs to convergence.",
        rich_help_panel=_WHAT,
    ),
]
ObjectiveOption = Annotated[
    str | None,
    typer.Option("--objective", metavar="NAME", help="What all plans centre, as in `plan` [default: geometric].", rich_help_panel=_WHAT),
]
SuiteOption = Annotated[
    Path | None,
    typer.Option("--suite", metavar="FILE.toml", help="Read settings from a file; options override them.", rich_help_panel=_WHAT),
]
HalfWidthOption = Annotated[
    float | None,
    typer.Option("--half-width", metavar="M", help="Limits at M to either side of the line [m].", rich_help_panel=_LIMITS),
]
SlackOption = Annotated[
    float | None,
    typer.Option("--slack", metavar="M", help="Limits this far beyond the geometric half width [m].", rich_help_panel=_LIMITS),
]
NoLimitsOption = Annotated[bool, typer.Option("--no-limits", help="Plan without limits.", rich_help_panel=_LIMITS)]
PinchOption = Annotated[
    float | None,
    typer.Option(
        "--pinch",
        metavar="M",
        help="Move the outer limit of the tightest bend inwards over 6 m of road [m].",
        rich_help_panel=_LIMITS,
    ),
]
ClassesOption = Annotated[
    str | None,
    typer.Option(
        "--classes",
        metavar="A,B",
        help="Measure classes of limits side by side: off, inactive, binding, unkeepable.",
        rich_help_panel=_LIMITS,
    ),
]
RoundsOption = Annotated[int | None, typer.Option("--rounds", metavar="N", help="How often every cell is driven.", rich_help_panel=_HOW)]
AccuracyOption = Annotated[
    float | None,
    typer.Option(
        "--accuracy",
        metavar="M",
        help="Give every solver the loosest tolerance that keeps the path this near the optimum [m].",
        rich_help_panel=_HOW,
    ),
]
SampleOption = Annotated[
    int | None,
    typer.Option("--sample", metavar="N", help="Solve N recorded QPs of every drive instead of driving.", rich_help_panel=_HOW),
]
HorizonOption = Annotated[
    float | None, typer.Option("--horizon", metavar="M", help="How far each plan looks ahead [m].", rich_help_panel=_HOW)
]
StepOption = Annotated[float | None, typer.Option("--step", metavar="M", help="Distance between stations [m].", rich_help_panel=_HOW)]
ReplanOption = Annotated[
    float | None, typer.Option("--replan", metavar="M", help="Distance driven before the next plan [m].", rich_help_panel=_HOW)
]
BudgetOption = Annotated[
    float | None, typer.Option("--budget", metavar="S", help="Most planning time of one drive [s].", rich_help_panel=_HOW)
]
StepLimitOption = Annotated[
    float | None,
    typer.Option("--step-limit", metavar="S", help="Longest planning step; a longer one ends its cell [s].", rich_help_panel=_HOW),
]
CellLimitOption = Annotated[
    float | None,
    typer.Option(
        "--cell-limit",
        metavar="S",
        help="Longest drive, including its check by the reference; a longer one is ended [s].",
        rich_help_panel=_HOW,
    ),
]
MemoryLimitOption = Annotated[
    float | None,
    typer.Option(
        "--memory-limit",
        metavar="GB",
        help="Most memory of the measuring process, where the system can limit it.",
        rich_help_panel=_HOW,
    ),
]
InProcessOption = Annotated[
    bool,
    typer.Option(
        "--in-process",
        help="Measure in this process: of the limits only --budget applies, and a crash ends the run.",
        rich_help_panel=_HOW,
    ),
]
AgainstOption = Annotated[
    str | None,
    typer.Option(
        "--against",
        metavar="REV",
        help="Measure in alternation with a revision, a release (hdvplan==X) or another interpreter, and compare.",
        rich_help_panel=_COMPARE,
    ),
]
CommandOption = Annotated[
    str | None,
    typer.Option(
        "--command",
        metavar="CMD",
        help="With --against: measure your own command, which prints planning times as JSON.",
        rich_help_panel=_COMPARE,
    ),
]
CountersOption = Annotated[
    Path | None,
    typer.Option(
        "--counters",
        metavar="FILE.csv",
        help="Compare iterations, sizes and envelopes with a committed baseline.",
        rich_help_panel=_COMPARE,
    ),
]
RenewOption = Annotated[bool, typer.Option("--renew", help="Write FILE.csv of --counters instead of comparing.", rich_help_panel=_COMPARE)]
OutOption = Annotated[
    Path,
    typer.Option("--out", metavar="DIR", help="Where to write, and where a stopped run continues.", rich_help_panel=OUTPUT),
]
FreshOption = Annotated[bool, typer.Option("--fresh", help="Delete what an earlier run has left in DIR.", rich_help_panel=OUTPUT)]
PlotOption = Annotated[
    str | None,
    typer.Option(
        "--plot",
        metavar="[FILE]",
        help="Draw the run [default file: DIR/bench.png]: png, pdf, svg; tex, pgf: performance profiles as TikZ.",
        rich_help_panel=OUTPUT,
    ),
]
ExportQpsOption = Annotated[
    Path | None,
    typer.Option(
        "--export-qps",
        metavar="DIR",
        help="Measure nothing: write the QPs of all drives as a test set for solvers, in qpbenchmark's format.",
        rich_help_panel=OUTPUT,
    ),
]
