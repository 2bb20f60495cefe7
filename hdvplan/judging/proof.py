"""A proof that no driving whatsoever keeps the limits, as verdicts and needs carry it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Proof:
    """The stretch of road on which the set of states that keep the limits and can be reached empties."""

    kind: str  # "place": no pose of body ``unit`` fits at ``s_to``; "motion": poses fit everywhere, but none can be reached
    s_from: float  # where the set was last full [m]
    s_to: float  # where it is empty [m]
    unit: int  # index of the body for "place"; of the last one taken into account for "motion"
