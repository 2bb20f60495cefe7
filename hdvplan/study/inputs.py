"""The roads and vehicles that a study names: files, globs, folders and shipped names, and vehicles whose dimensions vary."""

from __future__ import annotations

import re
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from glob import escape, glob
from itertools import product
from math import prod
from pathlib import Path

import numpy as np

from hdvplan.case import content_digest
from hdvplan.errors import OptionError, RoadError, VehicleError, refused_in
from hdvplan.plugins import digest_of
from hdvplan.road.options import RoadOptions
from hdvplan.road.scenarios import SCENARIOS, shipped_roads
from hdvplan.texts import did_you_mean, printable
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle

MOST = 100_000  # values of one parameter, variants of one vehicle, combinations of settings
_SEVERAL = (".shp", ".tab", ".mif")  # of which each consists of several files
_GLOB = re.compile(r"[*?\[]")
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_RANGE = re.compile(rf"\s*({_NUMBER})\s*\.\.\s*({_NUMBER})\s*(?:in\s+(\d{{1,9}}))?\s*")
_COUNT = 5  # values of a range that says no number
_MOST = sys.float_info.max  # of a value: integers have no end, and infinity is none
_DIGITS = 12  # decimals of a range's values: 3.5, not 3.5000000000000004
_LEAD = ("max_curvature", "max_curvature_rate")  # of the vehicle, whose first unit steers
_UNIT = tuple(field.name for field in fields(Unit) if field.name != "name")


@dataclass(frozen=True)
class RoadTable:
    """A road of a study's file: its file, glob, folder or shipped name, which line of the file it is, and the file's unit."""

    road: str
    name: str | None = None
    layer: str | None = None
    roles: tuple[str, ...] = ()
    road_ids: str | None = None
    lane: int | None = None
    unit: str | None = None


@dataclass(frozen=True)
class RoadSource:
    """A road of a study, not read yet: ``source`` is its file or shipped name, ``digest`` tells the content of the file.

    The others choose a line of the file, as in ``RoadOptions``, and say its unit; None: that of the study.
    """

    label: str  # what tables call it
    source: str
    digest: str
    feature: str | None = None
    layer: str | None = None
    roles: tuple[str, ...] = ()
    road_ids: str | None = None
    lane: int | None = None
    unit: str | None = None


@dataclass(frozen=True)
class Variant:
    """A vehicle, and which of its parameters have which value in the study."""

    vehicle: Vehicle
    varied: tuple[tuple[str, float], ...] = ()


def roads_of(entries: Sequence[str | RoadTable], folder: Path) -> tuple[RoadSource, ...]:
    """Return the roads that entries name: files, globs and folders relative to ``folder``, or shipped names.

    Raises:
        OptionError: one is there twice, or an unknown unit.
        RoadError: no such file or name, or one that cannot be read.

    """
    found: list[RoadSource] = []
    for one in entries:
        table = one if isinstance(one, RoadTable) else RoadTable(one)
        line = (table.name, table.layer, table.roles, table.road_ids, table.lane, RoadOptions(unit=table.unit).unit)
        found += [RoadSource(label, source, road_digest(source), *line) for label, source in _sources(table.road, folder)]
    return tuple(_told_apart(found))


def road_digest(source: str) -> str:
    """Return a digest of the content of a road's file, or files: a Shapefile and a MapInfo table have several. A scenario's is its name.

    Raises:
        RoadError: it cannot be read.

    """
    path = shipped_roads().get(source, Path(source))
    if source in SCENARIOS and not path.is_file():
        return source
    parts = sorted(path.parent.glob(f"{escape(path.stem)}.*")) if path.suffix.lower() in _SEVERAL else [path]
    try:
        return content_digest([digest_of(part) for part in parts])
    except OSError as error:
        msg = f"road file {path} cannot be read: {error.strerror or error}"
        raise RoadError(msg) from error


def _sources(name: str, folder: Path) -> list[tuple[str, str]]:
    """Return what tables may call the roads of one entry, and where these are."""
    if not name:
        msg = f"a road of the study must be a file, a glob, a folder or a shipped name, not {name!r}"
        raise OptionError(msg)
    path = folder / name
    if path.is_file():
        return [(printable(path.stem), str(path))]
    if path.is_dir() or _GLOB.search(name):
        pattern = "*.geojson" if path.is_dir() else name
        files = _globbed(path if path.is_dir() else folder, pattern)
        if not files:
            msg = f"no road file matches {name!r}" if _GLOB.search(name) else f"folder {name!r} has no road file *.geojson"
            raise RoadError(msg, hint="globs are relative to the study's folder")
        return [(printable(file.stem), str(file)) for file in files]
    known = [*shipped_roads(), *SCENARIOS]
    if name in known:
        return [(name, name)]
    msg = f"no road file, shipped road or scenario is called {name!r}"
    raise RoadError(msg, hint=did_you_mean(name, known, "files are relative to the study's folder; `hdvplan roads list` has the names"))


def _globbed(folder: Path, pattern: str) -> list[Path]:
    found = (folder / name for name in glob(pattern, root_dir=folder, recursive=True, include_hidden=True))  # noqa: PTH207 - Path.glob takes none
    return sorted(file for file in found if file.is_file())


def _told_apart(roads: Sequence[RoadSource]) -> list[RoadSource]:
    """Return roads with labels that differ: by the chosen line, else by the whole path of the file, else by a number."""
    twice = [road for road, count in Counter(roads).items() if count > 1]
    if twice:
        msg = f"the study names the road {twice[0].label} twice"
        raise OptionError(msg)
    labels = [f"{road.label}:{chosen}" if (chosen := road.feature or road.road_ids) else road.label for road in roads]
    labels = _unlike(labels, [printable(road.source) for road in roads])
    labels = _unlike(labels, [f"{label} ({number})" for number, label in enumerate(labels, start=1)])
    return [replace(road, label=label) for road, label in zip(roads, labels, strict=True)]


def _unlike(labels: Sequence[str], others: Sequence[str]) -> list[str]:
    """Return labels, with others in the place of those that are there twice."""
    counts = Counter(labels)
    return [other if counts[label] > 1 else label for label, other in zip(labels, others, strict=True)]


def variants_of(names: Sequence[str], vary: Mapping[str, object], folder: Path) -> tuple[Variant, ...]:
    """Return the vehicles that ``names`` name, presets, files or globs, with every combination of the values that ``vary`` gives them.

    Its names are ``vehicle.parameter``, of the first unit, or ``vehicle.number.parameter``.

    Raises:
        OptionError: such a name that is none of a vehicle of the study and of its parameters, or values that are no numbers.
        VehicleError: no such vehicle, or a value that it cannot have.

    """
    vehicles = _vehicles(names, folder)
    swept: dict[str, list[tuple[str, list[float], Callable[[Vehicle, float], Vehicle]]]] = {name: [] for name in vehicles}
    named: dict[str, tuple[str, str]] = {}
    for name, values in vary.items():
        owner = next((known for known in sorted(vehicles, key=len, reverse=True) if name.startswith(f"{known}.")), None)
        if owner is None:
            msg = f"vary names {name!r}, and no vehicle of the study is called that"
            known = [f"{vehicle}.{name.rpartition('.')[2]}" for vehicle in vehicles]
            raise OptionError(msg, hint=did_you_mean(name, known, f"its vehicles: {', '.join(vehicles)}"))
        parameter = name.removeprefix(f"{owner}.").removeprefix("1.")  # of the first unit
        known_as = next((other for other, same in named.items() if same == (owner, parameter)), None)
        if known_as is not None:
            msg = f"vary names {name!r}, which is {known_as!r}"
            raise OptionError(msg)
        named[name] = owner, parameter
        swept[owner].append((name, _values(name, values), _setter(name, parameter, vehicles[owner])))
    found = []
    for name, vehicle in vehicles.items():
        refuse_many(prod(len(values) for _, values, _ in swept[name]), f"variants of {vehicle.name}")
        for values in product(*(values for _, values, _ in swept[name])):
            changed = vehicle
            for (_, _, change), value in zip(swept[name], values, strict=True):
                changed = change(changed, value)
            varied = tuple((parameter, value) for (parameter, _, _), value in zip(swept[name], values, strict=True))
            found.append(Variant(changed, varied))
    return tuple(found)


def _vehicles(names: Sequence[str], folder: Path) -> dict[str, Vehicle]:
    found: dict[str, Vehicle] = {}
    for name in names:
        files: list[str | Path] = [folder / name] if (folder / name).is_file() else [name]
        if _GLOB.search(name):
            files = list(_globbed(folder, name))
            if not files:
                msg = f"no vehicle file matches {name!r}"
                raise VehicleError(msg, hint="globs are relative to the study's folder")
        for file in files:
            vehicle = load_vehicle(file)
            if vehicle.name in found:
                msg = f"two vehicles of the study are called {vehicle.name!r}"
                raise OptionError(msg, hint="give one of them another name in its file")
            found[vehicle.name] = vehicle
    return found


def refuse_many(count: int, what: str, most: int = MOST) -> None:
    """Refuse more combinations of what a study lists than can be kept in memory: more than ``most``."""
    if count > most:
        msg = f"the study asks for {count} {what}; {most} are the most"
        raise OptionError(msg, hint="make several studies of it")


def _values(name: str, given: object) -> list[float]:
    """Return the values of a parameter: a number, a list of them, or a range such as ``3.4..3.8 in 5``."""
    if isinstance(given, str) and (match := _RANGE.fullmatch(given)):
        low, high, count = float(match[1]), float(match[2]), int(match[3] or _COUNT)
        if not (-np.inf < low < high < np.inf and 1 < count <= MOST):
            msg = f"vary {name}: the range {given!r} must rise, in 2 to {MOST} values"
            raise OptionError(msg)
        return [round(float(value), _DIGITS) for value in np.linspace(low, high, count)]
    values = given if isinstance(given, list) else [given]
    numbers = [float(value) for value in values if isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= _MOST]
    if not values or len(numbers) < len(values) or len(set(numbers)) < len(numbers):
        msg = f"vary {name} must be different numbers or a range, not {given!r}"
        raise OptionError(msg, hint=f'"{name}" = [3.4, 3.6, 3.8], or "3.4..3.8 in 5"')
    return numbers


def _setter(name: str, parameter: str, vehicle: Vehicle) -> Callable[[Vehicle, float], Vehicle]:
    """Return what gives a vehicle another value of a parameter, such as ``wheelbase`` of its first unit, or ``2.wheelbase``."""
    if parameter in _LEAD:
        return lambda changed, value: replace(changed, **{parameter: value})  # type: ignore[arg-type] # both are numbers
    number, _, own = parameter.rpartition(".")
    index = int(number) - 1 if number.isascii() and number.isdigit() else 0 if not number else -1
    if own not in _UNIT or not 0 <= index < len(vehicle.units):
        msg = f"vary names {name!r}, and {vehicle.name} has no such parameter"
        known = [*_UNIT, *_LEAD] if not number else [f"{unit}.{entry}" for unit in range(1, len(vehicle.units) + 1) for entry in _UNIT]
        raise OptionError(msg, hint=did_you_mean(parameter, known, f"parameters: {', '.join(known)}; those of unit 2 are 2.{_UNIT[0]} ..."))

    def change(changed: Vehicle, value: float) -> Vehicle:
        units = list(changed.units)
        with refused_in(f"vehicle {vehicle.name!r}, unit {index + 1}"):
            units[index] = replace(units[index], **{own: value})  # type: ignore[arg-type] # every parameter is a number
        return replace(changed, units=tuple(units))

    return change
