"""A comparison of two benchmarks in words: one line, tables for the terminal, and Markdown."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence

import numpy as np
import pandas as pd
from rich.table import Table
from rich.text import Text

from hdvplan.bench.comparing.compare import Comparison, Entry
from hdvplan.bench.comparing.counters import IN_STEPS, LENGTHS, WORK_TOLERANCE, Change
from hdvplan.bench.comparing.decision import FEWEST, FEWEST_PAIRS, GateVerdict, Rule
from hdvplan.bench.suite import KEY, cell_words
from hdvplan.report.grid import grid, markdown_table
from hdvplan.texts import counted

ALL_CELLS = "all cells"  # what a statistic is of
_WRONG = ("cell", "what", "base", "new", "new/base")
_NUMBERS = ("base", "new", "new/base", "interval", "visible\nfrom", "verdict")  # so that 80 columns hold them
_TIMES = (*KEY, "base [ms]", "new [ms]", *_NUMBERS[2:])
_FOUND = ("what", *_NUMBERS)
_TEXT = (*KEY, "verdict", "cell", "what")
_WORDS = {GateVerdict.FINE: "fine", GateVerdict.REGRESSED: "slower", GateVerdict.UNMEASURABLE: "unclear"}
_MARKS = {GateVerdict.FINE: "fine", GateVerdict.REGRESSED: "worse", GateVerdict.UNMEASURABLE: "unclear"}
_ROWS = 30  # of what is wrong; more are counted
_UNSEEN = "could not see"
_NEAR = 0.01  # beyond what counts: a percentage without decimals could show the same
_WITHIN = f"{100.0 * WORK_TOLERANCE:g} %"
_LITTLE = f"changed by at most {_WITHIN}, which counts with --strict alone"


def verdict_line(comparison: Comparison, rule: Rule) -> str:
    """Return the comparison in one line."""
    if comparison.failure is not None:
        return f"{comparison.verdict}: {comparison.failure.message}"
    slower = [entry for entry in comparison.times if entry.is_worse]
    unknown = [entry for entry in comparison.times if entry.verdict is GateVerdict.UNMEASURABLE]
    cells = len(comparison.times)
    parts = _changed_parts(comparison.changes)
    if comparison.elsewhere:
        parts.append("the sides were measured on different machines, so their times do not count")
    if slower:
        parts.append(_longest(slower, cells, "slower"))
    worse = sorted((one for one in comparison.found if one.is_worse and not one.is_of_cell), key=lambda one: -one.decision.ratio)
    parts += [f"{quantity_words(one)} {one.decision.ratio:.2f} times as {'much' if one.quantity.unit == 'MB' else 'long'}" for one in worse]
    by_name = _by_name(one for one in comparison.found if one.is_worse and one.is_of_cell)
    parts += [_longest(ones, cells, f"slower in {name}") for name, ones in by_name.items()]
    most = max((entry.decision.pairs for entry in comparison.times), default=FEWEST_PAIRS)
    unsure = _by_name(one for one in comparison.found if one.decision.is_doubtful)
    doubts = [name + (f" of {cell_words(ones[0].cell)}{_and_more(ones)}" if ones[0].is_of_cell else "") for name, ones in unsure.items()]
    longer = [one for one in unknown if one.decision.ratio > one.decision.counting]
    if unknown and most < FEWEST_PAIRS:
        parts.append(f"times need at least {FEWEST_PAIRS} rounds or processes a side, not {most}")
    elif longer and not comparison.proves:
        took = _longest(longer, cells, "took longer")
        what = "sides of two comparisons" if comparison.apart else "one process a side"
        parts.append(f"{took}; {what} cannot tell a slower program from a slower hour, `hdvplan bench --against REV` can")
    elif unknown:
        if longer:
            parts.append(f"{_longest(longer, cells, 'took longer')}, but the pairs do not agree well enough to prove it")
        if open_ := [one for one in unknown if one not in longer]:
            uncertain = f"the times of {len(open_)} of {cells} cells are too uncertain for a factor of {rule.factor:g}"
            parts.append(uncertain + _could(open_, comparison))
        if not np.isnan(comparison.load):
            parts.append(f"load average {comparison.load:.1f} on {os.cpu_count() or 1} cores")
    if unsure:
        parts.append(f"too few processes to be sure of {', '.join(doubts)}")
    if cells and not slower and not by_name and not unknown:
        short = any(entry.decision.counting > rule.factor for entry in comparison.times)  # the floor is more than the factor of a step
        least = f" and {1e3 * rule.floor:g} ms" if short else ""
        parts.append(f"no cell of {cells} is slower by more than a factor of {rule.factor:g}{least}")
    unseen = [name for name in _by_name(one for one in comparison.found if one.decision.unseen) if name not in unsure]
    if unseen and comparison.verdict is not GateVerdict.REGRESSED:
        parts.append(f"could not see a change of {', '.join(unseen)}")
    parts = parts or [f"no counter changed{f' by more than {_WITHIN}' if comparison.within else ''}"]
    if comparison.within:
        parts.append(f"{counted(len(comparison.within), 'sum')} of QPs or iterations changed by at most {_WITHIN}")
    if broken := comparison.broken:
        parts.append(f"not ok on both sides: {cell_words(broken[0].cell)}: {broken[0].new}{_and_more(broken)}")
    return f"{comparison.verdict}: {'; '.join(parts)}"


def _longest(entries: Sequence[Entry], cells: int, what: str) -> str:
    worst = max(entries, key=lambda entry: entry.decision.ratio)
    return f"{len(entries)} of {cells} cells {what}, most {cell_words(worst.cell)}: {worst.decision.ratio:.2f} times as long"


def _by_name(entries: Iterable[Entry]) -> dict[str, list[Entry]]:
    found: dict[str, list[Entry]] = {}
    for entry in entries:
        found.setdefault(quantity_words(entry), []).append(entry)
    return found


def _changed_parts(changes: Sequence[Change]) -> list[str]:
    """Return what a comparison's changes are, in words: lost plans, other work, other counters."""
    gone = {change.cell for change in changes if change.is_missing}
    lost = len({change.cell for change in changes if change.is_lost} - gone)
    why = next((f" ({change.why})" for change in changes if change.why), "")
    parts = [f"no right plan in {counted(lost, 'cell')} where there was one{why}"] if lost else []
    parts += [f"{counted(len(gone), 'cell')} of the base {'was' if len(gone) == 1 else 'were'} not measured"] if gone else []
    if work := [change for change in changes if change.counter == "steps"]:
        first = work[0]
        parts.append(f"other work: {cell_words(first.cell)} takes {first.new} steps, not {first.base}{_and_more(work)}")
    swept = {change.cell for change in changes if change.counter in LENGTHS}
    others = {change.cell for change in changes if change.counter not in {"cell", *LENGTHS}} - {change.cell for change in work}
    named = (("counters", others), ("the envelope alone", swept - others))
    parts += [f"{what} changed in {counted(len(cells), 'cell')}" for what, cells in named if cells]
    if added := [change for change in changes if change.is_new]:
        parts.append(f"new, with nothing to compare: {cell_words(added[0].cell)}{_and_more(added)}")
    return parts


def _and_more(ones: Sequence[object]) -> str:
    return f", and {len(ones) - 1} more" if len(ones) > 1 else ""


def _could(unknown: Sequence[Entry], comparison: Comparison) -> str:
    seen = max(max(entry.decision.detectable, entry.decision.high) for entry in unknown)
    return f"; {comparison.processes} pairs would have shown a slowdown of {100.0 * (seen - 1.0):.0f} %" if np.isfinite(seen) else ""


def comparison_tables(comparison: Comparison, where: str) -> list[Table]:
    """Return the tables for the terminal: what is wrong, the worst first; every time; what else decides. ``where`` has the rest."""
    wrong = wrong_rows(comparison)
    tables = [grid("what changed, the worst first", _WRONG, wrong, text=_TEXT)] if wrong else []
    if comparison.within:
        tables.append(grid(_LITTLE, _WRONG[:-1], map(_counters, comparison.within), text=_TEXT))
    found = _rows(comparison.times)
    shown = (_TIMES[0], *_TIMES[len(KEY) :])
    for group in dict.fromkeys(row[1 : len(KEY)] for row in found):
        mine = [(row[0], *row[len(KEY) :]) for row in found if row[1 : len(KEY)] == group]
        words = cell_words(group, ", ")
        tables.append(grid(f"{words}: mean planning step" if words else "mean planning step", shown, mine, text=_TEXT))
    deciding = [one for one in comparison.found if one.is_worse or one.decision.is_doubtful or (comparison.strict and one.decision.unseen)]
    if deciding:
        tables.append(grid("whole processes, what decides", _FOUND, _rows(deciding), text=_TEXT))
    if comparison.times:
        rest = len(_notable(comparison.found)) - len(deciding)
        more = f" Whole processes: {counted(rest, 'other row')}, which decide nothing: {where}." if rest else ""
        tables[-1].caption, tables[-1].caption_justify, tables[-1].caption_style = Text(_caption(comparison) + more), "left", ""
    return tables


def comparison_markdown(comparison: Comparison, rule: Rule, again: str | None = None) -> str:
    """Return verdict and tables as Markdown, for a step summary or a comment; ``again``: the command that shows it again."""
    parts = [f"**{_plain(verdict_line(comparison, rule))}**"]
    if comparison.failure is not None and comparison.failure.tail:
        parts.append("\n".join(f"    {line}" for line in comparison.failure.tail.splitlines()))
    if wrong := wrong_rows(comparison):
        parts += ["What changed, the worst first:", _markdown(_WRONG, wrong)]
    if comparison.within:
        parts += [f"{_LITTLE.capitalize()}:", _markdown(_WRONG[:-1], list(map(_counters, comparison.within)))]
    if again and comparison.verdict is not GateVerdict.FINE:
        parts.append(f"    {again}")
    if comparison.times:
        parts += ["Mean planning step:", _markdown(_TIMES, _rows(comparison.times))]
    if comparison.found:
        parts += ["Whole processes:", _markdown(_FOUND, _rows(_notable(comparison.found)))]
    if comparison.times:
        parts.append(_caption(comparison))
    if comparison.about:
        parts.append(_plain(comparison.about))
    return "\n\n".join(parts) + "\n"


def wrong_rows(comparison: Comparison) -> list[tuple[str, ...]]:
    """Return what is wrong as rows, the worst first: lost plans, what became slower by its ratio, then other counters."""
    rows: list[tuple[tuple[int, float], tuple[str, ...]]] = [
        ((1, entry.decision.ratio), (place_words(entry), f"{quantity_words(entry)} [{entry.quantity.unit}]", *_numbers(entry)))
        for entry in (*comparison.times, *comparison.found)
        if entry.is_worse
    ]
    rows += [((2 if change.is_lost else 0, 0.0), (*_counters(change), "-")) for change in comparison.changes]
    ordered = [row for _, row in sorted(rows, key=lambda entry: (-entry[0][0], -entry[0][1]))]
    more = len(ordered) - _ROWS
    return ordered if more <= 0 else [*ordered[:_ROWS], (f"and {more} more", *("-",) * (len(_WRONG) - 1))]


def _counters(change: Change) -> tuple[str, ...]:
    return cell_words(change.cell), change.counter, change.base, change.new


def change_words(change: Change) -> str:
    """Return a changed counter as a sentence."""
    if change.counter == IN_STEPS:
        return "totals unchanged, per-step counts differ"
    return f"{change.counter} was {change.base}, is {change.new}" + (f" ({change.why})" if change.why else "")


def quantity_words(entry: Entry) -> str:
    """Return the name of what was decided about; processes that began with an empty home are told apart."""
    name = entry.quantity.name
    return name if entry.is_of_cell else " ".join([name, *(f"({word})" for word in entry.cell)])


def place_words(entry: Entry) -> str:
    """Return the cell that was decided about; of others that it is all."""
    return cell_words(entry.cell) if entry.is_of_cell else ALL_CELLS


def word_of(entry: Entry) -> str:
    """Return the verdict on a quantity in a word or two."""
    if entry.decision.unseen:
        return _UNSEEN
    if not entry.decision.pairs:
        return "other steps"
    words = _MARKS if not entry.decision.needed else _WORDS
    return f"{words[entry.verdict]}{' by CPU' if entry.by_cpu else ''}"


def _notable(found: Iterable[Entry]) -> list[Entry]:
    """Return what concerns all cells, and of single ones what is not fine."""
    return [one for one in found if not one.is_of_cell or one.decision.unseen or one.verdict is not GateVerdict.FINE]


def _rows(entries: Iterable[Entry]) -> list[tuple[str, ...]]:
    rows = []
    for entry in sorted(entries, key=lambda entry: -entry.decision.ratio if np.isfinite(entry.decision.ratio) else np.inf):
        found = entry.decision
        interval = "-" if np.isnan(found.low) else f"{found.low:.2f}-{found.high:.2f}"
        what = f"{quantity_words(entry)}{f' of {cell_words(entry.cell)}' if entry.is_of_cell else ''} [{entry.quantity.unit}]"
        names = entry.cell if found.needed else (what,)
        rows.append((*names, *_numbers(entry), interval, _from(found.detectable, found.counting), word_of(entry)))
    return rows


def _numbers(entry: Entry) -> tuple[str, str, str]:
    numbers = [f"{entry.decision.base:.5g}", f"{entry.decision.new:.5g}", f"{entry.decision.ratio:.3f}"]
    return tuple("-" if number == "nan" else number for number in numbers)  # type: ignore[return-value] # three


def _from(ratio: float, counting: float) -> str:
    """Return the smallest change that counts, or would have been found, as a percentage; a little more than counts is not rounded to it."""
    excess = 100.0 * (ratio - 1.0)
    near = counting < ratio < counting + _NEAR
    return f"+{np.ceil(10.0 * excess) / 10.0 if near else excess:.{int(near)}f} %" if np.isfinite(ratio) else "-"


def _caption(comparison: Comparison) -> str:
    pairs = max((entry.decision.pairs for entry in comparison.times), default=0)
    if not comparison.proves:
        what = "Sides of two comparisons" if comparison.apart else f"One process a side, {pairs} rounds"
        return f"{what}: machine and hour are compared too, so nothing here proves a slower program."
    repeat = ", with the repeat that it would have called for" if comparison.processes < FEWEST else ""
    unseen = _by_name(one for one in comparison.found if one.decision.unseen)
    hidden = [f"{name} {_from(most := max(one.decision.counting for one in ones), most)}" for name, ones in unseen.items()]
    notes = f" Could not see: changes that count could hide in the noise, {', '.join(hidden)} and more." if hidden else ""
    by_cpu = any(one.by_cpu for one in comparison.times)
    notes += " By CPU: the processor time leaves no room for a change that counts." if by_cpu else ""
    return (
        f"Every step with its fastest round; base and new are, in each row, of the pair of processes with the middle ratio of {pairs}, "
        "the interval is that of the median. Visible from: the smallest slowdown that these pairs would have shown 9 times out of "
        f"10{repeat} (- where there are too few).{notes}"
    )


def _markdown(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    return markdown_table(pd.DataFrame(rows, columns=list(columns), dtype=str), text=_TEXT)


def _plain(text: str) -> str:
    """Return text that Markdown shows as it stands."""
    return "".join(f"\\{sign}" if sign in "*_`<>[]\\" else sign for sign in text)
