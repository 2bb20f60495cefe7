"""How answers are worded: their first word, and the room to spare, lacking or needed. Every answer takes its words here."""

from __future__ import annotations

YES, NO, NEEDS = "YES", "NO", "NEEDS"
WORDS = (YES, NO, NEEDS)  # the best first
LINE = 100  # characters of a verdict, so that it is one line wherever it is read


def word_of(fits: bool | None) -> str:  # noqa: FBT001 - three answers, as in ``fits`` everywhere
    """Return the word that says whether a vehicle fits; None: there are no limits."""
    return NEEDS if fits is None else YES if fits else NO


def worded(word: str, text: str) -> str:
    """Return an answer that begins with its word; what a vehicle needs is a sentence with it."""
    return f"{word} {text}" if word == NEEDS else f"{word}: {text}"


def without_word(line: str, word: str) -> str:
    """Return the rest of an answer, for where its word is told otherwise: in another style, or by an exit code."""
    return line.removeprefix(word).removeprefix(":").lstrip()


def room_text(spare: float, *, fits: bool, digits: int = 2) -> str:
    """Return the room to spare, or lacking where it is negative [m]."""
    told = room_number(spare, fits=fits)
    return f"{told:.{digits}f} m to spare" if fits else f"{-told:.{digits}f} m lacking"


def room_number(spare: float, *, fits: bool) -> float:
    """Return the room to spare as it is told [m]: what is broken by less than counts is no lack."""
    return max(spare, 0.0) if fits else spare


def needs_text(half_width: float) -> str:
    """Return what a vehicle needs where there are no limits: ``half_width`` [m]."""
    return worded(NEEDS, f"{half_width:.2f} m to both sides")
