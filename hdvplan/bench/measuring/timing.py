"""Tables of a benchmark as Markdown, LaTeX and for the terminal. Values in, text out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd
from rich.table import Table
from rich.text import Text

from hdvplan.bench.measuring.ranking import Finding, Load, group_words, how_ranked, scheme_ratios, unit_of
from hdvplan.bench.measuring.referee import DUAL, PRIMAL_M
from hdvplan.bench.measuring.samples import OK, WRONG, WRONG_PATH
from hdvplan.bench.measuring.stats import SOME_REFUSED, SOME_UNSOLVED, Tables, reference_solver
from hdvplan.bench.suite import AS_SET, CLASSES, GROUP, Suite, cell_words, tuning_key
from hdvplan.report.grid import grid, markdown_table
from hdvplan.solvers.registry import settings_of, tolerance_of

_TEXT = ("road", "vehicle", "scheme", "solver", "limits", "status")
_ALWAYS = "limits"  # the column that is shown only where a benchmark has classes of them
_MS, _M, _TINY, _COUNT, _RATIO, _MEAN = "{:.3f}", "{:.3f}", "{:.1e}", "{:.0f}", "{:.2f}", "{:.1f}"
_WORDS, _PERCENT = "{}", "{:.1%}"
_LATEX = {letter: f"\\{letter}" for letter in "_%&#${}"} | {
    "\\": r"\textbackslash{}", "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"$<$", ">": r"$>$",
}  # fmt: skip
_RANKED = {"step_ms": ("step", _MS), "median_ms": ("median", _MS), "worst_ms": ("worst", _MS)}

# Of every table the columns that are shown, with heading and format; the CSV files have all.
LAYOUTS: Mapping[str, Mapping[str, tuple[str, str]]] = {
    "timing": {
        **{name: (name, _WORDS) for name in _TEXT},
        **_RANKED,
        "success": ("accepted", _PERCENT),
        "distance_m": ("off the optimum [m]", _TINY),
        **{f"{name}_ms": (name, _MS) for name in ("mean", "p50", "p95", "p99")},
        "p99_99_ms": ("p99.99", _MS),
        "max_ms": ("max", _MS),
        "wall_per_cpu": ("clock/CPU", _RATIO),
        "fastest_mean_ms": ("fastest mean", _MS),
        "fastest_max_ms": ("fastest max", _MS),
        "cold_ms": ("cold", _MS),
        **{f"{name}_ms": (name, _MS) for name in ("linearise", "update", "solve", "check")},
        "qps_mean": ("QPs mean", _MEAN),
        "qps_max": ("QPs max", _COUNT),
        "iterations_mean": ("iterations mean", _MEAN),
        "iterations_max": ("iterations max", _COUNT),
        "steps": ("steps", _COUNT),
        "failures": ("failures", _COUNT),
        "unsolved": ("unsolved", _COUNT),
        "primal_max": ("primal residual [m]", _TINY),
        "binding_share": ("binding", _PERCENT),
        "binding_ms": ("mean where binding", _MS),
    },
    "envelope": {
        **{name: (name, _WORDS) for name in _TEXT[:-1]},
        "max_left_m": ("max left", _M),
        "max_right_m": ("max right", _M),
        "imbalance_m": ("imbalance", _M),
        "mean_abs_imbalance_m": ("mean abs imbalance", _M),
        "expected_half_width_m": ("expected half width", _M),
        "min_clearance_m": ("min clearance", _M),
        "limit_violation_m": ("violation", _M),
        "path_difference_m": ("path difference", _TINY),
    },
    "schemes": {
        **{name: (name, _WORDS) for name in ("road", "vehicle", "solver", "limits")},
        "rti_mean_ms": ("RTI mean", _MS),
        "sqp_mean_ms": ("SQP mean", _MS),
        "mean_ratio": ("ratio of means", _RATIO),
        "rti_max_ms": ("RTI max", _MS),
        "sqp_max_ms": ("SQP max", _MS),
        "max_ratio": ("ratio of max", _RATIO),
        "envelope_difference_m": ("envelopes differ [m]", _TINY),
    },
    "summary": {
        **{name: (name, _WORDS) for name in ("vehicle", "scheme", "limits", "solver")},
        "step_ms": ("step", _MS),
        "ratio": ("x best", _MEAN),
        "won": ("won", _PERCENT),
        "success": ("accepted", _PERCENT),
        "median_ms": ("median", _MS),
        "worst_ms": ("worst", _MS),
        "mean_ms": ("mean", _MS),
        "p99_ms": ("p99", _MS),
        "max_ms": ("max", _MS),
        "cold_ms": ("cold", _MS),
        **{f"{name}_ms": (name, _MS) for name in ("linearise", "update", "solve", "check")},
        "binding_ms": ("mean where binding", _MS),
        "wall_per_cpu": ("clock/CPU", _RATIO),
        "iterations_mean": ("iter", _MEAN),
        "failures": ("fail", _COUNT),
        "distance_m": ("off the optimum [m]", _TINY),
        "path_difference_m": ("path differs [m]", _TINY),
    },
}
_INACCURATE = (WRONG, WRONG_PATH, SOME_REFUSED, SOME_UNSOLVED)
_FAIR = "Each solver has its own accuracy here; to compare them at an equal one: the same command with --accuracy 1e-4 --out bench-equal"
_PATH, _OFF = "path differs [m]", "off the optimum [m]"
_HEADLINE = ("solver", "step", "x best", "won", "accepted", "median", "worst", _PATH, _OFF)


def captions(
    suite: Suite, machine: Mapping[str, object], tables: Tables, tolerances: Mapping[str, float | None] | None = None
) -> dict[str, str]:
    """Return what a reader must know to believe each table: set-up, machine, tolerances and the accuracy they led to."""
    setting = (
        f"Horizon {suite.horizon:g} m, step {suite.step:g} m, replanning every {suite.replan:g} m; {_limits(suite)}; "
        f"{suite.rounds} round{'s' * (suite.rounds > 1)}, one thread, on {machine['processor']}, {machine['python']}."
    )
    if suite.sample:
        setting = (
            f"A step is one of {suite.sample} QPs a drive, recorded and shuffled, the same for all solvers; half of them where limits "
            f"bind, as far as there are any. Warm from the reference's last solution, shifted; cold: the same QPs from zeros. {setting}"
        )
    if suite.accuracy is not None:
        setting = (
            f"Every solver at the loosest tolerance, by decades, that keeps e_y within {suite.accuracy:g} m of the optimum on a sample of "
            f"the recorded QPs. {setting}"
        )
    proof = f" (accepted: primal residual to {PRIMAL_M:g} m, dual and gap to {DUAL:g} of the largest multiplier)"
    times = (
        f"Milliseconds of one whole planning step: linearise the motion, update (gather the QP's values into the solver's own arrays), "
        f"solve (the solver's own call), check (recompute residuals, take the step). {how_ranked(suite.accuracy)}. "
        "mean, percentiles and max: by the clock, all rounds. fastest: every step counted with its fastest round; "
        "cold: a drive's first plan, in no other column. failures: steps whose recomputed primal residual forbids driving them, "
        "and drives that failed; unsolved: steps whose QP the solver itself does not call solved, usable or not; off the optimum: largest "
        f"distance of e_y from the reference's optimum of the same QP{'' if suite.accuracy else proof}. "
        f"{setting} {accuracy(tables.summary, tolerances)}"
    )
    swept = (
        "Executed envelope in metres, simulated apart from the planner. path difference: largest difference of the executed lateral "
        f"error from that with {reference_solver(suite.solvers)} under the same scheme. {setting} {accuracy(tables.summary, tolerances)}"
    )
    schemes = (
        "SQP to convergence against RTI: times in milliseconds by the clock, every step counted with its fastest round; "
        f"executed envelopes. {setting}"
    )
    return {"timing": times, "envelope": swept, "schemes": schemes, "summary": f"All roads together. {times}"}


def accuracy(summary: pd.DataFrame, tolerances: Mapping[str, float | None] | None = None) -> str:
    """Return every solver's tolerance beside the accuracy measured with it, in a sentence; ``tolerances`` where they are not its own."""
    driven = bool(summary["path_difference_m"].notna().any()) or bool(summary["distance_m"].isna().all())
    furthest = summary.groupby("solver", sort=False)["path_difference_m" if driven else "distance_m"].max()
    reference = reference_solver(list(furthest.index))
    used = {str(solver): _tolerance(str(solver), tolerances or {}) for solver in furthest.index}
    parts = [
        f"{solver} {used[str(solver)]}: "
        + (("no path to compare" if driven else "no program") if pd.isna(difference) else f"{difference:.1e} m")
        for solver, difference in furthest.items()
        if solver != reference or not driven  # a path is compared with the reference's, an optimum with that of a cold solve
    ]
    if not parts:
        return f"Tolerance of {reference}: {used[reference]}."
    what = f"path difference from {reference} ({used[reference]})" if driven else "distance of e_y from the optimum"
    return f"Tolerance, and with it the largest {what}: {'; '.join(parts)}."


def shown(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """Return the shown columns of table ``name`` as text under their headings; a dash where there is no value."""
    layout = LAYOUTS[name]
    if name == "summary":  # what refuses steps is no faster for it; what its budget stopped has all that it did accepted
        table = table.assign(ratio=table["ratio"].where(table["proved"].eq(True) | table["whole"].eq(False) & table["success"].eq(1.0)))
    plain = _ALWAYS in table and (table[_ALWAYS] == AS_SET).all()
    kept = {column: look for column, look in layout.items() if not (plain and column == _ALWAYS)}
    return pd.DataFrame({heading: [_text(value, form) for value in table[column]] for column, (heading, form) in kept.items()}, dtype=str)


def _text(value: Any, form: str) -> str:  # noqa: ANN401 - of any column
    return "-" if pd.isna(value) or value == "" else form.format(value)


def markdown(table: pd.DataFrame, name: str, caption: str, foot: Sequence[str]) -> str:
    """Return a table as Markdown, with its caption above and its foot below."""
    below = "".join(f"- {line}\n" for line in foot)
    return f"{caption}\n\n{markdown_table(shown(table, name), text=_TEXT)}\n" + (f"\n{below}" if below else "")


_NARROWED = r"\resizebox{\ifdim\width>\linewidth\linewidth\else\width\fi}{!}{"  # only where it would be too wide


def latex(table: pd.DataFrame, name: str, caption: str, foot: Sequence[str]) -> str:
    """Return a table as a LaTeX ``table``, its foot in small print; of the summary what a page has room for.

    It needs the packages booktabs, and graphicx: a table that is wider than a line is narrowed.
    """
    text = shown(table, name)
    if name == "summary":
        text = text[[column for column in text.columns if column in {*GROUP, *_HEADLINE}]]
    sides = "".join("l" if column in _TEXT else "r" for column in text.columns)
    made = text.to_latex(index=False, escape=True, column_format=sides, caption=latex_escaped(caption), label=f"tab:hdvplan-{name}")
    below = "".join(f"\\par\\footnotesize {latex_escaped(line)}\n" for line in foot)
    made = made.replace("\\begin{tabular}", f"{_NARROWED}\\begin{{tabular}}").replace("\\end{tabular}", "\\end{tabular}}")
    return made.replace("\\end{table}", f"{below}\\end{{table}}")


def foot_of(
    suite: Suite, tolerances: Mapping[str, float | None], findings: Sequence[Finding], load: Load, timing: pd.DataFrame
) -> list[str]:
    """Return what stands below every table: what disturbed the machine or was not tuned, verdicts, settings of solvers, and failures."""
    texts = [finding.text for finding in findings]
    settings = [settings_words(solver, tolerances) for solver in suite.solvers]
    return [*([load.warning] if load.warning else []), *untuned(suite, tolerances, timing), *texts, *settings, *reasons_of(timing)]


def untuned(suite: Suite, tolerances: Mapping[str, float | None], timing: pd.DataFrame) -> list[str]:
    """Return a warning for each class of limits in which solvers miss the accuracy that the suite asks for, or have their own tolerances.

    ``tolerances`` as ``hdvplan.bench.measuring.tuning.tuned`` returns them.
    """
    found: list[str] = []
    if suite.accuracy is None:
        return found
    for limits in suite.classes or (AS_SET,):
        where = "" if limits == AS_SET else f", limits {limits}"
        keys = {tuning_key(solver, limits): solver for solver in suite.solvers}
        bad = set(timing.loc[(timing["limits"] == limits) & timing["status"].isin(_INACCURATE), "solver"])
        if missed := [f"{solver} at {tolerances[key]:g}" for key, solver in keys.items() if solver in bad and tolerances.get(key)]:
            found.append(
                f"TUNING MISSED{where}: {', '.join(missed)}; more was measured than was tuned on: "
                f"measure again with --accuracy {suite.accuracy / 10.0:g}"
            )
        if not any(key in tolerances for key in keys):
            found.append(
                f"NOT TUNED{where}: the reference can drive none of the courses that were tried, so all solvers "
                "run at their own tolerances, and their accuracies differ"
            )
        elif own := [solver for key, solver in keys.items() if tolerances[key] is None]:
            found.append(f"NOT TUNED{where}: {', '.join(own)}; no tolerance meets {suite.accuracy:g} m, or the solver takes no tolerance")
    return found


def reasons_of(timing: pd.DataFrame) -> list[str]:
    """Return why cells are not ok: of every solver and status how many they are, and the reason of the first."""
    bad, found = timing[timing["status"] != OK], []
    for solver, status in dict.fromkeys(bad[["solver", "status"]].itertuples(index=False, name=None)):
        cells = bad[(bad["solver"] == solver) & (bad["status"] == status)]
        where = cell_words(tuple(map(str, cells[["road", *GROUP]].iloc[0])), ", ")
        count = f"{len(cells)} of {int((timing['solver'] == solver).sum())} cells"
        found.append(f"{solver}, {status} in {count}; {where}: {cells['message'].iloc[0]}")
    return found


def summary_tables(tables: Mapping[str, pd.DataFrame], tolerances: Mapping[str, float | None] | None = None) -> list[Table]:
    """Return the headline for the terminal: per vehicle, scheme and class of limits, then RTI against SQP where both were run."""
    summary, schemes = tables["summary"], tables["schemes"]
    found, one = [], "one QP" if unit_of(summary) == "QP" else "one planning step"
    for key, mine in summary.groupby(GROUP, sort=False):
        headings = [name for name in _HEADLINE if name != (_OFF if mine["path_difference_m"].notna().any() else _PATH)]
        text = shown(mine, "summary")[headings]
        for column in ("won", "accepted"):
            text[column] = text[column].str.replace(".0%", "%")
        ended = int((mine["cells"] - mine["cells_ok"]).sum())
        caption = f"{ended} of {int(mine['cells'].sum())} cells are not ok." if ended else None
        title = f"{group_words(*map(str, key))}: {one} [ms], all roads together"
        found.append(grid(title, list(text.columns), text.itertuples(index=False, name=None), text=_TEXT, caption=caption))
    if len(schemes):
        named = ["vehicle", "solver"] if (schemes[_ALWAYS] == AS_SET).all() else ["vehicle", "solver", _ALWAYS]
        differ = schemes.groupby(named, sort=False)["envelope_difference_m"].max()
        pooled = scheme_ratios(summary, named).join(differ).reindex(differ.index)
        rows = [(*key, *map(_text, own, (_RATIO, _RATIO, _TINY))) for key, own in zip(pooled.index, pooled.to_numpy(), strict=True)]
        found.append(grid(f"SQP / RTI: {one} as above", (*named, "step", "worst", "envelopes differ [m]"), rows, text=_TEXT))
    before = f"{found[-1].caption}\n" if found[-1].caption else ""
    fair = "" if tolerances or summary["solver"].nunique() < 2 else f"\n{_FAIR}"  # noqa: PLR2004 - nothing to compare
    found[-1].caption = Text(f"{before}{accuracy(summary, tolerances)}{fair}")
    found[-1].caption_justify, found[-1].caption_style = "left", ""
    return found


def _limits(suite: Suite) -> str:
    if suite.classes:
        return "classes of limits: " + "; ".join(f"{name}: {CLASSES[name]}" for name in suite.classes)
    if not suite.limits:
        return "no limits"
    place = f"{suite.slack:g} m beyond the geometric half width" if suite.half_width is None else f"at +-{suite.half_width:g} m"
    return f"limits {place}" + ("" if suite.pinch is None else f", pinched by {suite.pinch:g} m in the tightest bend")


def settings_words(solver: str, tolerances: Mapping[str, float | None]) -> str:
    """Return a solver's version and settings, and the tolerances that an accuracy has led to."""
    return settings_of(solver) + (f"; here {words}" if (words := _tuned(solver, tolerances)) else "")


def _tuned(solver: str, tolerances: Mapping[str, float | None]) -> str:
    """Return a solver's tolerances by class of limits, in words; nothing where it runs with its own."""
    mine = {limits: tolerances[key] for limits in (AS_SET, *CLASSES) if (key := tuning_key(solver, limits)) in tolerances}
    parts = [f"{'its own' if one is None else f'{one:g}'}{'' if limits == AS_SET else f' ({limits})'}" for limits, one in mine.items()]
    return f"at {', '.join(parts)}" if any(one is not None for one in mine.values()) else ""


def _tolerance(solver: str, tolerances: Mapping[str, float | None]) -> str:
    own = tolerance_of(solver)
    return _tuned(solver, tolerances) or ("at its default" if own is None else f"at {own:g}")


def latex_escaped(text: str) -> str:
    """Return text that LaTeX prints as it stands; pandas escapes cells and headings, but no captions."""
    return "".join(_LATEX.get(letter, letter) for letter in text)
