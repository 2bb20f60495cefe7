"""A comparison of two benchmarks: as tables for the terminal, in Markdown, as JSON, as annotations of GitHub Actions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from rich.table import Table
from rich.text import Text

from hdvplan.bench.compare import CellTimes, Comparison
from hdvplan.bench.counters import IN_STEPS, Change
from hdvplan.bench.gate import FEWEST_PAIRS, Rule, Verdict
from hdvplan.bench.suite import KEY, cell_words
from hdvplan.report.grid import grid
from hdvplan.report.markdown import markdown_table

_CHANGES = (*KEY, "counter", "base", "new")
_TIMES = (*KEY, "base [ms]", "new [ms]", "new/base", "interval", "verdict")
_TEXT = (*KEY, "counter", "verdict")
_WORDS = {Verdict.FINE: "fine", Verdict.REGRESSED: "slower", Verdict.UNMEASURABLE: "unclear"}


def verdict_line(comparison: Comparison, rule: Rule) -> str:
    """Return the comparison in one line."""
    slower = [entry for entry in comparison.times if _is(entry, Verdict.REGRESSED)]
    unknown = [entry for entry in comparison.times if _is(entry, Verdict.UNMEASURABLE)]
    cells = len(comparison.times)
    changed = len({change.cell for change in comparison.changes})
    parts = [f"counters changed in {changed} cell{_s(changed)}"] if changed else []
    if slower:
        worst = max(slower, key=lambda entry: entry.decision.ratio if entry.decision else 0.0)
        ratio = worst.decision.ratio if worst.decision else np.nan
        parts.append(f"{len(slower)} of {cells} cells slower, most {cell_words(worst.cell)}: {ratio:.2f} times as long")
    most = max((entry.decision.pairs for entry in comparison.times if entry.decision), default=FEWEST_PAIRS)
    if unknown and most < FEWEST_PAIRS:
        parts.append(f"times need at least {FEWEST_PAIRS} rounds or processes a side, not {most}")
    elif unknown:
        parts.append(f"the times of {len(unknown)} of {cells} cells are too uncertain for a factor of {rule.factor:g}")
    if cells and not slower and not unknown:
        parts.append(f"no cell of {cells} is slower by more than a factor of {rule.factor:g}")
    return f"{comparison.verdict}: {'; '.join(parts) or 'no counter changed'}"


def comparison_tables(comparison: Comparison) -> list[Table]:
    """Return the tables for the terminal, one a vehicle, scheme and solver: what was counted differently, if anything, and times."""
    rows = {
        "counters changed": (_CHANGES, _change_rows(comparison.changes)),
        "mean planning step": (_TIMES, _time_rows(comparison.times)),
    }
    tables = []
    for what, (columns, found) in rows.items():
        shown = (columns[0], *columns[len(KEY) :])
        for group in dict.fromkeys(row[1 : len(KEY)] for row in found):
            mine = [(row[0], *row[len(KEY) :]) for row in found if row[1 : len(KEY)] == group]
            tables.append(grid(f"{cell_words(group, ', ')}: {what}", shown, mine, text=_TEXT))
    if comparison.times:
        tables[-1].caption, tables[-1].caption_justify, tables[-1].caption_style = Text(_caption(comparison)), "left", ""
    return tables


def comparison_markdown(comparison: Comparison, rule: Rule) -> str:
    """Return verdict and tables as Markdown, for a step summary or a comment."""
    parts = [f"**{verdict_line(comparison, rule)}**"]
    if comparison.changes:
        parts += ["Counters that changed:", _markdown(_CHANGES, _change_rows(comparison.changes))]
    if comparison.times:
        parts += ["Mean planning step:", _markdown(_TIMES, _time_rows(comparison.times)), _caption(comparison)]
    return "\n\n".join(parts) + "\n"


def github_annotations(comparison: Comparison, rule: Rule) -> list[str]:
    """Return the workflow commands that make GitHub Actions show what is wrong: one a changed or slower cell, then the verdict."""
    found = [
        _command("error" if comparison.verdict is Verdict.REGRESSED else "notice", f"{cell_words(change.cell)}: {_sentence(change)}")
        for change in comparison.changes
    ]
    found += [
        _command("error", f"{cell_words(entry.cell)}: {entry.decision.ratio:.2f} times as long")
        for entry in comparison.times
        if entry.decision is not None and _is(entry, Verdict.REGRESSED)
    ]
    kind = {Verdict.FINE: "notice", Verdict.REGRESSED: "error", Verdict.UNMEASURABLE: "warning"}[comparison.verdict]
    return [*found, _command(kind, verdict_line(comparison, rule))]


def comparison_json(comparison: Comparison, rule: Rule) -> dict[str, object]:
    """Return the comparison for other programs; null where a number is not known."""
    return {
        "verdict": str(comparison.verdict),
        "summary": verdict_line(comparison, rule),
        "factor": rule.factor,
        "floor_ms": 1e3 * rule.floor,
        "changes": [
            dict(zip(KEY, change.cell, strict=True)) | {"counter": change.counter, "base": change.base, "new": change.new}
            for change in comparison.changes
        ],
        "times": [dict(zip(KEY, entry.cell, strict=True)) | _numbers(entry) for entry in comparison.times],
    }


def _numbers(entry: CellTimes) -> dict[str, object]:
    found = entry.decision
    if found is None:
        return {"verdict": str(Verdict.UNMEASURABLE)}
    numbers = {
        "base_ms": 1e3 * found.base, "new_ms": 1e3 * found.new, "ratio": found.ratio, "low": found.low, "high": found.high,
        "noise": found.noise,
    }  # fmt: skip
    known = {name: value if np.isfinite(value) else None for name, value in numbers.items()}
    return {"verdict": str(found.verdict), "pairs": found.pairs} | known


def _change_rows(changes: Iterable[Change]) -> list[tuple[str, ...]]:
    return [(*change.cell, change.counter, change.base, change.new) for change in changes]


def _time_rows(times: Iterable[CellTimes]) -> list[tuple[str, ...]]:
    rows = []
    for entry in times:
        found = entry.decision
        if found is None:
            rows.append((*entry.cell, "-", "-", "-", "-", "other steps"))
            continue
        numbers = f"{1e3 * found.base:.3f}", f"{1e3 * found.new:.3f}", f"{found.ratio:.3f}"
        interval = "-" if np.isnan(found.low) else f"{found.low:.2f}-{found.high:.2f}"
        rows.append((*entry.cell, *(("-" if "nan" in number else number) for number in numbers), interval, _WORDS[found.verdict]))
    return rows


def _caption(comparison: Comparison) -> str:
    pairs = max((entry.decision.pairs for entry in comparison.times if entry.decision), default=0)
    if comparison.processes == 1:
        return f"One process a side, {pairs} rounds: machine and hour are compared too; `hdvplan bench --against REV` excludes them."
    return f"Every step with its fastest sample; new/base and its interval from {pairs} pairs of processes."


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return markdown_table(pd.DataFrame(rows, columns=list(columns), dtype=str), text=_TEXT)


def _sentence(change: Change) -> str:
    if change.counter == IN_STEPS:
        return "totals unchanged, per-step counts differ"
    return f"{change.counter} was {change.base}, is {change.new}"


def _command(kind: str, message: str) -> str:
    escaped = message.replace("%", "%25").replace("\r", "%0D").replace("\n", "%0A")
    return f"::{kind} title=planning time::{escaped}"


def _is(entry: CellTimes, verdict: Verdict) -> bool:
    return (entry.decision.verdict if entry.decision else Verdict.UNMEASURABLE) is verdict


def _s(count: int) -> str:
    return "" if count == 1 else "s"
