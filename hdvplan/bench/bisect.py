"""Find the revision in which something became worse: those between base and working tree are compared with the base by bisection."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from hdvplan.bench.compare import Comparison, no_longer_planned
from hdvplan.bench.gate import Verdict
from hdvplan.bench.origin import Origin, Trial
from hdvplan.bench.revisions import Revision
from hdvplan.bench.suite import cell_words

_SPARE = 3  # comparisons beyond those of a bisection, for revisions that cannot be judged
_LEAST_NOISE = 1e-3  # of the logarithms of ratios: smaller ones count as this


@dataclass(frozen=True)
class Symptom:
    """One finding of a comparison: a counter or the time of a cell, a statistic of all cells, or a program that fails."""

    words: str
    cell: tuple[str, ...] | None = None
    counter: str | None = None
    statistic: str | None = None
    ratio: float = np.inf  # of what became slower

    @property
    def is_failure(self) -> bool:
        """Whether it is a program that fails."""
        return self.cell is None and self.statistic is None


def clearest_symptom(comparison: Comparison) -> Symptom:
    """Return what a red comparison shows most clearly: a failure, a lost plan, a time far beyond what could be seen, another counter."""
    if comparison.failure is not None:
        return Symptom("the program fails")
    lost = [change for change in comparison.changes if no_longer_planned(change)]
    if lost:
        return Symptom(f"no plan in {cell_words(lost[0].cell)}", lost[0].cell, lost[0].counter)
    slower = [
        (entry.decision.ratio, entry.detectable, Symptom(f"mean step of {cell_words(entry.cell)}", entry.cell, ratio=entry.decision.ratio))
        for entry in comparison.times
        if entry.decision is not None and entry.decision.verdict is Verdict.REGRESSED
    ]
    slower += [
        (one.ratio, one.detectable, Symptom(one.statistic.name, statistic=one.statistic.name, ratio=one.ratio))
        for one in comparison.found
        if one.verdict is Verdict.REGRESSED
    ]
    if slower:
        return max(slower, key=lambda entry: np.log(entry[0]) / max(np.log(entry[1]), _LEAST_NOISE))[2]
    change = comparison.changes[0]
    return Symptom(f"{change.counter} in {cell_words(change.cell)}", change.cell, change.counter)


def shows(comparison: Comparison, symptom: Symptom) -> bool | None:
    """Tell whether another comparison shows a symptom too; None where it cannot say."""
    if comparison.failure is not None:
        return True if symptom.is_failure and comparison.failure.side == "new" else None
    if symptom.is_failure:
        return False
    if symptom.counter is not None:
        return any((change.cell, change.counter) == (symptom.cell, symptom.counter) for change in comparison.changes)
    for entry in comparison.times:
        if symptom.cell is not None and entry.cell == symptom.cell and entry.decision is not None:
            return _shown(entry.decision.verdict, entry.decision.ratio, entry.detectable, symptom)
    for one in comparison.found:
        if one.statistic.name == symptom.statistic:
            return _shown(one.verdict, one.ratio, one.detectable, symptom)
    return None


def _shown(verdict: Verdict, ratio: float, detectable: float, symptom: Symptom) -> bool | None:
    """Tell what a verdict says about a symptom; fine says something only where its size could have been seen, and is not half there."""
    if verdict is Verdict.FINE and (detectable > symptom.ratio or ratio**2 > symptom.ratio):
        return None
    return None if verdict is Verdict.UNMEASURABLE else verdict is Verdict.REGRESSED


def most_trials(count: int) -> int:
    """Return how many comparisons at most are made among ``count`` revisions of which the last is known to be bad."""
    return min(max(count - 1, 0), max(count - 1, 0).bit_length() + _SPARE)


def origin_of(symptom: Symptom, revisions: Sequence[Revision], compared: Callable[[Revision], Comparison]) -> Origin:
    """Return where a symptom began that the last of ``revisions`` shows, and the state before the first does not.

    ``compared`` returns a revision's comparison with the base. The number of comparisons is the logarithm of that of the revisions, and
    a few more if some revisions cannot be judged.
    """
    good, bad = -1, len(revisions) - 1
    trials: dict[int, Trial] = {}
    while len(trials) < most_trials(len(revisions)):
        untried = [at for at in range(good + 1, bad) if at not in trials]
        if not untried:
            break
        at = min(untried, key=lambda at: abs(2 * at - good - bad))
        found = shows(compared(revisions[at]), symptom)
        trials[at] = Trial(revisions[at], found)
        if found is not None:
            good, bad = (good, at) if found else (at, bad)
    return Origin(symptom.words, tuple(revisions[good + 1 : bad + 1]), tuple(trials.values()))
