"""The revision in which something became worse, as a comparison reports it."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.bench.revisions import Revision


@dataclass(frozen=True)
class Trial:
    """A revision that was compared with the base, and whether it shows the same; None: not known."""

    revision: Revision
    shows: bool | None


@dataclass(frozen=True)
class Origin:
    """The revision in which something began, or several of which those before the last could not be judged."""

    symptom: str  # what began, in words
    suspects: tuple[Revision, ...]  # oldest first; at least one
    trials: tuple[Trial, ...]  # in the order in which they were made


def origin_words(origin: Origin) -> str:
    """Return where something began, in words."""
    *others, last = origin.suspects
    words = f"{origin.symptom}: first in {last.words}"
    return f"{words}, or in one that could not be judged: {', '.join(one.words for one in others)}" if others else words


def origin_json(origin: Origin) -> dict[str, object]:
    """Return where something began, for other programs."""
    return {
        "what": origin.symptom,
        "suspects": [_json(one) for one in origin.suspects],
        "tried": [_json(trial.revision) | {"shows": trial.shows} for trial in origin.trials],
    }


def _json(one: Revision) -> dict[str, object]:
    return {"commit": one.commit, "subject": one.subject, "committed": one.committed or None}
