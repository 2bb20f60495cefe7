"""What a term of the program is: it declares columns and rows, adds its linearisation, and knows its price.

A program is assembled from terms, and the assembler only sums. A term first says what it needs; the assembler lays the program out and
asks it for its ``Part``, which knows its columns there. The dynamics come first: they clear what the others add to.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from ctypes import CDLL
from dataclasses import dataclass, field
from operator import index
from typing import NamedTuple, Protocol

import numpy as np

from hdvplan import core
from hdvplan.arrays import FloatArray, Records
from hdvplan.errors import HdvplanError, OptionError
from hdvplan.planning.settings import PlannerSettings
from hdvplan.planning.stations import Stations
from hdvplan.plugins import error_text
from hdvplan.qp.program import PROGRAM, StageQp
from hdvplan.vehicle.kinematics import POSE
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Motion:
    """States and curvatures over one horizon, and the poses that they put the bodies in."""

    stages: Records  # (N+1,): z (n,), and kappa, held until the next stage [1/m]; the last one's kappa is not used
    poses: Records  # (N+1, units) of ``POSE``, where the motion was last linearised

    @classmethod
    def empty(cls, vehicle: Vehicle, stages: int) -> Motion:
        """Return the memory for a horizon of ``stages`` intervals."""
        record = np.dtype([("z", float, (vehicle.states,)), ("kappa", float)])
        return cls(np.zeros(stages + 1, record), np.zeros((stages + 1, len(vehicle.units)), POSE))

    @property
    def z(self) -> FloatArray:
        """The states, (N+1, n)."""
        return self.stages["z"]

    @property
    def kappa(self) -> FloatArray:
        """The curvatures, (N,) [1/m]."""
        return self.stages["kappa"][:-1]


SCENE = core.record("hdv_scene", program=PROGRAM)
TERM = core.record("hdv_term")


@dataclass(frozen=True)
class Needs:
    """How many states, inputs and rows a term adds to every stage of a program, beyond the vehicle's own."""

    states: int = 0
    inputs: int = 0
    rows: int = 0


@dataclass(frozen=True)
class Columns:
    """Where a term's own states, inputs and rows begin in every stage."""

    state: int
    input: int
    row: int


@dataclass(frozen=True)
class Scene:
    """The data of a drive's programs, and memory for ``capacity`` stages in a row, of which a program's are a window.

    Program and motion are overwritten at every step. With room for the stages of one horizon alone, the window is the memory.
    """

    vehicle: Vehicle
    stations: Stations
    settings: PlannerSettings
    units: Records  #: ``vehicle.table()``
    qp: StageQp  #: the memory of ``capacity`` stages
    motion: Motion  #: the same
    record: Records = field(init=False)  #: (1,) of ``SCENE``: all of it as the core takes it

    def __post_init__(self) -> None:
        """Lay out the record, without what belongs to one step."""
        record = np.zeros(1, SCENE)
        record["units"], record["unit_count"], record["states"] = core.address(self.units), len(self.units), self.vehicle.states
        record["motion"], record["poses"] = core.address(self.motion.stages), core.address(self.motion.poses)
        record["program"], record["step"] = self.qp.record, self.settings.step
        record["program"]["shape"][0, 0] = self.settings.stages
        object.__setattr__(self, "record", record)

    @property
    def capacity(self) -> int:
        """How many stages there is memory for: parts keep as many records of what they know of a stage."""
        return len(self.qp.stages)

    def begin(self, horizon: Horizon) -> int:
        """Write a step's horizon into the record, whose road must outlive what is done with it; return the record's address."""
        record = self.record
        record["road"], record["kappa_before"] = core.address(horizon.road), horizon.kappa_before
        record["first"], record["fixed"], record["binding"] = horizon.first, horizon.fixed, horizon.binding
        return core.address(record)


class Horizon(NamedTuple):
    """The stages of one planning step."""

    first: int  #: station of stage 0
    road: Records  #: (N+1,) of ``STATION``
    kappa_before: float  #: held until stage 0 [1/m]
    fixed: int  #: stages that no later program can change
    binding: bool  #: whether limits bind in the last program, or none was solved yet


class Part(Protocol):
    """A term as part of a program. Methods that linearise return -1, or a stage where a point of the vehicle has no foot on the road."""

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


class CoreFunctions(NamedTuple):
    """What the core knows of a term: ``hdv_linearise`` and ``hdv_price`` of hdvplan/core/hdvplan.h."""

    linearise: Callable[[int, int, int, int], int]
    price: Callable[[int, int], float]


def core_functions(term: str, library: CDLL | None = None) -> CoreFunctions:
    """Return the functions ``hdv_linearise_...`` and ``hdv_price_...`` of the term of that name, of the core or of another library."""
    pointers = (core.POINTER, core.POINTER)
    return CoreFunctions(
        core.function(f"hdv_linearise_{term}", *pointers, core.INT, core.INT, returns=core.INT, library=library),
        core.function(f"hdv_price_{term}", *pointers, returns=core.REAL, library=library),
    )


@dataclass(frozen=True)
class CorePart:
    """A term as part of a program, written in C; see ``Part``. Arrays that its ``data`` point to are ``kept`` alive."""

    scene: Scene
    functions: CoreFunctions
    data: Records  #: (1,), the functions' own record
    kept: tuple[Records | FloatArray, ...] = field(default=(), kw_only=True)  #: what the data point to
    memory: tuple[FloatArray, ...] = field(default=(), kw_only=True)  #: see ``Part``
    term: Records = field(init=False)  #: (1,) of ``TERM``: all of it as the core takes it

    def __post_init__(self) -> None:
        """Lay out the record."""
        term = np.zeros(1, TERM)
        term["linearise"], term["price"] = core.entry(self.functions.linearise), core.entry(self.functions.price)
        term["data"] = core.address(self.data)
        if self.data.dtype.fields and "violation" in self.data.dtype.fields:
            term["violation"] = core.address(self.data) + self.data.dtype.fields["violation"][1]
        object.__setattr__(self, "term", term)

    @property
    def violation(self) -> float:
        """See ``Part``."""
        return float(self.data["violation"][0]) if self.term["violation"][0] else 0.0

    def extend(self, horizon: Horizon, begin: int) -> int:
        """See ``Part``."""
        return self.functions.linearise(core.address(self.data), self.scene.begin(horizon), begin, 1)

    def linearise(self, horizon: Horizon) -> int:
        """See ``Part``."""
        return self.functions.linearise(core.address(self.data), self.scene.begin(horizon), 1, 0)

    def price(self, horizon: Horizon) -> float:
        """See ``Part``."""
        return self.functions.price(core.address(self.data), self.scene.begin(horizon))


@contextmanager
def owned_by(term: object) -> Iterator[None]:
    """Turn what somebody else's term, or part, raises into one line; what is ours raises as it is.

    Raises:
        OptionError: it raises.

    """
    try:
        yield
    except HdvplanError:
        raise
    except Exception as error:
        if type(term).__module__.partition(".")[0] == "hdvplan":
            raise
        msg = f"term {type(term).__qualname__} raises {error_text(error)}"
        raise OptionError(msg) from error


class PythonPart:
    """A part that is written in Python, as the core calls it; ``raised`` is what it raised."""

    def __init__(self, part: Part, scene: Scene) -> None:
        self._part, self._scene = part, scene
        self.raised: BaseException | None = None
        self._violation = np.zeros(1)
        pointers = (core.POINTER, core.POINTER)
        self._kept = (
            core.callback(self._linearise, *pointers, core.INT, core.INT, returns=core.INT),
            core.callback(self._price, *pointers, returns=core.REAL),
        )
        self.term = np.array([(*map(core.entry, self._kept), 0, core.address(self._violation))], TERM)

    def _linearise(self, _data: int, _scene: int, begin: int, fresh: int) -> int:
        try:
            with owned_by(self._part):
                lost = self._part.extend(self._horizon(), begin) if fresh else self._part.linearise(self._horizon())
                self._violation[0] = self._part.violation
                return index(lost)  # not what ctypes could not return
        except BaseException as error:  # noqa: BLE001 - the core cannot carry it: the planner raises it
            self.raised = error
            return 0

    def _price(self, _data: int, _scene: int) -> float:
        try:
            with owned_by(self._part):
                return float(self._part.price(self._horizon()))
        except BaseException as error:  # noqa: BLE001 - as above
            self.raised = error
            return float("nan")

    def _horizon(self) -> Horizon:
        own, stages = self._scene.record[0], self._scene.settings.stages
        first = int(own["first"])
        road = self._scene.stations.points[first : first + stages + 1]
        return Horizon(first, road, float(own["kappa_before"]), int(own["fixed"]), bool(own["binding"]))


class Term(Protocol):
    """An objective or a limit, as data."""

    def needs(self, vehicle: Vehicle) -> Needs:  # noqa: ARG002 - a protocol's method
        """Return what the term adds to every stage: nothing, where a class below this one says nothing else."""
        return Needs()

    def part(self, scene: Scene, columns: Columns) -> Part:
        """Return the term as part of the program; write the values that are constant over a drive."""
