"""A drive of several legs: lines that are driven one after the other, each forwards or backwards."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.road.road import Road


@dataclass(frozen=True)
class Leg:
    """A line in its street, directed as the vehicle heads; one that is driven ``backward`` is driven from its end to its beginning."""

    road: Road
    backward: bool


@dataclass(frozen=True)
class Legs:
    """The legs of a drive in the order of driving, all in one plane: at a cusp neighbours share point and heading."""

    name: str
    legs: tuple[Leg, ...]
    notes: tuple[str, ...] = ()  #: from reading its file
