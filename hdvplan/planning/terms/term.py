"""What a term of the program is: it declares columns and rows, adds its linearisation, and knows its price.

A program is assembled from terms, and the assembler only sums. A term first says what it needs; the assembler lays the program out and
asks it for its ``Part``, which knows its place there. The dynamics come first: they clear what the others add to.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Protocol

from hdvplan.jit import FloatArray, Records
from hdvplan.planning.motion import Motion
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.qp.program import StageQp
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Needs:
    """How many states, inputs and rows a term adds to every stage of a program, beyond the vehicle's own."""

    states: int = 0
    inputs: int = 0
    rows: int = 0


@dataclass(frozen=True)
class Place:
    """Where a term's own states, inputs and rows begin in every stage."""

    state: int
    input: int
    row: int


@dataclass(frozen=True)
class Scene:
    """The data of a drive's programs, and the memory of one program: values and motion are overwritten at every step."""

    vehicle: Vehicle
    stations: Stations
    settings: PlannerSettings
    units: Records  #: ``vehicle.table()``
    qp: StageQp
    motion: Motion


class Horizon(NamedTuple):
    """The stages of one planning step."""

    first: int  #: station of stage 0
    road: Records  #: (N+1,) of ``STATION``
    kappa_before: float  #: held until stage 0 [1/m]
    fixed: int  #: stages that no later program can change
    binding: bool  #: whether limits bind in the last program, or none was solved yet


class Part(Protocol):
    """A term in its place. Methods that linearise return -1, or a stage where a point of the vehicle has no foot on the road."""

    @property
    def memory(self) -> tuple[FloatArray, ...]:
        """The arrays that the part stores for every stage, as ``by_stage``: they are shifted with the plan."""

    @property
    def violation(self) -> float:
        """The deepest breach of a limit by the motion of the last linearisation [m]; 0 if none is broken, or the part is no limit."""

    def extend(self, horizon: Horizon, begin: int) -> int:
        """Linearise at stages from ``begin`` >= 1 on, by which the motion was extended.

        Of the stages before, only the first state has changed.
        """

    def linearise(self, horizon: Horizon) -> int:
        """Linearise at the whole motion."""

    def price(self, horizon: Horizon) -> float:
        """Return the cost of the motion of the last linearisation: the term's share of the merit."""


class Term(Protocol):
    """An objective or a limit, as data."""

    def needs(self, vehicle: Vehicle) -> Needs:
        """Return what the term adds to every stage."""

    def part(self, scene: Scene, place: Place) -> Part:
        """Return the term in its place; write the values that are constant over a drive."""
