"""A manoeuvre driven, measured and compared with the limits of a standard: a template that ships, or a TOML file of one's own."""

from __future__ import annotations

from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Literal

import numpy as np

from hdvplan.answers import NEEDS, room_text, word_of, worded
from hdvplan.errors import OptionError
from hdvplan.schema import parse_toml, read, read_text
from hdvplan.settings import METRES
from hdvplan.texts import did_you_mean, printable
from hdvplan.turning.follow import Followed, follow, tightest
from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre, guide_offsets
from hdvplan.turning.reversing.options import Template as Reversing
from hdvplan.turning.swept import Figures, figures_of
from hdvplan.vehicle.load import LengthUnit
from hdvplan.vehicle.model import Vehicle

_ROUNDING_M = 1e-6
_LARGEST = 1e6  # of any entry


@dataclass(frozen=True)
class _ManoeuvreTable:
    """The table [manoeuvre] of a file: lengths in its unit, the angle in degrees."""

    radius: float | Literal["vehicle"]
    angle: float | Literal["steady"]
    guide: GuidePoint = GuidePoint.FRONT_AXLE
    standstill: bool = False
    ramp: float | None = None
    lead_in: float | None = None
    lead_out: float | None = None


@dataclass(frozen=True)
class _LimitsTable:
    """The table [limits] of a file."""

    inside_radius: float | None = None
    outside_radius: float | None = None
    swept_width: float | None = None
    tail_swing: float | None = None
    frontal_swing: float | None = None


@dataclass(frozen=True)
class _TemplateTable:
    """A template's file."""

    manoeuvre: _ManoeuvreTable
    name: object = ""
    source: object = ""
    length_unit: LengthUnit = "m"
    limits: _LimitsTable = _LimitsTable()


@dataclass(frozen=True)
class Limit:
    """What a standard demands of one figure: at least or at most so many metres."""

    name: str  # in a file
    value: float  # [m]

    @property
    def words(self) -> str:
        """What messages call it."""
        return self.name.replace("_", " ")

    @property
    def least(self) -> bool:
        """Whether the figure must not be below it; else not above."""
        return self.name == "inside_radius"

    def spare(self, figures: Figures) -> float:
        """Return how much better than demanded the figure is, negative where it fails [m]."""
        found = figure(self.name, figures)
        return found - self.value if self.least else self.value - found

    def kept(self, figures: Figures) -> bool:
        """Tell whether the demand is met, but for rounding."""
        return self.spare(figures) >= -_ROUNDING_M


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
        msg, names = f"unknown template {str(source)!r}", [*template_names(), *map(str, Reversing)]
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
    table = read(_TemplateTable, document, where)
    metres, given = METRES[table.length_unit], table.manoeuvre
    lengths = {key: metres * value for key in ("ramp", "lead_in", "lead_out") if (value := getattr(given, key)) is not None}
    limits = {key: metres * value for key, value in vars(table.limits).items() if value is not None}
    for key, value in {**vars(given), **vars(table.limits)}.items():
        if isinstance(value, float) and not abs(value) < _LARGEST:
            msg = f"{where}: {key} must be a number below {_LARGEST:g}, not {value:g}"
            raise OptionError(msg)
    radius = None if isinstance(given.radius, str) else metres * given.radius
    angle = None if isinstance(given.angle, str) else np.deg2rad(given.angle)
    manoeuvre = Manoeuvre(1e3 if radius is None else radius, angle, given.guide, standstill=given.standstill, **lengths)  # refuses no turn
    if angle is None and "frontal_swing" in limits:
        msg = f"{where}: frontal_swing is measured in the exit, and a full circle has none"
        raise OptionError(msg, hint="give an angle, or leave frontal_swing out")
    demands = tuple(Limit(key, value) for key, value in limits.items())
    return Template(name, printable(str(table.source)), manoeuvre, radius, demands)


def _shipped() -> resources.abc.Traversable:
    return resources.files("hdvplan.turning") / "templates"


@dataclass(frozen=True)
class Turn:
    """A driven manoeuvre with its figures; ``template`` is the standard that it follows, if it does."""

    driven: Followed
    figures: Figures
    template: Template | None

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What the standard demands."""
        return () if self.template is None else self.template.limits

    @property
    def circles(self) -> tuple[Limit, ...]:
        """The demands that are circles about the arc's centre."""
        return tuple(limit for limit in self.limits if limit.name.endswith("radius"))

    @property
    def complies(self) -> bool | None:
        """Whether all demands are met; None where there are none."""
        return all(limit.kept(self.figures) for limit in self.limits) if self.limits else None


def turn(vehicle: Vehicle, manoeuvre: Manoeuvre | Template) -> Turn:
    """Drive ``vehicle`` through a manoeuvre, or a standard's, and measure it.

    Raises:
        TurnError: the vehicle cannot drive it, or reaches around the centre of a full circle.
        OptionError: the standard's ramps are too long for the vehicle's radius.

    """
    template = manoeuvre if isinstance(manoeuvre, Template) else None
    driven = follow(vehicle, manoeuvre.manoeuvre(vehicle) if isinstance(manoeuvre, Template) else manoeuvre)
    return Turn(driven, figures_of(driven), template)


def verdict(turn: Turn) -> str:
    """Return one line: whether the vehicle complies, or what width the turn needs."""
    name, words = turn.driven.vehicle.name, manoeuvre_words(turn)
    if turn.template is None or not turn.limits:
        return worded(NEEDS, f"{turn.figures.swept_width:.2f} m of width: {name}, {words}")
    demands = "; ".join(_demand_words(limit, turn) for limit in turn.limits)
    complies = "complies" if turn.complies else "does not comply"
    return worded(word_of(turn.complies), f"{name} {complies} with {turn.template.name}: {demands}")


def broken_words(limit: Limit, turn: Turn) -> str:
    """Return which demand is not met, and by how much."""
    found, which = figure(limit.name, turn.figures), "below" if limit.least else "above"
    off = f"{-limit.spare(turn.figures):.3f} m {which} {limit.value:.3f} m"
    return f"the {limit.words} of the {turn.driven.vehicle.name} is {found:.3f} m, {off}"


def manoeuvre_words(turn: Turn) -> str:
    """Return angle, guided point, radius and ramps of a turn."""
    manoeuvre = turn.driven.manoeuvre
    angle = "full circle" if manoeuvre.angle is None else f"{np.rad2deg(manoeuvre.angle):g} degrees"
    ramp = f", ramps of {manoeuvre.ramp:g} m" if manoeuvre.ramp > 0.0 else ""
    return f"{angle}, {manoeuvre.point.words} on a radius of {manoeuvre.radius:.2f} m{ramp}"


def _demand_words(limit: Limit, turn: Turn) -> str:
    spare = limit.spare(turn.figures)
    over = f"{-spare:.3f} m {'short' if limit.least else 'too much'}"
    kept = room_text(spare, fits=True, digits=3) if limit.kept(turn.figures) else over
    return f"{limit.words} {figure(limit.name, turn.figures):.3f} m ({'at least' if limit.least else 'at most'} {limit.value:.2f}), {kept}"
