"""How cells end. It loads nothing that plans: the process that hands cells out stays small."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.study.cells import Row

PLANNED, NO_PLAN, REFUSED = "planned", "no plan", "refused"
FAILED, HUNG, KILLED = "failed", "hung", "killed"
UNANSWERED = (FAILED, HUNG, KILLED)  # what another try may mend


@dataclass(frozen=True)
class Outcome:
    """What came of a cell: the columns of its row that its coordinates do not fill, and its places."""

    row: Row
    places: tuple[Row, ...] = ()

    @property
    def ending(self) -> str:
        """How it ended: one of PLANNED, NO_PLAN, REFUSED, FAILED, HUNG and KILLED."""
        return str(self.row["outcome"])


def ended(ending: str, reason: str) -> Outcome:
    """Return the outcome of a cell that has nothing but a reason to tell."""
    return Outcome({"outcome": ending, "reason": reason})
