"""Read vehicles: the presets that travel with the package, and a user's own TOML files."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Literal

from hdvplan.errors import VehicleError, refused_in
from hdvplan.schema import parse_toml, read, read_text
from hdvplan.settings import METRES
from hdvplan.texts import did_you_mean, printable
from hdvplan.vehicle.model import Unit, Vehicle, tightest

_DECIMAL_COMMA = re.compile(r"^\s*\w+\s*=\s*[+-]?\d+,\d+\s*(#.*)?$", re.MULTILINE)
_ACTIVE, _ACTIVELY = "active", 'steered = "active"'
_AIM = 0.6  # of an active axle's angle to the articulation on constant curves, where a file does not say
_LENGTH_TOLERANCE_M = 0.01
_LONGEST_NAME = 120  # letters
_GROUPS = ("papers", "europe", "aashto")
LengthUnit = Literal["m", "ft"]


@dataclass(frozen=True)
class _UnitTable:
    """A [[unit]] table: lengths in the file's unit."""

    wheelbase: float
    width: float
    name: str | None = None
    front_overhang: float = 0.0
    rear_overhang: float | None = None
    hitch_offset: float | None = None
    length: float | None = None
    turning_radius: float | None = None  # these two are other ways to say max_curvature
    turning_circle: float | None = None
    max_curvature: float | None = None
    max_curvature_rate: float | None = None
    steered: bool | Literal["active"] | None = None
    steering_ratio: float | None = None
    max_steering_angle: float | None = None
    max_steering_rate: float | None = None


@dataclass(frozen=True)
class _VehicleTable:
    """A vehicle's file."""

    name: object = ""
    source: object = ""
    length_unit: LengthUnit = "m"
    unit: tuple[_UnitTable, ...] = ()


_LENGTHS = ("wheelbase", "width", "front_overhang", "rear_overhang", "hitch_offset", "length", "turning_radius", "turning_circle")
_TURNING = ("turning_radius", "turning_circle", "max_curvature")  # ways to say how far the front wheels turn
_OF_LEAD = (*_TURNING, "max_curvature_rate")


def preset_groups() -> dict[str, list[str]]:
    """Return the names of the shipped vehicles by where they come from: papers, europe, aashto; each list sorted."""
    return {group: sorted(Path(entry.name).stem for entry in (_presets() / group).iterdir()) for group in _GROUPS}


def preset_names() -> list[str]:
    """Return the names of the shipped vehicles, sorted."""
    return sorted(name for names in preset_groups().values() for name in names)


def preset_text(name: str) -> str:
    """Return the TOML of a shipped vehicle, ready to copy and edit. Capitals do not matter.

    Raises:
        VehicleError: no such preset.

    """
    known = {preset.lower(): (group, preset) for group, presets in preset_groups().items() for preset in presets}
    if name.lower() not in known:
        msg, presets = f"unknown vehicle {name!r}", preset_names()
        raise VehicleError(msg, hint=did_you_mean(name, presets, f"presets: {', '.join(presets)}; or give a TOML file"))
    group, preset = known[name.lower()]
    return (_presets() / group / f"{preset}.toml").read_text(encoding="utf-8")


def load_vehicle(source: str | Path) -> Vehicle:
    """Return the preset called ``source``, or the vehicle in the TOML file at that path.

    Raises:
        VehicleError: no such preset or file, not TOML, an unknown, missing or impossible entry.

    """
    return read_vehicle(source)[0]


def read_vehicle(source: str | Path) -> tuple[Vehicle, str | None]:
    """Return a vehicle as ``load_vehicle`` does, and what is assumed of its steering; None where its file says how far it turns.

    Raises:
        VehicleError: as ``load_vehicle``.

    """
    text, is_file = vehicle_text(source), _is_file(source)
    with refused_in(str(source) if is_file else ""):
        vehicle, lead = _parsed(text, Path(source).stem if is_file else str(source))
    if _given(lead, _TURNING):
        return vehicle, None
    least = f"{1.0 / vehicle.max_curvature:.1f} m"
    return vehicle, f"{vehicle.name}: no turning_circle or max_curvature is given: the rear axle's least radius is assumed to be {least}"


def vehicle_text(source: str | Path) -> str:
    """Return the TOML of the preset called ``source``, or of the file at that path.

    Raises:
        VehicleError: no such preset or file, or it cannot be read as text.

    """
    if not _is_file(source):
        return preset_text(str(source))
    try:
        return read_text(Path(source))
    except FileNotFoundError as error:
        msg = f"vehicle file {source} does not exist"
        raise VehicleError(msg, hint=f"presets: {', '.join(preset_names())}") from error
    except (OSError, ValueError) as error:
        msg = f"vehicle file {source} cannot be read: {error}"
        raise VehicleError(msg) from error


def _is_file(source: str | Path) -> bool:
    return Path(source).suffix == ".toml" or Path(source).is_file()


def parse_vehicle(text: str, *, default_name: str) -> Vehicle:
    """Return the vehicle described by a TOML text: one [[unit]] table per body, from the front.

    ``length_unit = "ft"`` says that all lengths in the text are in feet; they are converted here, exactly, and nowhere else.

    Raises:
        VehicleError: not TOML, an unknown, missing or impossible entry.

    """
    return _parsed(text, default_name)[0]


def _parsed(text: str, default_name: str) -> tuple[Vehicle, _UnitTable]:
    """Return the vehicle of a TOML text, and its first unit's table, lengths in metres."""
    try:
        document = parse_toml(text)
    except ValueError as error:
        msg = f"vehicle {default_name!r} is not valid TOML: {error}"
        hint = "decimal numbers have a point: 6.9, not 6,9" if _DECIMAL_COMMA.search(text) else None
        raise VehicleError(msg, hint=hint) from error
    name = printable(str(document.get("name", default_name)))
    _check_name(name, f"vehicle {name[:_LONGEST_NAME]!r}")
    table = read(_VehicleTable, document, f"vehicle {name!r}", VehicleError)
    metres = METRES[table.length_unit]
    tables = [replace(one, **{key: metres * getattr(one, key) for key in _given(one, _LENGTHS)}) for one in table.unit]
    units = tuple(_unit(one, number, f"vehicle {name!r}, unit {number}") for number, one in enumerate(tables, start=1))
    if not units:
        return Vehicle(name, ()), _UnitTable(0.0, 0.0)  # which is refused
    lead = tables[0]
    steering = {key: getattr(lead, key) for key in _given(lead, ("max_curvature", "max_curvature_rate"))}
    if ways := _given(lead, _TURNING[:2]):
        others, where = [key for key in _given(lead, _TURNING) if key != ways[0]], f"vehicle {name!r}, unit 1"
        if others:
            msg = f"{where}: {ways[0]} contradicts {others[0]}"
            raise VehicleError(msg, field=ways[0], hint="give max_curvature alone: tan(front wheels' angle) / wheelbase [1/m]")
        steering["max_curvature"] = tightest(ways[0], getattr(lead, ways[0]), units[0], where)
    vehicle = Vehicle(name, units, source=printable(str(table.source)), **steering)
    loose = next((number for number, one in enumerate(tables[:-1], start=1) if one.hitch_offset is None), None)
    if loose is not None:
        msg = f"vehicle {name!r}, unit {loose}: hitch_offset is missing, and unit {loose + 1} is coupled to it"
        raise VehicleError(msg, field="hitch_offset", hint="hitch_offset = 0 puts the joint on the axle")
    return vehicle, lead


def _given(table: _UnitTable, keys: Sequence[str]) -> list[str]:
    return [key for key in keys if getattr(table, key) is not None]


def _presets() -> resources.abc.Traversable:
    return resources.files("hdvplan.vehicle") / "presets"


def _unit(table: _UnitTable, number: int, where: str) -> Unit:
    if number > 1 and (misplaced := _given(table, _OF_LEAD)):
        msg = f"{where}: {misplaced[0]} belongs to unit 1, whose axle the steering moves"
        raise VehicleError(msg, field=misplaced[0])
    _check_steered(table, number, where)
    axle = {key: getattr(table, key) for key in _given(table, ("steering_ratio", "max_steering_angle", "max_steering_rate"))}
    if table.steered == _ACTIVE:
        axle.setdefault("steering_ratio", _AIM)
    front, rear = table.front_overhang, table.rear_overhang
    if table.length is not None:
        rear = table.length - table.wheelbase - front if rear is None else rear
        if abs(front + table.wheelbase + rear - table.length) > _LENGTH_TOLERANCE_M or rear < 0.0:
            msg = (
                f"{where}: length = {table.length:g} m contradicts front_overhang {front:g} + wheelbase {table.wheelbase:g}"
                f" + rear_overhang {max(rear, 0.0):g} m"
            )
            raise VehicleError(msg, field="length")
    if table.name is not None and not table.name.strip():
        msg = f"{where}: name must be a word, not {table.name!r}"
        raise VehicleError(msg, field="name")
    name = printable(table.name or "")
    _check_name(name, where)
    with refused_in(where):
        return Unit(table.wheelbase, front, rear or 0.0, table.width, table.hitch_offset or 0.0, name=name, **axle)


def _check_name(name: str, where: str) -> None:
    if len(name) > _LONGEST_NAME:
        msg = f"{where}: the name has {len(name)} letters; at most {_LONGEST_NAME} are drawn"
        raise VehicleError(msg, field="name", hint="give a shorter name")


def _check_steered(table: _UnitTable, number: int, where: str) -> None:
    """Refuse entries about steering that contradict each other: ``steered`` is the front axle of unit 1, the axle of others."""
    if table.steered == _ACTIVE:
        _check_active(table, number, where)
        return
    if table.max_steering_rate is not None:
        msg = f"{where}: max_steering_rate needs {_ACTIVELY}"
        raise VehicleError(msg, field="max_steering_rate", hint="it limits how fast the plan turns a trailer's wheels")
    by_law = table.steering_ratio is not None
    steered = (number == 1 or by_law) if table.steered is None else table.steered
    if number == 1 and not steered:
        msg = f"{where}: steered = false is not supported; the first unit steers, the others follow"
        raise VehicleError(msg, field="steered")
    if number > 1 and steered != by_law:
        words = "needs a steering_ratio" if steered else "contradicts its steering_ratio"
        msg = f"{where}: steered = {str(steered).lower()} {words}"
        raise VehicleError(msg, field="steered", hint="steering_ratio is the axle's steering angle per angle at its coupling")
    if table.max_steering_angle is not None and not by_law:
        msg = f"{where}: max_steering_angle needs a steering_ratio"
        raise VehicleError(msg, field="max_steering_angle", hint="it stops this unit's own axle; the front wheels have max_curvature")


def _check_active(table: _UnitTable, number: int, where: str) -> None:
    """Refuse an axle that the plan is to steer where it cannot, or without saying what its wheels can do."""
    if number == 1:
        msg = f"{where}: {_ACTIVELY} is not supported; only a trailer's axle can be steered actively"
        raise VehicleError(msg, field="steered", hint="the rear axle of unit 1 takes a steering_ratio alone")
    for key in ("max_steering_angle", "max_steering_rate"):
        if getattr(table, key) is None:
            msg = f"{where}: {_ACTIVELY} needs {key}"
            raise VehicleError(msg, field=key, hint="max_steering_angle is in radians, max_steering_rate in radians per metre travelled")
    if table.max_steering_rate == 0.0:
        msg = f"{where}: max_steering_rate = 0 rad/m must lie above 0"
        raise VehicleError(msg, field="max_steering_rate", hint="wheels that never turn need no steered axle")
