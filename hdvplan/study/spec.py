"""What a study is: roads, vehicles, widths, objectives and settings, of which every combination is one cell. Read from TOML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path

from hdvplan.errors import OptionError, did_you_mean
from hdvplan.fileio import read_toml
from hdvplan.planning.discretisation import Discretisation
from hdvplan.planning.objective_names import check_objective
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.road.load import RoadOptions
from hdvplan.road.regions import Side
from hdvplan.solvers.registry import DEFAULT, check_solver
from hdvplan.study.inputs import RoadSource, Variant, is_number, refuse_many, roads_of, variants_of

_ENTRIES = ("roads", "vehicles", "half_widths", "left", "right", "objectives", "schemes", "solvers", "settings", "vary", "need")
_LENGTHS = ("horizon", "step", "replan", "smoothness", "clearance")  # of the planner's settings
_READING = ("smooth", "crs", "proof", "refine")  # settings that every cell has in common
_SETTINGS = (*_LENGTHS, "discretisation", "offset", "reverse", "bias", "pass", *_READING)


@dataclass(frozen=True)
class Width:
    """Constant limits, as positive reaches [m]."""

    left: float
    right: float


@dataclass(frozen=True)
class Manner:
    """How a road is driven: the planner's settings, and where beside the line; ``offset`` [m] left positive."""

    settings: PlannerSettings
    offset: float = 0.0
    reverse: bool = False
    bias: str | None = None  # as ``hdvplan plan --bias`` takes it
    side: Side | None = None  # on which obstacles on the line are passed; None: the better one


@dataclass(frozen=True)
class Study:
    """A study's definition; a width of None is the road's own limits. Nothing of the roads but their names and contents is known yet."""

    roads: tuple[RoadSource, ...]
    vehicles: tuple[Variant, ...]
    widths: tuple[Width | None, ...] = (None,)
    objectives: tuple[str, ...] = ("geometric",)
    solvers: tuple[str, ...] = (DEFAULT,)
    manners: tuple[Manner, ...] = (Manner(PlannerSettings()),)
    smooth: float = RoadOptions.smooth
    crs: str | None = None
    prove: bool = False
    refine: bool = True
    need: bool = False

    @property
    def varied(self) -> tuple[str, ...]:
        """The names of the parameters that vary, in the order of the study; each is a column of the tables."""
        return tuple(dict.fromkeys(name for variant in self.vehicles for name, _ in variant.varied))

    def __len__(self) -> int:
        """Return the number of cells."""
        parts: tuple[Sequence[object], ...] = (self.roads, self.vehicles, self.widths, self.objectives, self.solvers, self.manners)
        count = 1
        for part in parts:
            count *= len(part)
        return count


def read_study(path: Path) -> Study:
    """Return the study in a TOML file; files that it names lie relative to its folder.

    Raises:
        OptionError: no such file, not TOML, or an entry that makes no study.
        RoadError: a road that does not exist.
        VehicleError: a vehicle that cannot be used.
        SolverError: a solver that is unknown or not installed.

    """
    return study_of(read_entries(path), path.parent)


def read_entries(path: Path) -> dict[str, object]:
    """Return what a study's TOML file says.

    Raises:
        OptionError: no such file, or not TOML.

    """
    return read_toml(path, "study", hint='words stand in quotes: roads = ["line_11.geojson"]')


def study_of(entries: Mapping[str, object], folder: Path = Path()) -> Study:
    """Return the study with the given entries, named as in its file; ``folder`` is where the files that they name lie.

    Raises:
        HdvplanError: see ``read_study``.

    """
    for name in entries:
        if name not in _ENTRIES:
            msg = f"unknown entry {name!r} in the study"
            raise OptionError(msg, hint=did_you_mean(name, _ENTRIES, f"entries: {', '.join(_ENTRIES)}"))
    for name in ("roads", "vehicles"):
        if name not in entries:
            msg = f"the study names no {name}"
            raise OptionError(msg, hint=f'{name} = ["{"uturn" if name == "roads" else "bus"}"], for example')
    objectives, solvers = _words(entries, "objectives", "geometric"), _words(entries, "solvers", DEFAULT)
    for objective in objectives:
        check_objective(objective)
    for solver in solvers:
        check_solver(solver)
    settings = _table(entries, "settings")
    for name in settings:
        if name not in _SETTINGS:
            msg = f"unknown entry {name!r} in the study's settings"
            raise OptionError(msg, hint=did_you_mean(name, _SETTINGS, f"settings: {', '.join(_SETTINGS)}"))
    smooth = _number("smooth", settings.get("smooth", RoadOptions.smooth))
    RoadOptions(smooth=smooth)  # refuses what no road can be read with
    return Study(
        roads=roads_of(_list(entries, "roads"), folder),
        vehicles=variants_of(_words(entries, "vehicles"), _flat(_table(entries, "vary")), folder),
        widths=_widths(entries),
        objectives=objectives,
        solvers=solvers,
        manners=_manners(_words(entries, "schemes", Scheme.RTI), settings),
        smooth=smooth,
        crs=_word("crs", settings["crs"]) if "crs" in settings else None,
        prove=_truth("proof", settings.get("proof", False)),
        refine=_truth("refine", settings.get("refine", True)),
        need=_truth("need", entries.get("need", False)),
    )


def _widths(entries: Mapping[str, object]) -> tuple[Width | None, ...]:
    """Return the limits of the study: at both sides alike, or pairs of ``left`` and ``right``; else the roads' own."""
    if "half_widths" in entries:
        if "left" in entries or "right" in entries:
            msg = "half_widths set both limits; they cannot be combined with left and right"
            raise OptionError(msg)
        return tuple(Width(reach, reach) for reach in _reaches(entries, "half_widths"))
    if ("left" in entries) != ("right" in entries):
        given, missing = ("left", "right") if "left" in entries else ("right", "left")
        msg = f"{given} needs {missing}"
        raise OptionError(msg, hint="or give half_widths for both")
    if "left" not in entries:
        return (None,)
    left, right = _reaches(entries, "left"), _reaches(entries, "right")
    if len(left) != len(right):
        msg = f"left and right are pairs, but there are {len(left)} and {len(right)} of them"
        raise OptionError(msg)
    return tuple(Width(*pair) for pair in zip(left, right, strict=True))


def _reaches(entries: Mapping[str, object], name: str) -> list[float]:
    reaches = [_number(name, value) for value in _list(entries, name)]
    for reach in reaches:
        if not reach > 0.0:
            msg = f"{name} must be positive numbers of metres, not {reach:g}"
            raise OptionError(msg)
    return reaches


def _manners(schemes: Sequence[str], settings: Mapping[str, object]) -> tuple[Manner, ...]:
    """Return every combination of the settings; each of them may be a list."""
    for scheme in schemes:
        _choice("schemes", scheme, list(Scheme))
    lists = {name: _list(settings, name) for name in settings if name not in _READING}
    refuse_many(len(schemes) * prod(map(len, lists.values())), "combinations of settings")
    found = []
    for kind, *values in product(schemes, *lists.values()):
        chosen = dict(zip(lists, values, strict=True))
        lengths = {name: _number(name, chosen[name]) for name in _LENGTHS if name in chosen}
        rule = _choice("discretisation", chosen.get("discretisation", Discretisation.MIDPOINT), list(Discretisation))
        planner = PlannerSettings(scheme=Scheme(str(kind)), discretisation=Discretisation(rule), **lengths)  # type: ignore[arg-type] # all are lengths or weights
        bias = chosen.get("bias")
        side = _choice("pass", chosen["pass"], list(Side)) if "pass" in chosen else None
        found.append(
            Manner(
                planner,
                offset=_number("offset", chosen.get("offset", 0.0)),
                reverse=_truth("reverse", chosen.get("reverse", False)),
                bias=None if bias is None else bias if isinstance(bias, str) else repr(_number("bias", bias)),
                side=None if side is None else Side(side),
            )
        )
    return tuple(found)


def _flat(table: Mapping[str, object], before: str = "") -> dict[str, object]:
    """Return a table in which ``a.b`` may stand in quotes or not."""
    flat: dict[str, object] = {}
    for name, value in table.items():
        flat |= _flat(value, f"{before}{name}.") if isinstance(value, dict) else {before + name: value}
    return flat


def _table(entries: Mapping[str, object], name: str) -> Mapping[str, object]:
    value = entries.get(name, {})
    if not isinstance(value, Mapping):
        msg = f"the study's {name} must be a table, not {value!r}"
        raise OptionError(msg, hint=f"it begins with a line [{name}]")
    return value


def _list(entries: Mapping[str, object], name: str) -> list[object]:
    """Return an entry as a list without repetition; a single value is a list of one."""
    value = entries[name]
    values = list(value) if isinstance(value, list | tuple) else [value]
    if not values or _repeats(values):
        msg = f"{name} must name at least one entry, and none twice: {', '.join(map(str, values)) or 'nothing'}"
        raise OptionError(msg)
    return values


def _repeats(values: list[object]) -> bool:
    try:
        return len(set(values)) < len(values)
    except TypeError:  # tables have no hash; there are few of them
        return any(one in values[:number] for number, one in enumerate(values))


def _words(entries: Mapping[str, object], name: str, otherwise: str | None = None) -> tuple[str, ...]:
    if name not in entries and otherwise is not None:
        return (otherwise,)
    return tuple(_word(name, value) for value in _list(entries, name))


def _word(name: str, value: object) -> str:
    if not isinstance(value, str):
        msg = f"the study's {name} must be words in quotes, not {value!r}"
        raise OptionError(msg)
    return value


def _choice(name: str, value: object, choices: Sequence[str]) -> str:
    if value not in choices:
        msg = f"{name} must be {', '.join(choices[:-1])} or {choices[-1]}, not {value!r}"
        raise OptionError(msg)
    return str(value)


def _number(name: str, value: object) -> float:
    if not is_number(value):
        msg = f"the study's {name} must be a number, not {value!r}"
        raise OptionError(msg)
    return float(value)


def _truth(name: str, value: object) -> bool:
    if not isinstance(value, bool):
        msg = f"the study's {name} must be true or false, not {value!r}"
        raise OptionError(msg)
    return value
