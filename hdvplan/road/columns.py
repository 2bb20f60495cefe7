"""What the columns of a table of points are called, in the spellings and languages that spreadsheets have them."""

from __future__ import annotations

import difflib
import math
import re
import unicodedata
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from hdvplan.errors import RoadError
from hdvplan.settings import METRES

LAYOUTS = "known columns: x,y or lon,lat or s,kappa; with left_m,right_m or width_m; with left_sweep,right_sweep"

# Every spelling is folded: lower case, no accents, no units in brackets, words joined by "_".
_SPELLINGS = {
    "x": "x x_m easting east rechtswert ostwert ost este utm_e utm_x x_coord xcoord coord_x point_x e_koordinat x_koordinat",
    "y": "y y_m northing north hochwert nordwert nord norte utm_n utm_y y_coord ycoord coord_y point_y n_koordinat y_koordinat",
    "lon": "lon long lng longitude longitud longitudine langengrad laengengrad geographische_lange lengdegrad laengdegrad lengtegraad"
    " pituusaste dlugosc dlugosc_geograficzna lon_deg longitude_deg gps_longitude",
    "lat": "lat latitude latitud latitudine breitengrad geographische_breite breddegrad breedtegraad leveysaste szerokosc"
    " szerokosc_geograficzna lat_deg latitude_deg gps_latitude",
    "s": "s",
    "kappa": "kappa curvature krummung kurvatur courbure kromning",
    "left": "left left_m w_tr_left_m w_tr_left width_left left_width breite_links links vanster bredd_vanster vanster_bredd vansterbredd"
    " gauche largeur_gauche izquierda ancho_izquierda sinistra larghezza_sinistra venstre bredde_venstre breedte_links",
    "right": "right right_m w_tr_right_m w_tr_right width_right right_width breite_rechts rechts hoger bredd_hoger hoger_bredd hogerbredd"
    " droite largeur_droite derecha ancho_derecha destra larghezza_destra hoyre bredde_hoyre breedte_rechts",
    "width": "width width_m road_width breite fahrbahnbreite bredd vagbredd largeur ancho larghezza bredde breedte szerokosc_drogi",
    "left_sweep": "left_sweep left_sweep_m",
    "right_sweep": "right_sweep right_sweep_m",
}
_MEANINGS = {name: meaning for meaning, names in _SPELLINGS.items() for name in names.split()}
_ONLY_TOGETHER = {("e", "n"): ("x", "y"), ("lange", "breite"): ("lon", "lat"), ("est", "nord"): ("x", "y")}  # else they mean something else
# Which may say their unit; without it they have that of the position.
LENGTHS = {"x", "y", "s", "left", "right", "width", "left_sweep", "right_sweep"}
_UNITS = {**{unit: unit for unit in METRES}, "feet": "ft", "foot": "ft", "inch": "in", "inches": "in"}
_HEADINGS = {"yaw", "psi", "theta"}  # of a path, beside heading
_ANGLES = {"rad": 1.0, **dict.fromkeys(("deg", "degrees", "°"), math.pi / 180.0)}
_LIKELY = 0.9  # similarity of a misspelt name
_POSITIONS = (("x", "y"), ("lon", "lat"), ("s", "kappa"))
_PAIRS = (*_POSITIONS, ("left", "right"), ("left_sweep", "right_sweep"))
_GEOMETRY = {"wkt", "geom", "geometry", "the_geom", "wkt_geom", "wkb_geometry"}


@dataclass(frozen=True)
class Columns:
    """Where a table has what: ``at`` is the number of each column by its meaning, ``position`` the pair that says where.

    ``titles`` are the names as the table has them, by meaning; ``unread`` those of no meaning here. ``units`` are what
    the titles of lengths say, such as ``x_ft`` and ``left [m]``, by meaning.
    """

    at: dict[str, int]
    titles: dict[str, str]
    position: tuple[str, str]
    unread: tuple[str, ...]
    units: dict[str, str]

    @property
    def where(self) -> str:
        """The titles of the position, for messages."""
        return ", ".join(self.titles[key] for key in self.position)

    @property
    def unit(self) -> str | None:
        """The unit that the position says."""
        return self.units.get(self.position[0])


def folded(title: str) -> str:
    """Return a name without case, accents, units in brackets and punctuation: ``Längengrad [°]`` is ``langengrad``."""
    plain = unicodedata.normalize("NFKD", title.replace("ø", "o").replace("Ø", "o").casefold())
    plain = re.sub(r"[\[(][^\])]*[\])]?", "", "".join(sign for sign in plain if not unicodedata.combining(sign)))
    return re.sub(r"\W+", "_", plain).strip("_")


def is_header(titles: list[str]) -> bool:
    """Tell whether every one of several names has a meaning: a comment of such names is a header."""
    return len(titles) > 1 and None not in _meanings(titles)


def has_geometry(titles: list[str]) -> bool:
    """Tell whether a column holds whole geometries (well-known text)."""
    return any(folded(title) in _GEOMETRY for title in titles)


def named_among(title: str, known: Collection[str], angles: Collection[str]) -> tuple[str, float]:
    """Return a column's name, one of the ``known`` and of ``angles`` if it is a spelling of one, and its unit in metres or radians.

    ``Yaw [deg]`` and ``heading_deg`` are ``heading`` in degrees; an angle without a unit is in radians.
    """
    name, (named, length) = folded(title), _named(title)
    base, _, suffix = name.rpartition("_")
    bracket = re.search(r"[\[(]\s*(\w+|°)", title)
    angle, unit = (base, suffix) if suffix in _ANGLES else (name, bracket[1].casefold() if bracket else "")
    angle = "heading" if angle in _HEADINGS else angle
    if angle in angles:
        return angle, _ANGLES.get(unit, 1.0)
    own = _MEANINGS.get(named, "")
    return own if own in known else name.removesuffix("_m"), METRES[length or "m"]


def columns_of(titles: list[str], where: str) -> Columns:
    """Return what the columns called ``titles`` are; ``where`` begins the messages.

    Raises:
        RoadError: no position, half of a pair, or two columns of the same meaning.

    """
    at: dict[str, int] = {}
    unread: list[str] = []
    for number, (title, meaning) in enumerate(zip(titles, _meanings(titles), strict=True)):
        if meaning is None:
            unread += [title] if title else []
        elif meaning not in at:
            at[meaning] = number
        elif title == titles[at[meaning]]:
            msg = f"{where}: column {title} occurs twice"
            raise RoadError(msg)
        else:
            raise _contradiction(where, titles[at[meaning]], title)
    names = {meaning: titles[number] for meaning, number in at.items()}
    present = [pair for pair in _POSITIONS if pair[0] in at or pair[1] in at]
    if not present:
        msg = f"{where}: no position columns among {', '.join(titles)[:200]}"
        raise RoadError(msg, hint=LAYOUTS)
    if len(present) > 1:
        raise _contradiction(where, *(", ".join(names[key] for key in pair if key in names) for pair in present[:2]))
    for pair in _PAIRS:
        for own, other in (pair, pair[::-1]):
            if other in at and own not in at:
                msg = f"{where}: column {own} is missing beside {names[other]}"
                raise RoadError(msg, hint=LAYOUTS)
    if "width" in at and "left" in at:
        raise _contradiction(where, f"{names['left']}, {names['right']}", names["width"])
    if "left_sweep" in at and "left" not in at:
        msg = f"{where}: {names['left_sweep']} and {names['right_sweep']} need left and right beside them"
        raise RoadError(msg, hint=LAYOUTS)
    units = {meaning: unit for meaning, title in names.items() if (unit := _named(title)[1]) is not None}
    if units.get("x") != units.get("y"):
        msg = f"{where}: columns {names['x']} and {names['y']} are not in one unit"
        raise RoadError(msg, hint=LAYOUTS)
    return Columns(at, names, present[0], tuple(unread), units)


def _contradiction(where: str, one: str, other: str) -> RoadError:
    return RoadError(f"{where}: columns {one} and {other} contradict each other", hint=LAYOUTS)


def unread_note(unread: Sequence[str], name: str) -> tuple[str, ...]:
    """Return a note on the columns that are not read, none without any; with what a misspelt one may have meant."""
    if not unread:
        return ()
    near = [(title, difflib.get_close_matches(folded(title), _MEANINGS, n=1, cutoff=_LIKELY)) for title in unread[:20]]
    meant = "".join(f"; did you mean {match[0]} by {title}?" for title, match in near if match and match[0] != folded(title))
    several = "columns" if len(unread) > 1 else "column"
    return (f"{name}: {several} {', '.join(unread)[:200]} not read{meant}",)


def is_width(title: str) -> bool:
    """Tell whether a name, in one of many languages, is that of a road's width, or of how far it reaches to a side."""
    return _MEANINGS.get(_named(title)[0]) in {"left", "right", "width"}


def _named(title: str) -> tuple[str, str | None]:
    """Return a folded name, and the unit that it says: ``Width_ft`` and ``width [ft]`` are ``width``, ``ft``, as ``kappa [1/ft]`` is."""
    name = folded(title)
    base, _, suffix = name.rpartition("_")
    if _MEANINGS.get(base) in LENGTHS and suffix in _UNITS:
        return base, _UNITS[suffix]
    within = {**dict.fromkeys(LENGTHS, r"[\[(]\s*(\w+)"), "kappa": r"[\[(]\s*1\s*/\s*(\w+)"}.get(_MEANINGS.get(name, ""))
    bracket = None if within is None else re.search(within, title)
    return name, None if bracket is None else _UNITS.get(bracket[1].casefold())


def _meanings(titles: list[str]) -> list[str | None]:
    names = [_named(title)[0] for title in titles]
    meanings = [_MEANINGS.get(name) for name in names]
    for pair, together in _ONLY_TOGETHER.items():
        others = {meaning for name, meaning in zip(names, meanings, strict=True) if name not in pair}
        if set(pair) <= set(names) and not others & {"x", "y", "lon", "lat"}:
            meanings = [dict(zip(pair, together, strict=True)).get(name, meaning) for name, meaning in zip(names, meanings, strict=True)]
    return meanings
