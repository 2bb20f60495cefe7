"""What a benchmark runs: its cells, their order, and everything else that must be the same for two runs to be comparable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from itertools import product
from math import prod
from pathlib import Path
from types import MappingProxyType
from typing import Annotated

from hdvplan.errors import OptionError
from hdvplan.planning.settings import Horizon, PlannerSettings, Replan, Scheme, Step
from hdvplan.settings import Setting, check

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
AS_SET = "as set"
_MOST_DRIVES = 100_000  # of one benchmark: weeks, and as many files
GIVEN = "given"
CLASSES = {
    "off": "no limits",
    "inactive": "limits beyond what the tightest bend asks for",
    "binding": "the same, with the outer limit of the tightest bend moved inwards",
    "unkeepable": "limits half-way between the vehicle's side and what the tightest bend asks for",
    GIVEN: "the road's own limits and obstacles, as in `plan`",
}


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
    """A benchmark's definition. Lengths in metres; roads and vehicles by name or file: ``files`` has those that lie elsewhere.

    Limits lie at ``half_width``; without it ``slack`` beyond the geometric half width of each vehicle on each road, so
    that their rows are in the QP and rarely bind. ``pinch`` moves the outer limit of the tightest bend inwards. ``classes`` of limits
    (see ``CLASSES``) are measured one beside the other, with ``slack`` and ``pinch`` as their measures.

    A planning step that takes longer than ``step_limit`` [s], a cell that takes longer than ``cell_limit`` [s], and a solver that needs
    more than ``memory_limit`` [GB] end their cell. With ``accuracy`` [m] every solver has the loosest tolerance that just meets it;
    with ``sample`` each solves that many recorded QPs of every course, the same ones for all, instead of driving.

    Raises:
        OptionError: an empty list, an entry twice, a value outside its range, settings that contradict each other.

    """

    solvers: Annotated[tuple[str, ...], Setting("Names from `hdvplan solvers`, or your own: file.py:Class.", "A,B", listed=True)] = (
        "riccati",
        "piqp",
        "clarabel",
        "osqp",
    )
    vehicles: Annotated[tuple[str, ...], Setting("Names from `hdvplan vehicles list`, or vehicle files.", "A,B", listed=True)] = (
        "bus",
        "tractor-trailer",
    )
    roads: Annotated[tuple[str, ...], Setting("Names from `hdvplan roads list`, or road files.", "A,B", listed=True)] = ROADS
    schemes: Annotated[
        tuple[str, ...],
        Setting("rti: the real-time iteration, one QP a step; sqp: QPs to convergence.", "rti,sqp", listed=True),
    ] = ("rti", "sqp")
    objective: Annotated[str, Setting("What all plans centre, as in `plan` [default: geometric].", "NAME")] = "geometric"
    road_ids: Annotated[str | None, Setting("Roads or lanelets in driving order, as in `plan`; of every road.", "A,B,...")] = None
    half_width: Annotated[float | None, Setting("Limits at M to either side of the line [m].", "M", above=0.0)] = None
    slack: Annotated[float, Setting("Limits this far beyond the geometric half width [m].", "M", least=0.0)] = 0.5
    limits: bool = True
    pinch: Annotated[float | None, Setting("Move the outer limit of the tightest bend inwards over 6 m of road [m].", "M", above=0.0)] = (
        None
    )
    classes: Annotated[
        tuple[str, ...],
        Setting(f"Measure classes of limits side by side: {', '.join(CLASSES)}: the road's own, that others replace.", "A,B", listed=True),
    ] = ()
    rounds: Annotated[int, Setting("How often every cell is driven.", "N", above=0)] = 3
    accuracy: Annotated[
        float | None,
        Setting("Give every solver the loosest tolerance that keeps the path this near the optimum [m].", "M", above=0.0),
    ] = None
    sample: Annotated[int, Setting("Solve N recorded QPs of every drive instead of driving.", "N", least=0)] = 0  # 0: whole drives
    horizon: Horizon = 100.0
    step: Step = 0.5
    replan: Replan = 5.0
    budget: Annotated[float, Setting("Most planning time of one drive [s].", "S", above=0.0)] = 60.0
    step_limit: Annotated[float, Setting("Longest planning step; a longer one ends its cell [s].", "S", above=0.0)] = 30.0
    cell_limit: Annotated[
        float, Setting("Longest drive, including its check by the reference; a longer one is ended [s].", "S", above=0.0)
    ] = 600.0
    memory_limit: Annotated[
        float | None, Setting("Most memory of the measuring process, where the system can limit it.", "GB", above=0.0)
    ] = None
    files: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Refuse what cannot be measured."""
        from hdvplan.planning.settings import check_objective  # noqa: PLC0415 - as below
        from hdvplan.plugins import is_reference  # noqa: PLC0415 - --help needs the fields alone

        check(self)
        for scheme in self.schemes:
            if scheme not in list(Scheme):
                msg = f"unknown scheme {scheme!r}"
                raise OptionError(msg, hint=f"schemes: {', '.join(Scheme)}")
        if not is_reference(self.objective):  # of whoever measures: its code may be what is under test
            check_objective(self.objective)
        drives = (
            prod(len(named) for named in (self.roads, self.vehicles, self.schemes, self.solvers, self.classes or (AS_SET,))) * self.rounds
        )
        if drives > _MOST_DRIVES:
            msg = f"the suite asks for {drives} drives; {_MOST_DRIVES} are the most"
            raise OptionError(msg, hint="make several suites of it")
        for name in self.classes:
            if name not in CLASSES:
                msg = f"unknown class of limits {name!r}"
                raise OptionError(msg, hint=f"classes: {', '.join(CLASSES)}")
        if self.classes and (self.half_width is not None or not self.limits):
            msg = "classes of limits set the limits themselves"
            raise OptionError(msg, hint="leave out --half-width and --no-limits; --slack and --pinch are measures of the classes")
        if not self.limits and (self.half_width is not None or self.pinch is not None or self.slack != Suite.slack):
            msg = "without limits there is no half width, no slack and no pinch"
            raise OptionError(msg, hint="leave out either --no-limits, or --half-width, --slack and --pinch")
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

    def file(self, name: str) -> Path | None:
        """Return the file that a road or vehicle of the suite names; None where it is shipped."""
        path = Path(self.files.get(name, name))
        return path if path.is_file() else None

    def to_dict(self) -> dict[str, object]:
        """Return the suite as it is written into ``run.json`` and read from TOML; where its files lie depends on who runs it."""
        return {name: list(value) if isinstance(value, tuple) else value for name, value in asdict(self).items() if name != "files"}


def visits(courses: int, cells: int, rounds: int) -> list[tuple[int, int]]:
    """Return (round, cell) in the order of measurement, for ``courses`` times ``cells`` cells.

    Every round visits the courses in another order, and within a course its cells in another order: the
    cells that are compared lie seconds apart, and neither a warming processor nor a busy hour favours any of them.
    """
    import numpy as np  # noqa: PLC0415 - as above

    order = []
    for round_ in range(rounds):
        shuffle = np.random.default_rng(round_)
        for course in shuffle.permutation(courses):
            order += [(round_, int(course) * cells + int(cell)) for cell in shuffle.permutation(cells)]
    return order


def read_suite(path: Path | None, given: Mapping[str, object] = MappingProxyType({})) -> dict[str, object]:
    """Return the entries of a suite's TOML file, and the ``files`` beside it that these name; those that are ``given`` replace its own.

    Raises:
        OptionError: no such file, or not TOML, or one that says itself where its files are.

    """
    from hdvplan.schema import read_toml  # noqa: PLC0415 - as above

    if path is None:
        return dict(given)
    entries = read_toml(path, "suite")
    if "files" in entries:
        msg = "suite: unknown entry 'files'"
        raise OptionError(msg, hint="roads and vehicles may be files, beside the suite or in the working directory")
    lists = [names for key in ("roads", "vehicles") if key not in given and isinstance(names := entries.get(key), list)]
    beside = {name: path.parent / name for names in lists for name in names if isinstance(name, str)}
    return {"files": {name: str(file) for name, file in beside.items() if file.is_file()}, **entries, **given}


def suite_of(entries: Mapping[str, object]) -> Suite:
    """Return the suite with the given entries, named as its fields; the defaults for the others.

    Raises:
        OptionError: an unknown entry, or one of the wrong kind; see ``Suite`` for the others.

    """
    from hdvplan.schema import read  # noqa: PLC0415 - as above

    return read(Suite, entries, "suite")
