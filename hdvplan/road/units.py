"""Units of length: what a file without a coordinate reference system is drawn in, and what no street is in any of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely

from hdvplan.arrays import FloatArray
from hdvplan.errors import RoadError
from hdvplan.lengths import METRES
from hdvplan.road.steps import LARGEST_M, MIN_LENGTH_M, SPARSE_M, refuse_outliers

ASKED = f"{', '.join(list(METRES)[:-1])} or {list(METRES)[-1]}"
_IN_METRES = 6  # INSUNITS
_CODES = {  # what INSUNITS says, and how long that is [m]
    1: ("inches", METRES["in"]),
    2: ("feet", METRES["ft"]),
    4: ("millimetres", METRES["mm"]),
    5: ("centimetres", METRES["cm"]),
    _IN_METRES: ("metres", METRES["m"]),
    21: ("US survey feet", 1200.0 / 3937.0),
}
# Beyond these no line is a street's: one of 100 m is 100 km long in millimetres, and an edge 3 m from it is at 300 m in centimetres.
_LONGEST_M = 100e3
_WIDEST_M = 250.0  # from the line to the nearer of its limits
_NARROWEST_M = 0.25


@dataclass(frozen=True)
class Unit:
    """The unit of a file without a coordinate reference system: as ``given`` by the user, else as INSUNITS (``code``) says, else metres.

    ``code`` is None of files that are no drawings, 0 of drawings that say no unit.
    """

    given: str | None = None
    code: int | None = None

    @property
    def metres(self) -> float:
        """Its length [m]."""
        return METRES[self.given] if self.given is not None else _CODES.get(self.code or 0, ("", 1.0))[1]

    @property
    def said(self) -> str:
        """What the file says of it, to follow the file's name."""
        return f"says {_CODES[self.code][0]} (INSUNITS {self.code})" if self.code in _CODES else "says no unit"

    def notes(self, name: str, system: str | None) -> tuple[str, ...]:
        """Return a note on how a drawing in the ``system`` is read, none where it is read in metres and says so."""
        if self.given is not None or self.code in {None, _IN_METRES} or (system is not None and self.code not in _CODES):
            return ()
        if system is not None:
            return (f"{name} {self.said}; its coordinates are read as those of {system}",)
        words = "in these" if self.code in _CODES else "as metres"
        return (f"{name} {self.said}; its coordinates are read {words}, unless --unit says otherwise",)


def refuse_no_street(
    parts: Sequence[FloatArray],
    reaches: FloatArray | None,
    edges: Sequence[FloatArray],
    unit: Unit,
    name: str,
    lines: tuple[int, ...] | None = None,
) -> None:
    """Refuse a line that only a wrong unit can have made, unless the user gave the unit; ``name`` begins the message.

    ``parts`` of the line, in any order, and ``edges`` have shape (n, 2) [m]; ``reaches`` and ``lines`` are as in ``RawRoad``.

    Raises:
        RoadError: no street is as short, long, narrow or wide, or has points so far apart, or as ``refuse_outliers``.

    """
    if unit.given is not None or not all(np.all(np.abs(part) <= LARGEST_M) for part in parts):  # which ``refuse_far`` tells
        return
    odd = _oddity(parts, reaches, edges, drawn=unit.code is not None)
    if odd is not None:
        for part in parts:
            refuse_outliers(part, lines, name)  # one wrong point is no wrong unit
        msg = f"{name} {unit.said}, and {'in these' if unit.code in _CODES else 'in metres'} {odd}, as of no street"
        raise RoadError(msg, hint=f"say its unit: --unit {ASKED}")


def _oddity(parts: Sequence[FloatArray], reaches: FloatArray | None, edges: Sequence[FloatArray], *, drawn: bool) -> str | None:
    """Return what no street has, None of what may be one."""
    length, steps = sum(float(np.sum(np.hypot(*np.diff(part, axis=0).T))) for part in parts), sum(len(part) - 1 for part in parts)
    if length > 0.0 and not MIN_LENGTH_M <= length <= _LONGEST_M:  # nothing is short in any unit
        return f"its line is {_told(length)} long"
    if length > SPARSE_M * steps and (drawn or steps > 1):
        return f"the points of its line are {_told(length / steps)} apart"
    if reaches is not None:
        left, right = np.median(reaches[:2], axis=1).tolist()
        return f"its limits are {_told(left + right)} apart" if min(left, right) > _WIDEST_M or left + right < 2.0 * _NARROWEST_M else None
    if edges:
        line = shapely.MultiLineString(list(parts))
        shapely.prepare(line)
        points = np.concatenate(list(edges))
        drawn_beside = shapely.linestrings(points, indices=np.repeat(np.arange(len(edges)), [len(edge) for edge in edges]))
        if not np.any(shapely.dwithin(line, drawn_beside, _WIDEST_M)):
            return f"its edges are more than {_told(_WIDEST_M)} from its line"
        if np.all(shapely.dwithin(line, shapely.points(points), _NARROWEST_M)):
            return f"its edges are within {_told(_NARROWEST_M)} of its line"
    return None


def _told(length: float) -> str:
    return f"{length / 1e3:.4g} km" if length >= 1e3 else f"{length:.3g} m"  # noqa: PLR2004 - of a kilometre
