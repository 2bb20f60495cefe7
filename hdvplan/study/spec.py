"""What a study is: roads, vehicles, widths, objectives and settings, of which every combination is one cell. Read from TOML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from math import inf, prod
from pathlib import Path
from typing import Any, TypedDict

from hdvplan import schema
from hdvplan.case import content_digest
from hdvplan.errors import OptionError
from hdvplan.machine import software
from hdvplan.planning.settings import LARGEST, OBJECTIVE_NAMES, PlannerSettings, Scheme, check_objective
from hdvplan.plugins import OBJECTIVE, SOLVER, digest_of, identity_of, is_reference, version_of
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Side
from hdvplan.settings import fields_of
from hdvplan.solvers.registry import DEFAULT, check_solver
from hdvplan.study.inputs import RoadSource, RoadTable, Variant, refuse_many, roads_of, variants_of

_READING = ("smooth", "crs", "unit", "corners", "corner_radius")  # settings that every cell has in common, as proof and refine
_PLANNER = {name: field.kind for name, field in fields_of(PlannerSettings).items() if field.setting.words and name != "scheme"}
_VARIED = _PLANNER | {"clearance": float | str, "offset": float, "reverse": bool, "bias": float | str, "pass": Side}  # each may be a list
_COMMON: dict[str, Any] = {name: fields_of(RoadOptions)[name].kind for name in _READING} | {"proof": bool, "refine": bool}
_ENTRIES: dict[str, Any] = {name: tuple.__class_getitem__((kind, ...)) for name, kind in _VARIED.items()} | _COMMON
_Settings: Any = TypedDict("_Settings", _ENTRIES, total=False)  # type: ignore[misc] # it is made of the fields


@dataclass(frozen=True)
class _StudyTable:
    """A study's file."""

    roads: tuple[str | RoadTable, ...]
    vehicles: tuple[str, ...]
    half_widths: tuple[float, ...] | None = None
    left: tuple[float, ...] | None = None
    right: tuple[float, ...] | None = None
    objectives: tuple[str, ...] = (OBJECTIVE_NAMES[0],)
    schemes: tuple[Scheme, ...] = (Scheme.RTI,)
    solvers: tuple[str, ...] = (DEFAULT,)
    settings: _Settings = field(default_factory=dict)  # type: ignore[assignment] # as above
    vary: dict[str, object] = field(default_factory=dict)
    need: bool = False


_MOST_CELLS = 100_000_000  # of one study: 5 GB of keys, and two days to hand them out


@dataclass(frozen=True)
class Width:
    """Constant limits, as positive reaches [m]."""

    left: float
    right: float


@dataclass(frozen=True)
class Setup:
    """How a road is driven: the planner's settings, and where beside the line; ``offset`` [m] left positive."""

    settings: PlannerSettings
    offset: float = 0.0
    reverse: bool = False
    bias: str | None = None  # as ``hdvplan plan --bias`` takes it
    bias_digest: str | None = None  # of the content of its file, where it has one
    side: Side | None = None  # on which obstacles on the line are passed; None: the better one
    clearest: bool = False  # with the largest clearance that can be kept


_Parts = tuple[tuple[RoadSource, ...], tuple[Variant, ...], tuple[Width | None, ...], tuple[str, ...], tuple[str, ...], tuple[Setup, ...]]


@dataclass(frozen=True)
class Study:
    """A study's definition; a width of None is the road's own limits. Nothing of the roads but their names and contents is known yet."""

    roads: tuple[RoadSource, ...]
    vehicles: tuple[Variant, ...]
    widths: tuple[Width | None, ...] = (None,)
    objectives: tuple[str, ...] = ("geometric",)
    solvers: tuple[str, ...] = (DEFAULT,)
    setups: tuple[Setup, ...] = (Setup(PlannerSettings()),)
    reading: RoadOptions = field(default_factory=RoadOptions)
    prove: bool = False
    refine: bool = True
    need: bool = False

    @property
    def varied(self) -> tuple[str, ...]:
        """The names of the parameters that vary, in the order of the study; each is a column of the tables."""
        return tuple(dict.fromkeys(name for variant in self.vehicles for name, _ in variant.varied))

    @property
    def parts(self) -> _Parts:
        """What is combined, the outermost first: roads, vehicles, widths, objectives, solvers and setups."""
        return self.roads, self.vehicles, self.widths, self.objectives, self.solvers, self.setups

    @cached_property
    def code(self) -> Mapping[tuple[str, str], str]:
        """Digests of the code that plans, by solver and objective, as it is when they are first asked for: a study keeps its keys."""
        return {pair: _code(*pair) for pair in product(self.solvers, self.objectives)}

    def __len__(self) -> int:
        """Return the number of cells."""
        return prod(map(len, self.parts))


def _code(solver: str, objective: str) -> str:
    brought = [[*identity_of(name), version_of(kind, name)] for kind, name in ((SOLVER, solver), (OBJECTIVE, objective))]
    return content_digest([software(() if is_reference(solver) else (solver,)), brought])


def read_study(path: Path) -> Study:
    """Return the study in a TOML file; files that it names lie relative to its folder.

    Raises:
        OptionError: no such file, not TOML, or an entry that makes no study.
        RoadError: a road that does not exist.
        VehicleError: a vehicle that cannot be used.
        SolverError: a solver that is unknown or not installed.

    """
    return study_of(schema.read_toml(path, "study", hint='words stand in quotes: roads = ["line_11.geojson"]'), path.parent)


def study_of(entries: Mapping[str, object], folder: Path = Path()) -> Study:
    """Return the study with the given entries, named as in its file; ``folder`` is where the files that they name lie.

    Raises:
        HdvplanError: see ``read_study``.

    """
    table = _StudyTable(**schema.entries(_StudyTable, entries, "study", single=True))
    settings: dict[str, Any] = dict(table.settings)
    for name, values in (vars(table) | settings).items():
        if isinstance(values, tuple) and (not values or (len(set(values)) < len(values) and name not in {"left", "right"})):
            msg = f"{name} must name at least one entry, and none twice: {', '.join(map(str, values)) or 'nothing'}"
            raise OptionError(msg)
    objectives, solvers = (tuple(_beside(name, folder) for name in names) for names in (table.objectives, table.solvers))
    for objective in objectives:
        check_objective(objective)
    for solver in solvers:
        check_solver(solver)
    reading = RoadOptions(**{name: settings[name] for name in _READING if name in settings})
    if reading.crs is not None:
        from hdvplan.road.crs import parse_crs  # noqa: PLC0415 - few studies need it

        parse_crs(reading.crs)
    study = Study(
        roads=roads_of(table.roads, folder),
        vehicles=variants_of(table.vehicles, _flattened(table.vary), folder),
        widths=_widths(table),
        objectives=objectives,
        solvers=solvers,
        setups=_setups(table.schemes, {name: values for name, values in settings.items() if name in _VARIED}, folder),
        prove=settings.get("proof", False),
        refine=settings.get("refine", True),
        need=table.need,
        reading=reading,
    )
    if study.need and any(setup.clearest for setup in study.setups):
        msg = f"need = true finds the least room with a clearance that is given; clearance = {LARGEST!r} has none"
        raise OptionError(msg, hint="give the clearance in metres, or make two studies")
    refuse_many(prod(map(len, study.parts)), "cells", _MOST_CELLS)
    return study


def _flattened(table: Mapping[str, object], before: str = "") -> dict[str, object]:
    """Return a table in which ``a.b`` may stand in quotes or not."""
    flat: dict[str, object] = {}
    for name, value in table.items():
        found = _flattened(value, f"{before}{name}.") if isinstance(value, dict) else {before + name: value}
        if twice := found.keys() & flat.keys():
            msg = f"vary names {min(twice)!r} twice, with quotes and without"
            raise OptionError(msg)
        flat |= found
    return flat


def _widths(table: _StudyTable) -> tuple[Width | None, ...]:
    """Return the limits of the study: at both sides alike, or pairs of ``left`` and ``right``; else the roads' own."""
    left, right = table.left, table.right
    for name in ("half_widths", "left", "right"):
        for reach in getattr(table, name) or ():
            if not 0.0 < reach < inf:
                msg = f"{name} must be positive numbers of metres, not {reach:g}"
                raise OptionError(msg)
    if table.half_widths is not None:
        if left is not None or right is not None:
            msg = "half_widths set both limits; they cannot be combined with left and right"
            raise OptionError(msg)
        return tuple(Width(reach, reach) for reach in table.half_widths)
    if left is None and right is None:
        return (None,)
    if left is None or right is None:
        given, missing = ("left", "right") if right is None else ("right", "left")
        msg = f"{given} needs {missing}"
        raise OptionError(msg, hint="or give half_widths for both")
    if len(left) != len(right):
        msg = f"left and right are pairs, but there are {len(left)} and {len(right)} of them"
        raise OptionError(msg)
    pairs = list(zip(left, right, strict=True))
    if len(set(pairs)) < len(pairs):
        msg = "left and right must name no pair twice"
        raise OptionError(msg)
    return tuple(Width(*pair) for pair in pairs)


def _setups(schemes: Sequence[Scheme], lists: dict[str, Any], folder: Path) -> tuple[Setup, ...]:
    refuse_many(len(schemes) * prod(map(len, lists.values())), "combinations of settings")
    if "bias" in lists:
        lists["bias"] = [_bias(value, folder) for value in lists["bias"]]
    found = []
    for scheme, *values in product(schemes, *lists.values()):
        chosen: dict[str, Any] = dict(zip(lists, values, strict=True))
        clearest = isinstance(chosen.get("clearance"), str)
        if clearest and chosen.pop("clearance") != LARGEST:
            msg = f"clearance must be a number of metres or {LARGEST!r}"
            raise OptionError(msg)
        planner = PlannerSettings(scheme=scheme, **{name: chosen[name] for name in _PLANNER if name in chosen})
        bias, bias_digest = chosen.get("bias", (None, None))
        offset = chosen.get("offset", 0.0)
        found.append(Setup(planner, offset, chosen.get("reverse", False), bias, bias_digest, chosen.get("pass"), clearest))
    return tuple(found)


def _bias(value: float | str, folder: Path) -> tuple[str, str | None]:
    """Return a bias as ``hdvplan plan --bias`` takes it, and a digest of its file, which lies in ``folder`` or is none."""
    if not isinstance(value, str):
        return repr(value), None
    from hdvplan.planning.bias import CENTRE, bias_named  # noqa: PLC0415 - few studies have such a word

    if value == CENTRE:  # of limits that only the roads know
        return value, None
    text = str(folder / value) if (folder / value).is_file() else value
    bias_named(text, None)
    return text, digest_of(Path(text)) if Path(text).is_file() else None


def _beside(name: str, folder: Path) -> str:
    """Return the name of a solver or an objective; of one in a file in ``folder``, ``file.py:name``, with the folder."""
    file, _, own = name.rpartition(":")
    return f"{folder / file}:{own}" if file.endswith(".py") and (folder / file).is_file() else name
