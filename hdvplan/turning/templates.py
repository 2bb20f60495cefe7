"""Templates of prescribed manoeuvres: those that travel with the package, and a user's own TOML files."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path

import numpy as np

from hdvplan.errors import OptionError
from hdvplan.fileio import parse_toml, read_text
from hdvplan.lengths import METRES
from hdvplan.spelling import did_you_mean
from hdvplan.texts import printable
from hdvplan.turning.follow import tightest
from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre, guide_offsets
from hdvplan.turning.swept import Figures
from hdvplan.vehicle.load import LENGTH_UNITS
from hdvplan.vehicle.model import Vehicle

_TOP_KEYS = ("name", "source", "length_unit", "manoeuvre", "limits")
_LENGTH_KEYS = ("radius", "ramp", "lead_in", "lead_out")
_MANOEUVRE_KEYS = ("guide", "angle", "standstill", *_LENGTH_KEYS)
STEADY, OF_VEHICLE = "steady", "vehicle"
_ROUNDING_M = 1e-6
_LARGEST = 1e6  # of any entry


@dataclass(frozen=True)
class Limit:
    """What a standard demands of one figure: at least or at most so many metres."""

    name: str
    words: str
    least: bool
    value: float  # [m]

    def spare(self, figures: Figures) -> float:
        """Return how much better than demanded the figure is, negative where it fails [m]."""
        found = figure(self.name, figures)
        return found - self.value if self.least else self.value - found

    def kept(self, figures: Figures) -> bool:
        """Tell whether the demand is met, but for rounding."""
        return self.spare(figures) >= -_ROUNDING_M


_LIMITS = {  # by the name in a file: what messages call it, and whether it is a least value
    "inside_radius": ("inside radius", True),
    "outside_radius": ("outside radius", False),
    "swept_width": ("swept width", False),
    "tail_swing": ("tail swing", False),
    "frontal_swing": ("frontal swing", False),
}


def figure(name: str, figures: Figures) -> float:
    """Return the figure that a limit called ``name`` bounds [m]."""
    return {
        "inside_radius": figures.bodies.inside,
        "outside_radius": figures.bodies.outside,
        "swept_width": figures.swept_width,
        "tail_swing": max(figures.tail_swing),
        "frontal_swing": figures.frontal_swing or 0.0,
    }[name]


@dataclass(frozen=True)
class Template:
    """A manoeuvre that a standard prescribes, with what it demands; a radius of None is the least that the vehicle's wheels allow."""

    name: str
    source: str
    given: Manoeuvre  # where the radius is the vehicle's, a stand-in for it
    radius: float | None  # [m]
    limits: tuple[Limit, ...]

    def manoeuvre(self, vehicle: Vehicle) -> Manoeuvre:
        """Return the manoeuvre as ``vehicle`` drives it.

        Raises:
            TurnError: the vehicle has not the point that is to be guided.
            OptionError: the ramps are too long for the radius.

        """
        if self.radius is not None:
            return self.given
        return replace(self.given, radius=tightest(vehicle, guide_offsets(self.given.point, vehicle)))


def template_names() -> list[str]:
    """Return the names of the shipped templates, sorted."""
    return sorted(Path(entry.name).stem for entry in _shipped().iterdir() if entry.name.endswith(".toml"))


def load_template(source: str | Path) -> Template:
    """Return the shipped template called ``source``, or the one in the TOML file at that path.

    Raises:
        OptionError: no such template or file, not TOML, an unknown, missing or impossible entry.

    """
    path = Path(source)
    if path.suffix == ".toml" or path.is_file():
        try:
            return parse_template(read_text(path), default_name=path.stem)
        except (OSError, ValueError) as error:
            reason = error.strerror if isinstance(error, OSError) else error
            msg = f"template file {source} cannot be read: {reason}"
            raise OptionError(msg, hint=f"templates: {', '.join(template_names())}") from error
    if source not in template_names():
        msg, names = f"unknown template {str(source)!r}", template_names()
        raise OptionError(msg, hint=did_you_mean(str(source), names, f"templates: {', '.join(names)}; or give a TOML file"))
    return parse_template((_shipped() / f"{source}.toml").read_text(encoding="utf-8"), default_name=str(source))


def parse_template(text: str, *, default_name: str) -> Template:
    """Return the template described by a TOML text: a table ``manoeuvre``, and ``limits`` where the standard has some.

    Raises:
        OptionError: not TOML, an unknown, missing or impossible entry.

    """
    try:
        document = parse_toml(text)
    except ValueError as error:
        msg = f"template {default_name!r} is not valid TOML: {error}"
        raise OptionError(msg) from error
    name = printable(str(document.get("name", default_name)))
    where = f"template {name!r}"
    _check_keys(document, _TOP_KEYS, where)
    unit = document.get("length_unit", "m")
    if not isinstance(unit, str) or unit not in LENGTH_UNITS:
        msg = f"{where}: length_unit must be 'm' or 'ft', not {unit!r}"
        raise OptionError(msg)
    given, limits = (_table(document, key, where) for key in ("manoeuvre", "limits"))
    _check_keys(given, _MANOEUVRE_KEYS, where)
    _check_keys(limits, tuple(_LIMITS), where)
    for key in ("radius", "angle"):
        if key not in given:
            msg = f"{where}: {key} is missing"
            raise OptionError(msg, hint=f"entries of [manoeuvre]: {', '.join(_MANOEUVRE_KEYS)}")
    radius = None if given["radius"] == OF_VEHICLE else _number(given, "radius", where) * METRES[unit]
    angle = None if given["angle"] == STEADY else np.deg2rad(_number(given, "angle", where))
    lengths = {key: _number(given, key, where) * METRES[unit] for key in _LENGTH_KEYS[1:] if key in given}
    standstill = given.get("standstill", False)
    if not isinstance(standstill, bool):
        msg = f"{where}: standstill must be true or false, not {standstill!r}"
        raise OptionError(msg)
    point = guide_point(given.get("guide", GuidePoint.FRONT_AXLE), where)
    manoeuvre = Manoeuvre(1e3 if radius is None else radius, angle, point, standstill=standstill, **lengths)  # refuses what is no turn
    if angle is None and "frontal_swing" in limits:
        msg = f"{where}: frontal_swing is measured in the exit, and a full circle has none"
        raise OptionError(msg, hint="give an angle, or leave frontal_swing out")
    demands = tuple(Limit(key, *_LIMITS[key], _number(limits, key, where) * METRES[unit]) for key in limits)
    return Template(name, printable(str(document.get("source", ""))), manoeuvre, radius, demands)


def guide_point(value: object, where: str) -> GuidePoint:
    """Return the guided point called ``value``.

    Raises:
        OptionError: there is none of that name.

    """
    if value not in list(GuidePoint):
        msg = f"{where}: guide must be {', '.join(list(GuidePoint)[:-1])} or {list(GuidePoint)[-1]}, not {value!r}"
        raise OptionError(msg)
    return GuidePoint(str(value))


def _shipped() -> resources.abc.Traversable:
    return resources.files("hdvplan.turning") / "templates"


def _table(document: dict[str, object], key: str, where: str) -> dict[str, object]:
    table = document.get(key, {})
    if not isinstance(table, dict):
        msg = f"{where}: {key} must be a table: [{key}]"
        raise OptionError(msg)
    return table


def _check_keys(table: dict[str, object], known: tuple[str, ...], where: str) -> None:
    for key in table:
        if key not in known:
            msg = f"{where}: unknown entry {key!r}"
            raise OptionError(msg, hint=did_you_mean(key, known, f"known entries: {', '.join(known)}"))


def _number(table: dict[str, object], key: str, where: str) -> float:
    value = table[key]
    if isinstance(value, bool) or not isinstance(value, int | float) or not abs(value) < _LARGEST:
        words = {"radius": f" or '{OF_VEHICLE}'", "angle": f" of degrees or '{STEADY}'"}.get(key, "")
        msg = f"{where}: {key} must be a number{words}, not {value!r}"
        raise OptionError(msg)
    return float(value)
