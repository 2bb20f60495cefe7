"""What a benchmark runs: its cells, their order, and everything else that must be the same for two runs to be comparable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from itertools import product
from math import prod
from pathlib import Path

import numpy as np

from hdvplan.errors import OptionError
from hdvplan.fileio import read_toml
from hdvplan.planning.objective_names import check_objective
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.plugins import is_reference
from hdvplan.spelling import did_you_mean

# Gentle and tight, 345 m to 12 km: roundabouts, a loop that crosses itself, S-bends, a closed ring, hairpins, a U-turn.
ROADS = (
    "goteborg_tuvevagen_brunnsbo",
    "goteborg_gullbergsmotet_loop_north",
    "goteborg_nya_allen",
    "goteborg_fiskhamnsgatan",
    "neubrandenburg_ring",
    "liechtenstein_planken",
    "liechtenstein_schaan_balzers",
    "monaco_fairmont_hairpin",
    "newyork_columbus_circle",
    "goteborg_lindholmsallen_uturn",
)
_LISTS = ("roads", "vehicles", "schemes", "solvers")
AS_SET = "as set"
_MOST_DRIVES = 100_000  # of one benchmark: weeks, and as many files
CLASSES = {
    "off": "no limits",
    "inactive": "limits beyond what the tightest bend asks for",
    "binding": "the same, with the outer limit of the tightest bend moved inwards",
    "unkeepable": "limits half-way between the vehicle's side and what the tightest bend asks for",
}
_KINDS = {tuple: "a list of names", bool: "true or false", str: "a name"}
_OPTIONAL = ("half_width", "pinch", "accuracy", "memory_limit")
_POSITIVE = ("budget", "half_width", "pinch", "accuracy", "step_limit", "cell_limit", "memory_limit")


@dataclass(frozen=True)
class Cell:
    """One row of the tables: a vehicle planned along a road, within limits of one class, by one scheme with one solver."""

    road: str
    vehicle: str
    scheme: Scheme
    solver: str
    limits: str = AS_SET  # or one of ``CLASSES``


# The columns by which tables name a cell, its course with all solvers, and the group within which solvers are ranked.
KEY = ["road", "vehicle", "scheme", "solver", "limits"]
COURSE = ["road", "vehicle", "scheme", "limits"]
GROUP = ["vehicle", "scheme", "limits"]


def key_of(cell: Cell) -> tuple[str, str, str, str, str]:
    """Return a cell as the tables name it, in the order of ``KEY``."""
    return cell.road, cell.vehicle, str(cell.scheme), cell.solver, cell.limits


def tuning_key(solver: str, limits: str) -> str:
    """Return the name by which a solver's tolerance for a class of limits is kept."""
    return f"{solver}, {limits}"


def cell_words(parts: Sequence[str], between: str = " ") -> str:
    """Return the name of a cell; its limits only where the benchmark has classes of them, and of one of your own the name alone."""
    return between.join(part for part in parts if part not in {AS_SET, ""})


@dataclass(frozen=True)
class Suite:
    """A benchmark's definition. Lengths in metres; roads and vehicles by name or file.

    Limits lie at ``half_width``; without it ``slack`` beyond the geometric half width of each vehicle on each road, so
    that their rows are in the QP and rarely bind. ``pinch`` moves the outer limit of the tightest bend inwards. ``classes`` of limits
    (see ``CLASSES``) are measured one beside the other, with ``slack`` and ``pinch`` as their measures.

    A planning step that takes longer than ``step_limit`` [s], a cell that takes longer than ``cell_limit`` [s], and a solver that needs
    more than ``memory_limit`` [GB] end their cell. With ``accuracy`` [m] every solver has the loosest tolerance that just meets it;
    with ``sample`` each solves that many recorded QPs of every course, the same ones for all, instead of driving.

    Raises:
        OptionError: an empty list, an entry twice, a value outside its range, settings that contradict each other.

    """

    roads: tuple[str, ...] = ROADS
    vehicles: tuple[str, ...] = ("bus", "tractor-trailer")
    schemes: tuple[str, ...] = ("rti", "sqp")
    objective: str = "geometric"
    solvers: tuple[str, ...] = ("riccati", "piqp", "clarabel", "osqp")
    rounds: int = 3
    budget: float = 60.0  # of planning time for one drive [s]
    limits: bool = True
    half_width: float | None = None
    slack: float = 0.5
    pinch: float | None = None
    horizon: float = 100.0
    step: float = 0.5
    replan: float = 5.0
    classes: tuple[str, ...] = ()
    accuracy: float | None = None
    sample: int = 0  # 0: whole drives
    step_limit: float = 30.0
    cell_limit: float = 600.0
    memory_limit: float | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be measured."""
        for name in _LISTS:
            entries = getattr(self, name)
            if not entries or len(set(entries)) < len(entries):
                msg = f"{name} must name at least one entry, and none twice: {', '.join(entries) or 'nothing'}"
                raise OptionError(msg)
        for scheme in self.schemes:
            if scheme not in list(Scheme):
                msg = f"unknown scheme {scheme!r}"
                raise OptionError(msg, hint=f"schemes: {', '.join(Scheme)}")
        if not is_reference(self.objective):  # of whoever measures: its code may be what is under test
            check_objective(self.objective)
        if self.rounds < 1:
            msg = f"rounds must be a positive number, not {self.rounds}"
            raise OptionError(msg)
        drives = (
            prod(len(named) for named in (self.roads, self.vehicles, self.schemes, self.solvers, self.classes or (AS_SET,))) * self.rounds
        )
        if drives > _MOST_DRIVES:
            msg = f"the suite asks for {drives} drives; {_MOST_DRIVES} are the most"
            raise OptionError(msg, hint="make several suites of it")
        if self.sample < 0:
            msg = f"sample must not be negative, but is {self.sample}"
            raise OptionError(msg)
        for name in (*_POSITIVE, "slack"):
            value = getattr(self, name)
            if value is not None and not (np.isfinite(value) and (value > 0.0 or (value == 0.0 and name == "slack"))):
                msg = f"{name} must be {'at least' if name == 'slack' else 'above'} 0, not {value:g}"
                raise OptionError(msg)
        for name in self.classes:
            if name not in CLASSES or self.classes.count(name) > 1:
                msg = f"unknown class of limits {name!r}" if name not in CLASSES else f"classes name {name!r} twice"
                raise OptionError(msg, hint=f"classes: {', '.join(CLASSES)}")
        if self.classes and (self.half_width is not None or not self.limits):
            msg = "classes of limits set the limits themselves"
            raise OptionError(msg, hint="leave out --half-width and --no-limits; --slack and --pinch are measures of the classes")
        if not self.limits and (self.half_width is not None or self.pinch is not None):
            msg = "without limits there is no half width and no pinch"
            raise OptionError(msg, hint="leave out either --no-limits or --half-width and --pinch")
        self.settings(Scheme.RTI)  # refuses lengths that do not divide

    def settings(self, scheme: Scheme) -> PlannerSettings:
        """Return the planner's settings for one scheme."""
        return PlannerSettings(scheme=scheme, horizon=self.horizon, step=self.step, replan=self.replan)

    def courses(self) -> list[tuple[str, str, str]]:
        """Return the triples of road, vehicle and class of limits."""
        return list(product(self.roads, self.vehicles, self.classes or (AS_SET,)))

    def cells(self) -> list[Cell]:
        """Return all cells; those of one course follow each other."""
        schemes = [Scheme(scheme) for scheme in self.schemes]
        return [
            Cell(road, vehicle, scheme, solver, limits)
            for road, vehicle, limits in self.courses()
            for scheme, solver in product(schemes, self.solvers)
        ]

    def to_dict(self) -> dict[str, object]:
        """Return the suite as it is written into ``run.json`` and read from TOML."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items()}


def visits(courses: int, cells: int, rounds: int) -> list[tuple[int, int]]:
    """Return (round, cell) in the order of measurement, for ``courses`` times ``cells`` cells.

    Every round visits the courses in another order, and within a course its cells in another order: the
    cells that are compared lie seconds apart, and neither a warming processor nor a busy hour favours any of them.
    """
    order = []
    for round_ in range(rounds):
        shuffle = np.random.default_rng(round_)
        for course in shuffle.permutation(courses):
            order += [(round_, int(course) * cells + int(cell)) for cell in shuffle.permutation(cells)]
    return order


def read_suite(path: Path) -> dict[str, object]:
    """Return the entries of a suite's TOML file.

    Raises:
        OptionError: no such file, or not TOML.

    """
    return read_toml(path, "suite")


def suite_of(entries: Mapping[str, object]) -> Suite:
    """Return the suite with the given entries, named as its fields; the defaults for the others.

    Raises:
        OptionError: an unknown entry, or one of the wrong kind; see ``Suite`` for the others.

    """
    kinds = {field.name: field.default for field in fields(Suite)}
    values: dict[str, object] = {}
    for name, value in entries.items():
        if name not in kinds:
            msg = f"unknown entry {name!r} in the suite"
            raise OptionError(msg, hint=did_you_mean(name, kinds, f"entries: {', '.join(kinds)}"))
        values[name] = _entry(name, value, kinds[name])
    return Suite(**values)  # type: ignore[arg-type] # every value was brought to its field's type


def _entry(name: str, value: object, like: object) -> object:
    if isinstance(like, tuple) and isinstance(value, list | tuple) and all(isinstance(entry, str) for entry in value):
        return tuple(value)
    if isinstance(like, bool | str):
        if isinstance(value, type(like)):
            return value
    elif isinstance(like, int):
        if isinstance(value, int) and not isinstance(value, bool):
            return value
    elif (isinstance(like, float) or name in _OPTIONAL) and isinstance(value, int | float) and not isinstance(value, bool):
        with suppress(OverflowError):  # TOML's integers have no end
            return float(value)
    elif name in _OPTIONAL and value is None:
        return None
    kind = _KINDS.get(type(like), "a number")
    msg = f"the suite's {name} must be {kind}, not {value!r}"
    raise OptionError(msg)
