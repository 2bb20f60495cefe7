"""The heading of a picture: the answer, then vehicle and road."""

from __future__ import annotations

from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_line, verdict_of
from hdvplan.report.colours import BREACH, INK


def answer_line(result: Result) -> str:
    """Return the verdict as one line."""
    return verdict_line(result, verdict_of(result))


def answer_colour(result: Result) -> str:
    """Return the colour that the answer is written in; its first word says as much."""
    return BREACH if verdict_of(result).fits is False else INK


def subject_line(result: Result) -> str:
    """Return which vehicle drove along which road."""
    drive = result.drive
    return f"{drive.vehicle.name} on {drive.road.name}, {drive.road.path.length:.0f} m"
