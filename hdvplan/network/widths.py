"""The width of the road that a way represents: from its tags, or from its number of lanes."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from hdvplan.errors import OptionError
from hdvplan.lengths import METRES

LANE_M = 3.25  # of a lane where the map says only how many there are
_NARROWEST_M, _WIDEST_M = 1.5, 60.0  # a carriageway of another width is an error in the map
_MOST_LANES = 16
_WIDTHS = ("width:carriageway", "width", "est_width")  # tags, in the order in which they are asked
_METRES = re.compile(r"(\d+(?:[.,]\d+)?)\s*(?:m|metres?|meters?)?")
_FEET = re.compile(r"(\d+)\s*'\s*(?:(\d+)\s*\"?)?|(\d+(?:\.\d+)?)\s*(?:ft|feet)")


@dataclass(frozen=True)
class Widths:
    """Widths where tags give none: of a ``lane`` [m], and the ``half_width`` of ways without width and lanes [m], or None.

    Raises:
        OptionError: a number that is no width.

    """

    lane: float = LANE_M
    half_width: float | None = None

    def __post_init__(self) -> None:
        """Refuse what is no width."""
        for what, value in (("lane's width", self.lane), ("half width", self.half_width)):
            if value is not None and not 0.0 < value < _WIDEST_M:
                msg = f"a {what} must be a positive number of metres below {_WIDEST_M:g}, not {value:g}"
                raise OptionError(msg)

    def half_of(self, tags: Mapping[str, str]) -> tuple[float | None, str]:
        """Return half the width of a way's carriageway [m], or None, and what it is from: ``width``, ``lanes``, ``option`` or ""."""
        found = (_length(tags.get(key, "")) for key in _WIDTHS)
        width = next((one for one in found if one is not None), None)
        if width is not None:
            return 0.5 * width, "width"
        lanes = _count(tags.get("lanes", ""))
        if lanes is not None:
            return 0.5 * lanes * self.lane, "lanes"
        return self.half_width, "" if self.half_width is None else "option"


USUAL = Widths()


def _length(text: str) -> float | None:
    """Return a length as maps write it, in metres or in feet and inches [m]; None where it is no width of a road."""
    metres, feet = _METRES.fullmatch(text.strip().lower()), _FEET.fullmatch(text.strip().lower())
    if metres is not None:
        length = float(metres[1].replace(",", "."))
    elif feet is not None:
        length = METRES["ft"] * (float(feet[3]) if feet[3] else float(feet[1]) + float(feet[2] or 0) / 12.0)
    else:
        return None
    return length if _NARROWEST_M <= length <= _WIDEST_M else None


def _count(text: str) -> float | None:
    """Return a number of lanes, which may be a fraction; None where it is none."""
    try:
        lanes = float(text)
    except ValueError:
        return None
    return lanes if 1.0 <= lanes <= _MOST_LANES else None
