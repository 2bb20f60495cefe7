"""The numbers of a history by commit, and where they changed. Entries in, series out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.changepoints import change_points
from hdvplan.bench.history import Entry
from hdvplan.bench.values import Value
from hdvplan.bench.versions import version_words

Name = tuple[str, str, str]  # cell, what, unit
LEVEL = 0.01  # about the probability that a history in which nothing changed shows a change point in any of its series
_LEAST = 1.02  # ratio of two levels that is shown; memory differs by less between commits, and yet significantly


@dataclass(frozen=True)
class Change:
    """A new level: where it begins, and the medians before and after."""

    at: int  # of the series' values
    before: float
    after: float
    versions: tuple[str, ...]  # of libraries that changed with this entry, in words

    @property
    def ratio(self) -> float:
        """The change as a factor."""
        return self.after / self.before


@dataclass(frozen=True)
class Series:
    """One number of one cell over the commits that have it."""

    cell: str
    what: str
    unit: str
    entries: tuple[Entry, ...]
    values: FloatArray  # in its unit
    shown: FloatArray  # the same, or the ratio to the base: changes are searched in these
    levels: tuple[tuple[int, float], ...]  # where each begins, and its median of ``shown``
    changes: tuple[Change, ...]

    @property
    def name(self) -> Name:
        """Cell, what and unit."""
        return self.cell, self.what, self.unit


@dataclass(frozen=True)
class Trend:
    """The history of one kind of machine and work."""

    entries: tuple[Entry, ...]  # by date of commit
    base: str | None  # that all entries share: numbers are shown as ratios to it, in which the drift of the machine cancels
    series: tuple[Series, ...]


def trends_of(entries: Sequence[Entry]) -> tuple[Trend, ...]:
    """Return one trend for each kind of machine and work, the latest measured first; they are never mixed."""
    kinds: dict[tuple[str, str], list[Entry]] = {}
    for entry in entries:
        kinds.setdefault(entry.kind, []).append(entry)
    ordered = sorted(kinds.values(), key=lambda mine: max(entry.measured for entry in mine), reverse=True)
    return tuple(_trend(tuple(mine)) for mine in ordered)


def _trend(entries: tuple[Entry, ...]) -> Trend:
    bases = {entry.base for entry in entries}
    base = bases.pop() if len(bases) == 1 else None
    known = [{_name(value): value for value in entry.values if _is_known(value)} for entry in entries]
    names = dict.fromkeys(name for values in known for name in values)
    together: dict[tuple[int, ...], list[Name]] = {}  # series that the same entries have
    for name in names:
        together.setdefault(tuple(at for at, values in enumerate(known) if name in values), []).append(name)
    found = {
        one.name: one
        for at, mine in together.items()
        for one in _series(
            mine, [entries[i] for i in at], [known[i] for i in at], LEVEL * len(mine) / len(names), relative=base is not None
        )
    }
    return Trend(entries, base, tuple(found[name] for name in names))


def _series(
    names: Sequence[Name], entries: Sequence[Entry], known: Sequence[Mapping[Name, Value]], level: float, *, relative: bool
) -> list[Series]:
    """Return series that all ``entries`` have; ``known`` are their values by name."""
    values = np.array([[one[name].new for one in known] for name in names])
    shown = values / np.array([[one[name].base for one in known] for name in names]) if relative else values
    found = []
    for name, row, levels, changed in zip(names, values, shown, change_points(shown, level), strict=True):
        begins = [0, *changed]
        medians = [float(np.median(levels[begin:end])) for begin, end in zip(begins, [*changed, len(levels)], strict=True)]
        changes = [
            Change(at, before, after, version_words(entries[at - 1].packages, entries[at].packages))
            for at, before, after in zip(changed, medians[:-1], medians[1:], strict=True)
            if max(after / before, before / after) >= _LEAST
        ]
        found.append(Series(*name, tuple(entries), row, levels, tuple(zip(begins, medians, strict=True)), tuple(changes)))
    return found


def _name(value: Value) -> Name:
    return value.cell, value.what, value.unit


def _is_known(value: Value) -> bool:
    return bool(np.isfinite(value.new) and value.new > 0.0 and np.isfinite(value.base) and value.base > 0.0)
