"""What a study is: roads, vehicles, widths, objectives and settings, of which every combination is one cell. Read from TOML."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from hdvplan.case import content_digest
from hdvplan.errors import OptionError
from hdvplan.fileio import read_toml
from hdvplan.machine import software
from hdvplan.planning.objective_names import check_objective
from hdvplan.planning.settings import Discretisation, PlannerSettings, Scheme
from hdvplan.plugins import OBJECTIVE, SOLVER, digest_of, identity_of, is_reference, version_of
from hdvplan.road.options import RoadOptions
from hdvplan.road.regions import Side
from hdvplan.solvers.registry import DEFAULT, check_solver
from hdvplan.study.entries import Kind, choice, entry, flattened, list_of, refuse_many, refuse_unknown, repeats, table_of, words_of
from hdvplan.study.inputs import RoadSource, Variant, roads_of, variants_of

_ENTRIES = ("roads", "vehicles", "half_widths", "left", "right", "objectives", "schemes", "solvers", "settings", "vary", "need")
_LENGTHS = ("horizon", "step", "replan", "smoothness", "clearance")  # of the planner's settings
_READING: dict[str, Any] = {"smooth": float, "crs": str, "unit": str, "corners": str, "corner_radius": float}
_COMMON = (*_READING, "proof", "refine")  # settings that every cell has in common
_SETTINGS = (*_LENGTHS, "discretisation", "offset", "reverse", "bias", "pass", *_COMMON)
_MOST_CELLS = 100_000_000  # of one study: 5 GB of keys, and two days to hand them out


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
    bias_digest: str | None = None  # of the content of its file, where it has one
    side: Side | None = None  # on which obstacles on the line are passed; None: the better one


_Parts = tuple[tuple[RoadSource, ...], tuple[Variant, ...], tuple[Width | None, ...], tuple[str, ...], tuple[str, ...], tuple[Manner, ...]]


@dataclass(frozen=True)
class Study:
    """A study's definition; a width of None is the road's own limits. Nothing of the roads but their names and contents is known yet."""

    roads: tuple[RoadSource, ...]
    vehicles: tuple[Variant, ...]
    widths: tuple[Width | None, ...] = (None,)
    objectives: tuple[str, ...] = ("geometric",)
    solvers: tuple[str, ...] = (DEFAULT,)
    manners: tuple[Manner, ...] = (Manner(PlannerSettings()),)
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
        """What is combined, the outermost first: roads, vehicles, widths, objectives, solvers and manners."""
        return self.roads, self.vehicles, self.widths, self.objectives, self.solvers, self.manners

    @cached_property
    def code(self) -> Mapping[tuple[str, str], str]:
        """Digests of the code that plans, by solver and objective, as it is when they are first asked for: a study keeps its keys."""
        return {pair: _code(*pair) for pair in product(self.solvers, self.objectives)}

    def __len__(self) -> int:
        """Return the number of cells."""
        return prod(map(len, self.parts))


def _code(solver: str, objective: str) -> str:
    """Return a digest of hdvplan's source, the libraries' versions, and of what users brought, as it is now."""
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
    return study_of(read_toml(path, "study", hint='words stand in quotes: roads = ["line_11.geojson"]'), path.parent)


def study_of(entries: Mapping[str, object], folder: Path = Path()) -> Study:
    """Return the study with the given entries, named as in its file; ``folder`` is where the files that they name lie.

    Raises:
        HdvplanError: see ``read_study``.

    """
    refuse_unknown(entries, _ENTRIES, "in the study")
    for name in ("roads", "vehicles"):
        if name not in entries:
            msg = f"the study names no {name}"
            raise OptionError(msg, hint=f'{name} = ["{"uturn" if name == "roads" else "bus"}"], for example')
    objectives, solvers = (
        tuple(_beside(name, folder) for name in words_of(entries, kind, usual))
        for kind, usual in (("objectives", "geometric"), ("solvers", DEFAULT))
    )
    for objective in objectives:
        check_objective(objective)
    for solver in solvers:
        check_solver(solver)
    settings = table_of(entries, "settings")
    refuse_unknown(settings, _SETTINGS, "in the study's settings", "settings")
    reading = RoadOptions(**{name: _setting(settings, name, kind) for name, kind in _READING.items() if name in settings})
    if reading.crs is not None:
        from hdvplan.road.crs import parse_crs  # noqa: PLC0415 - few studies need it

        parse_crs(reading.crs)
    study = Study(
        roads=roads_of(list_of(entries, "roads"), folder),
        vehicles=variants_of(words_of(entries, "vehicles"), flattened(table_of(entries, "vary")), folder),
        widths=_widths(entries),
        objectives=objectives,
        solvers=solvers,
        manners=_manners(words_of(entries, "schemes", Scheme.RTI), settings, folder),
        prove=_setting(settings, "proof", bool, otherwise=False),
        refine=_setting(settings, "refine", bool, otherwise=True),
        need=_setting(entries, "need", bool, otherwise=False),
        reading=reading,
    )
    refuse_many(prod(map(len, study.parts)), "cells", _MOST_CELLS)
    return study


def _setting(entries: Mapping[str, object], name: str, kind: type[Kind], otherwise: Kind | None = None) -> Kind:
    return entry(f"the study's {name}", entries.get(name, otherwise), kind)


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
    left, right = _reaches(entries, "left", repeated=True), _reaches(entries, "right", repeated=True)
    if len(left) != len(right):
        msg = f"left and right are pairs, but there are {len(left)} and {len(right)} of them"
        raise OptionError(msg)
    pairs = list(zip(left, right, strict=True))
    if repeats(pairs):
        msg = "left and right must name no pair twice"
        raise OptionError(msg)
    return tuple(Width(*pair) for pair in pairs)


def _reaches(entries: Mapping[str, object], name: str, *, repeated: bool = False) -> list[float]:
    reaches = [entry(f"the study's {name}", value, float) for value in list_of(entries, name, repeated=repeated)]
    for reach in reaches:
        if not reach > 0.0:
            msg = f"{name} must be positive numbers of metres, not {reach:g}"
            raise OptionError(msg)
    return reaches


def _manners(schemes: Sequence[str], settings: Mapping[str, object], folder: Path) -> tuple[Manner, ...]:
    """Return every combination of the settings; each of them may be a list."""
    for scheme in schemes:
        choice("schemes", scheme, list(Scheme))
    lists = {name: list_of(settings, name) for name in settings if name not in _COMMON}
    refuse_many(len(schemes) * prod(map(len, lists.values())), "combinations of settings")
    if "bias" in lists:
        lists["bias"] = [_bias(value, folder) for value in lists["bias"]]
    found = []
    for kind, *values in product(schemes, *lists.values()):
        chosen = dict(zip(lists, values, strict=True))
        lengths = {name: _setting(chosen, name, float) for name in _LENGTHS if name in chosen}
        rule = choice("discretisation", chosen.get("discretisation", Discretisation.MIDPOINT), list(Discretisation))
        planner = PlannerSettings(scheme=Scheme(str(kind)), discretisation=Discretisation(rule), **lengths)  # type: ignore[arg-type] # all are lengths or weights
        given = chosen.get("bias")
        bias, bias_digest = given if isinstance(given, tuple) else (None, None)
        offset, reverse = _setting(chosen, "offset", float, 0.0), _setting(chosen, "reverse", bool, otherwise=False)
        side = Side(choice("pass", chosen["pass"], list(Side))) if "pass" in chosen else None
        found.append(Manner(planner, offset, reverse, bias, bias_digest, side))
    return tuple(found)


def _bias(value: object, folder: Path) -> tuple[str, str | None]:
    """Return a bias as ``hdvplan plan --bias`` takes it, and a digest of its file, which lies in ``folder`` or is none."""
    if not isinstance(value, str):
        return repr(entry("the study's bias", value, float)), None
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
