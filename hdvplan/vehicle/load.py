"""Read vehicles: the presets that travel with the package, and a user's own TOML files."""

from __future__ import annotations

import re
from importlib import resources
from pathlib import Path

import numpy as np

from hdvplan.errors import VehicleError
from hdvplan.fileio import parse_toml, read_text
from hdvplan.lengths import METRES
from hdvplan.spelling import did_you_mean
from hdvplan.texts import printable
from hdvplan.vehicle.model import Unit, Vehicle

_TOP_KEYS = ("name", "source", "length_unit", "unit")
_STEERING_KEYS = ("max_curvature", "max_curvature_rate")
_DIMENSION_KEYS = ("wheelbase", "front_overhang", "rear_overhang", "width", "hitch_offset", "length")
_RADIUS_KEY, _CIRCLE_KEY = "turning_radius", "turning_circle"  # other ways to say max_curvature
_DECIMAL_COMMA = re.compile(r"^\s*\w+\s*=\s*[+-]?\d+,\d+\s*(#.*)?$", re.MULTILINE)
LENGTH_UNITS = ("m", "ft")
_AXLE_KEYS = ("steering_ratio", "max_steering_angle", "max_steering_rate")
_ACTIVE, _ACTIVELY = "active", 'steered = "active"'
_AIM = 0.6  # of an active axle's angle to the articulation on constant curves, where a file does not say
_UNIT_KEYS = ("name", *_DIMENSION_KEYS, *_STEERING_KEYS, _RADIUS_KEY, _CIRCLE_KEY, "steered", *_AXLE_KEYS)
_LENGTH_TOLERANCE_M = 0.01
_LARGEST_RADIUS_M = 1e6
_LONGEST_NAME = 120  # letters
_GROUPS = ("papers", "europe", "aashto")


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
    text = vehicle_text(source)  # once: it may come from a pipe
    vehicle = parse_vehicle(text, default_name=Path(source).stem if _is_file(source) else str(source))
    return vehicle, _assumed(text, vehicle)


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
    try:
        document = parse_toml(text)
    except ValueError as error:
        msg = f"vehicle {default_name!r} is not valid TOML: {error}"
        hint = "decimal numbers have a point: 6.9, not 6,9" if _DECIMAL_COMMA.search(text) else None
        raise VehicleError(msg, hint=hint) from error
    name = printable(str(document.get("name", default_name)))
    _check_name(name, f"vehicle {name[:_LONGEST_NAME]!r}")
    _check_keys(document, _TOP_KEYS, f"vehicle {name!r}")
    tables = document.get("unit", [])
    if not (isinstance(tables, list) and all(isinstance(table, dict) for table in tables)):
        msg = f"vehicle {name!r}: 'unit' must be [[unit]] tables, one per body from the front"
        raise VehicleError(msg, field="unit")
    metres = _metres(document, name)
    units = tuple(_unit(table, number, name, metres) for number, table in enumerate(tables, start=1))
    lead = tables[0] if tables else {}
    steering = {key: _number(lead, key, f"vehicle {name!r}, unit 1") for key in _STEERING_KEYS if key in lead}
    if _RADIUS_KEY in lead or _CIRCLE_KEY in lead:
        steering["max_curvature"] = _curvature(lead, units[0], f"vehicle {name!r}, unit 1", metres)
    return Vehicle(name, units, source=printable(str(document.get("source", ""))), **steering)


def _metres(document: dict[str, object], name: str) -> float:
    """Return how long the file's unit of length is [m]."""
    given = document.get("length_unit", "m")
    if not isinstance(given, str) or given not in LENGTH_UNITS:
        msg = f"vehicle {name!r}: length_unit must be 'm' or 'ft', not {given!r}"
        raise VehicleError(msg, field="length_unit", hint="it is the unit of all lengths; curvatures are 1/m, angles radians")
    return METRES[given]


def _curvature(lead: dict[str, object], unit: Unit, where: str, metres: float) -> float:
    """Return the largest curvature from the least radius of the front axle's middle, or from the circle between walls."""
    ways = [key for key in (_RADIUS_KEY, _CIRCLE_KEY, "max_curvature") if key in lead]
    if len(ways) > 1 or unit.steering_ratio > 0.0:
        msg = f"{where}: {ways[0]} contradicts {ways[1] if len(ways) > 1 else 'a steered rear axle'}"
        raise VehicleError(msg, field=ways[0], hint="give max_curvature alone: tan(front wheels' angle) / wheelbase [1/m]")
    if _CIRCLE_KEY in lead:
        return _curvature_between_walls(metres * _number(lead, _CIRCLE_KEY, where), unit, where)
    radius = metres * _number(lead, _RADIUS_KEY, where)
    if not unit.wheelbase < radius <= _LARGEST_RADIUS_M:
        limit = f"larger than the wheelbase of {unit.wheelbase:g} m" if radius <= unit.wheelbase else f"at most {_LARGEST_RADIUS_M:g} m"
        msg = f"{where}: {_RADIUS_KEY} = {radius:g} m must be {limit}"
        raise VehicleError(msg, field=_RADIUS_KEY, hint="it is the least radius of the middle of the front axle")
    return float(1.0 / (radius**2 - unit.wheelbase**2) ** 0.5)


def _curvature_between_walls(diameter: float, unit: Unit, where: str) -> float:
    """Return the largest curvature of the rear axle's path from the diameter of the circle that the outer front corner draws."""
    front = unit.wheelbase + unit.front_overhang
    least = 2.0 * float(np.hypot(front, unit.width))  # then the rear axle turns about its inner end
    if not least < diameter <= 2.0 * _LARGEST_RADIUS_M:
        limit = f"larger than {least:.2f} m for these dimensions" if diameter <= least else f"at most {2.0 * _LARGEST_RADIUS_M:g} m"
        msg = f"{where}: {_CIRCLE_KEY} = {diameter:g} m must be {limit}"
        raise VehicleError(msg, field=_CIRCLE_KEY, hint="it is the diameter of the turning circle between walls")
    return float(1.0 / (((0.5 * diameter) ** 2 - front**2) ** 0.5 - 0.5 * unit.width))


def _assumed(text: str, vehicle: Vehicle) -> str | None:
    tables = parse_toml(text).get("unit")
    lead = tables[0] if isinstance(tables, list) and tables else {}
    if any(key in lead for key in ("max_curvature", _RADIUS_KEY, _CIRCLE_KEY)):
        return None
    least = f"{1.0 / vehicle.max_curvature:.1f} m"
    return f"{vehicle.name}: no {_CIRCLE_KEY} or max_curvature is given: the rear axle's least radius is assumed to be {least}"


def _presets() -> resources.abc.Traversable:
    return resources.files("hdvplan.vehicle") / "presets"


def _unit(table: dict[str, object], number: int, name: str, metres: float) -> Unit:
    where = f"vehicle {name!r}, unit {number}"
    _check_keys(table, _UNIT_KEYS, where)
    if number > 1:
        for key in (*_STEERING_KEYS, _RADIUS_KEY, _CIRCLE_KEY):
            if key in table:
                msg = f"{where}: {key} belongs to unit 1, whose axle the steering moves"
                raise VehicleError(msg, field=key)
    _check_steered(table, number, where)
    values = {key: _number(table, key, where) for key in _AXLE_KEYS if key in table}
    values |= {key: metres * _number(table, key, where) for key in _DIMENSION_KEYS if key in table}
    for key in ("wheelbase", "width"):
        if key not in values:
            msg = f"{where}: {key} is missing"
            raise VehicleError(msg, field=key, hint=f"entries of a unit: {', '.join(_UNIT_KEYS)}")
    if table.get("steered") == _ACTIVE:
        values.setdefault("steering_ratio", _AIM)
    length = values.pop("length", None)
    front = values.setdefault("front_overhang", 0.0)
    if length is None:
        values.setdefault("rear_overhang", 0.0)
    else:
        rear = values.setdefault("rear_overhang", length - values["wheelbase"] - front)
        if abs(front + values["wheelbase"] + rear - length) > _LENGTH_TOLERANCE_M or rear < 0.0:
            msg = (
                f"{where}: length = {length:g} m contradicts front_overhang {front:g} + wheelbase {values['wheelbase']:g}"
                f" + rear_overhang {max(rear, 0.0):g} m"
            )
            raise VehicleError(msg, field="length")
    called = table.get("name", "")
    if not isinstance(called, str) or ("name" in table and not called.strip()):
        msg = f"{where}: name must be a word, not {called!r}"
        raise VehicleError(msg, field="name")
    _check_name(printable(called), where)
    return Unit(**values, name=printable(called))


def _check_name(name: str, where: str) -> None:
    """Refuse a name that no picture and no file can be called by."""
    if len(name) > _LONGEST_NAME:
        msg = f"{where}: the name has {len(name)} letters; at most {_LONGEST_NAME} are drawn"
        raise VehicleError(msg, field="name", hint="give a shorter name")


def _check_steered(table: dict[str, object], number: int, where: str) -> None:
    """Refuse entries about steering that contradict each other: ``steered`` is the front axle of unit 1, the axle of others."""
    if table.get("steered") == _ACTIVE:
        _check_active(table, number, where)
        return
    if "max_steering_rate" in table:
        msg = f"{where}: max_steering_rate needs {_ACTIVELY}"
        raise VehicleError(msg, field="max_steering_rate", hint="it limits how fast the plan turns a trailer's wheels")
    steered = table.get("steered", number == 1 or "steering_ratio" in table)
    if not isinstance(steered, bool):
        msg = f"{where}: steered must be true, false or 'active', not {steered!r}"
        raise VehicleError(msg, field="steered")
    if number == 1 and not steered:
        msg = f"{where}: steered = false is not supported; the first unit steers, the others follow"
        raise VehicleError(msg, field="steered")
    if number > 1 and steered != ("steering_ratio" in table):
        words = "needs a steering_ratio" if steered else "contradicts its steering_ratio"
        msg = f"{where}: steered = {str(steered).lower()} {words}"
        raise VehicleError(msg, field="steered", hint="steering_ratio is the axle's steering angle per angle at its coupling")
    if "max_steering_angle" in table and "steering_ratio" not in table:
        msg = f"{where}: max_steering_angle needs a steering_ratio"
        raise VehicleError(msg, field="max_steering_angle", hint="it stops this unit's own axle; the front wheels have max_curvature")


def _check_active(table: dict[str, object], number: int, where: str) -> None:
    """Refuse an axle that the plan is to steer where it cannot, or without saying what its wheels can do."""
    if number == 1:
        msg = f"{where}: {_ACTIVELY} is not supported; only a trailer's axle can be steered actively"
        raise VehicleError(msg, field="steered", hint="the rear axle of unit 1 takes a steering_ratio alone")
    for key in ("max_steering_angle", "max_steering_rate"):
        if key not in table:
            msg = f"{where}: {_ACTIVELY} needs {key}"
            raise VehicleError(msg, field=key, hint="max_steering_angle is in radians, max_steering_rate in radians per metre travelled")
    if _number(table, "max_steering_rate", where) == 0.0:
        msg = f"{where}: max_steering_rate = 0 rad/m must lie above 0"
        raise VehicleError(msg, field="max_steering_rate", hint="wheels that never turn need no steered axle")


def _check_keys(table: dict[str, object], known: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in known:
            msg = f"{where}: unknown entry {key!r}"
            raise VehicleError(msg, field=key, hint=did_you_mean(key, known, f"known entries: {', '.join(known)}"))


def _number(table: dict[str, object], key: str, where: str) -> float:
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float):
        msg = f"{where}: {key} must be a number, not {value!r}"
        raise VehicleError(msg, field=key)
    return float(value)
