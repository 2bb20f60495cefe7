"""The wanted middle of the swept area as users name it; between the limits, it depends on how obstacles are passed."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.bias import CENTRE, Bias, bias_named
from hdvplan.road.road import Limits

_PACKED = {".gz", ".bz2", ".zip", ".xz", ".zst", ".tar"}  # which pandas unpacks as far as it can, and then raises anything


def bias_asked(text: str, limits: Limits | None) -> Bias:
    """Return the bias that users call ``text``: metres, a CSV file with columns s,bias, or ``centre`` of the ``limits``.

    Raises:
        OptionError: none of these, a file that cannot be read, numbers that cannot be used, or a centre without limits.

    """
    if Path(text).suffix.lower() in _PACKED:
        msg = f"bias file {text} is packed"
        raise OptionError(msg, hint="unpack it, and give the file in it")
    try:
        return bias_named(text, limits)
    except OverflowError as error:  # a whole number of hundreds of digits, which no float holds
        msg = f"bias file {text}: a bias needs finite numbers at increasing arclengths"
        raise OptionError(msg) from error
    except ValueError as error:  # such as a zero byte in a name
        msg = f"--bias {text!r} cannot be read: {error}"
        raise OptionError(msg) from error


def biased(case: Case, text: str) -> Case:
    """Return the case with the bias that users call ``text``; ``centre`` is between the limits of the sides that are chosen.

    Raises:
        OptionError: as for ``bias_asked``.
        RoadError: an obstacle has no room on the side on which it must be passed.

    """
    road = choose_sides(case)[0] if text == CENTRE else case.road
    return replace(case, bias=bias_asked(text, road.limits))
