"""A comparison of two benchmarks in words: one line, tables for the terminal, and Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from rich.table import Table
from rich.text import Text

from hdvplan.bench.comparing.compare import CellTimes, Comparison, Found, no_longer_planned
from hdvplan.bench.comparing.counters import IN_STEPS, Change
from hdvplan.bench.comparing.decision import FEWEST, FEWEST_PAIRS, Rule, Verdict
from hdvplan.bench.comparing.where import place_words
from hdvplan.bench.suite import KEY, cell_words
from hdvplan.report.grid import grid, markdown_table

ALL_CELLS = "all cells"  # what a statistic is of
_WRONG = ("cell", "what", "base", "new", "new/base", "part", "place")
_TIMES = (*KEY, "base [ms]", "new [ms]", "new/base", "interval", "visible from", "verdict")
_FOUND = (ALL_CELLS, "base", "new", "new/base", "visible from", "verdict")
_TEXT = (*KEY, "verdict", "cell", "what", "part", "place", ALL_CELLS)
_WORDS = {Verdict.FINE: "fine", Verdict.REGRESSED: "slower", Verdict.UNMEASURABLE: "unclear"}
_MARKS = {Verdict.FINE: "fine", Verdict.REGRESSED: "worse", Verdict.UNMEASURABLE: "unclear"}
_ROWS = 30  # of what is wrong; more are counted
_UNSEEN = "could not see"


def verdict_line(comparison: Comparison, rule: Rule) -> str:
    """Return the comparison in one line."""
    if comparison.failure is not None:
        return f"{comparison.verdict}: {comparison.failure.message}"
    slower = [entry for entry in comparison.times if _is(entry, Verdict.REGRESSED)]
    unknown = [entry for entry in comparison.times if _is(entry, Verdict.UNMEASURABLE)]
    cells = len(comparison.times)
    lost = len({change.cell for change in comparison.changes if no_longer_planned(change)})
    changed = len({change.cell for change in comparison.changes})
    why = next((f" ({change.why})" for change in comparison.changes if change.why), "")
    parts = [f"no plan in {lost} cell{_s(lost)} where there was one{why}"] if lost else []
    parts += [f"counters changed in {changed} cell{_s(changed)}"] if changed else []
    if slower:
        worst = max(slower, key=lambda entry: entry.decision.ratio if entry.decision else 0.0)
        ratio = worst.decision.ratio if worst.decision else np.nan
        parts.append(f"{len(slower)} of {cells} cells slower, most {cell_words(worst.cell)}: {ratio:.2f} times as long")
    worse = sorted((one for one in comparison.found if one.verdict is Verdict.REGRESSED), key=lambda one: -one.ratio)
    parts += [f"{one.statistic.name} {one.ratio:.2f} times as {'much' if one.statistic.unit == 'MB' else 'long'}" for one in worse]
    most = max((entry.decision.pairs for entry in comparison.times if entry.decision), default=FEWEST_PAIRS)
    unsure = [one.statistic.name for one in comparison.found if one.verdict is Verdict.UNMEASURABLE]
    if unknown and most < FEWEST_PAIRS:
        parts.append(f"times need at least {FEWEST_PAIRS} rounds or processes a side, not {most}")
    elif unknown:
        parts.append(f"the times of {len(unknown)} of {cells} cells are too uncertain for a factor of {rule.factor:g}")
    if unsure:
        parts.append(f"too few processes to be sure of {', '.join(unsure)}")
    if cells and not slower and not unknown:
        parts.append(f"no cell of {cells} is slower by more than a factor of {rule.factor:g}")
    unseen = [one.statistic.name for one in comparison.found if one.unseen]
    if unseen and comparison.verdict is not Verdict.REGRESSED:
        parts.append(f"could not see a change of {', '.join(unseen)}")
    return f"{comparison.verdict}: {'; '.join(parts) or 'no counter changed'}"


def comparison_tables(comparison: Comparison) -> list[Table]:
    """Return the tables for the terminal: what is wrong, the worst first; then every time."""
    wrong = wrong_rows(comparison)
    columns = _shown(wrong)
    tables = [grid("what changed, the worst first", [_WRONG[i] for i in columns], [[row[i] for i in columns] for row in wrong], text=_TEXT)]
    tables = tables if wrong else []
    found = _time_rows(comparison.times)
    shown = (_TIMES[0], *_TIMES[len(KEY) :])
    for group in dict.fromkeys(row[1 : len(KEY)] for row in found):
        mine = [(row[0], *row[len(KEY) :]) for row in found if row[1 : len(KEY)] == group]
        words = cell_words(group, ", ")
        tables.append(grid(f"{words}: mean planning step" if words else "mean planning step", shown, mine, text=_TEXT))
    if comparison.found:
        tables.append(grid("whole processes", _FOUND, _found_rows(comparison.found), text=_TEXT))
    if comparison.times:
        tables[-1].caption, tables[-1].caption_justify, tables[-1].caption_style = Text(_caption(comparison)), "left", ""
    return tables


def comparison_markdown(comparison: Comparison, rule: Rule, again: str | None = None) -> str:
    """Return verdict and tables as Markdown, for a step summary or a comment; ``again``: the command that shows it again."""
    parts = [f"**{_plain(verdict_line(comparison, rule))}**"]
    if comparison.failure is not None and comparison.failure.tail:
        parts.append("\n".join(f"    {line}" for line in comparison.failure.tail.splitlines()))
    if wrong := wrong_rows(comparison):
        columns = _shown(wrong)
        parts += ["What changed, the worst first:", _markdown([_WRONG[i] for i in columns], [[row[i] for i in columns] for row in wrong])]
    if again and comparison.verdict is not Verdict.FINE:
        parts.append(f"    {again}")
    if comparison.times:
        parts += ["Mean planning step:", _markdown(_TIMES, _time_rows(comparison.times))]
    if comparison.found:
        parts += ["Whole processes:", _markdown(_FOUND, _found_rows(comparison.found))]
    if comparison.times:
        parts.append(_caption(comparison))
    return "\n\n".join(parts) + "\n"


def wrong_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return what is wrong as rows, the worst first: lost plans, what became slower by its ratio, then other counters."""
    rows: list[tuple[tuple[int, float], tuple[str, ...]]] = []
    moved: dict[tuple[str, ...], list[Change]] = {}
    for change in comparison.changes:
        moved.setdefault(change.cell, []).append(change)
    for entry in comparison.times:
        if entry.decision is not None and _is(entry, Verdict.REGRESSED):
            part, place = place_words(entry.place) if entry.place else ("-", "-")
            also = moved.get(entry.cell, [])
            part = ", ".join([part, *(f"{change.counter} {change.base} -> {change.new}" for change in also if change.counter != IN_STEPS)])
            numbers = f"{1e3 * entry.decision.base:.3f}", f"{1e3 * entry.decision.new:.3f}", f"{entry.decision.ratio:.2f}"
            rows.append(((1, entry.decision.ratio), (cell_words(entry.cell), "mean step [ms]", *numbers, part, place)))
    for one in comparison.found:
        if one.verdict is Verdict.REGRESSED:
            what = f"{one.statistic.name} [{one.statistic.unit}]"
            rows.append(((1, one.ratio), (ALL_CELLS, what, f"{one.base:.3f}", f"{one.new:.3f}", f"{one.ratio:.2f}", "-", "-")))
    rows += [
        ((2 if no_longer_planned(change) else 0, 0.0), (cell_words(change.cell), change.counter, change.base, change.new, "-", "-", "-"))
        for change in comparison.changes
    ]
    ordered = [row for _, row in sorted(rows, key=lambda entry: (-entry[0][0], -entry[0][1]))]
    more = len(ordered) - _ROWS
    return ordered if more <= 0 else [*ordered[:_ROWS], (f"and {more} more", *("-",) * (len(_WRONG) - 1))]


def change_words(change: Change) -> str:
    """Return a changed counter as a sentence."""
    if change.counter == IN_STEPS:
        return "totals unchanged, per-step counts differ"
    return f"{change.counter} was {change.base}, is {change.new}" + (f" ({change.why})" if change.why else "")


def word_of(one: Found) -> str:
    """Return the verdict on a statistic in a word or two."""
    return _UNSEEN if one.unseen else _MARKS[one.verdict]


def _shown(rows: Sequence[Sequence[str]]) -> list[int]:
    """Return the columns in which any row says something."""
    return [i for i in range(len(_WRONG)) if any(row[i] != "-" for row in rows)]


def _time_rows(times: Iterable[CellTimes]) -> list[tuple[str, ...]]:
    rows = []
    for entry in sorted(
        times, key=lambda entry: -entry.decision.ratio if entry.decision and np.isfinite(entry.decision.ratio) else -np.inf
    ):
        found = entry.decision
        if found is None:
            rows.append((*entry.cell, "-", "-", "-", "-", "-", "other steps"))
            continue
        numbers = f"{1e3 * found.base:.3f}", f"{1e3 * found.new:.3f}", f"{found.ratio:.3f}"
        interval = "-" if np.isnan(found.low) else f"{found.low:.2f}-{found.high:.2f}"
        known = (("-" if "nan" in number else number) for number in numbers)
        rows.append((*entry.cell, *known, interval, _from(entry.detectable), _WORDS[found.verdict]))
    return rows


def _found_rows(found: Iterable[Found]) -> list[tuple[str, ...]]:
    return [
        (
            f"{one.statistic.name} [{one.statistic.unit}]",
            f"{one.base:.3f}",
            f"{one.new:.3f}",
            f"{one.ratio:.3f}",
            _from(one.detectable),
            word_of(one),
        )
        for one in sorted(found, key=lambda one: -one.ratio)
    ]


def _from(detectable: float) -> str:
    """Return the smallest change that would have been found, as a percentage."""
    return f"+{100.0 * (detectable - 1.0):.0f} %" if np.isfinite(detectable) else "-"


def _caption(comparison: Comparison) -> str:
    pairs = max((entry.decision.pairs for entry in comparison.times if entry.decision), default=0)
    if comparison.processes == 1:
        return f"One process a side, {pairs} rounds: machine and hour are compared too; `hdvplan bench --against REV` excludes them."
    repeat = ", with the repeat that it would have called for" if comparison.processes < FEWEST else ""
    hidden = any(one.unseen for one in comparison.found)
    unseen = " Could not see: a change of the size that counts could hide in the noise." if hidden else ""
    return (
        f"Every step with its fastest round; new/base and its interval from {pairs} pairs of processes. Visible from: the smallest "
        f"slowdown that these pairs would have shown 9 times out of 10{repeat} (- where there are too few).{unseen}"
    )


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return markdown_table(pd.DataFrame(rows, columns=list(columns), dtype=str), text=_TEXT)


def _plain(text: str) -> str:
    """Return text that Markdown shows as it stands."""
    return "".join(f"\\{sign}" if sign in "*_`<>[]\\" else sign for sign in text)


def _is(entry: CellTimes, verdict: Verdict) -> bool:
    return (entry.decision.verdict if entry.decision else Verdict.UNMEASURABLE) is verdict


def _s(count: int) -> str:
    return "" if count == 1 else "s"
