"""Where the middle of the swept envelope should lie: an offset from the road's centre, constant, along s, or between the limits.

A vehicle that is balanced about a circle beside the road's centre drives the balanced circle of that circle's radius: on a road
that turns left by curvature k, an offset b to the left leaves the curvature k / (1 - k b). Its stationary offsets are those
of that curvature, plus b; on the straight they are b alone.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.limits import Limits
from hdvplan.road.load_csv import read_columns

CENTRE = "centre"
_COLUMNS = ("s", "bias")
_TIGHTEST = 0.9  # curvature times bias up to which the road beside the centre can be driven


@dataclass(frozen=True)
class Bias:
    """Wanted middle of the envelope at increasing arclengths [m]: left positive, linear between, constant beyond the ends.

    Raises:
        OptionError: no value, a value that is not finite, or arclengths that do not increase.

    """

    s: FloatArray
    offset: FloatArray

    def __post_init__(self) -> None:
        """Refuse values that are not a function of s."""
        if not (len(self.s) and np.all(np.isfinite(self.s)) and np.all(np.isfinite(self.offset)) and np.all(np.diff(self.s) > 0.0)):
            msg = "a bias needs finite numbers at increasing arclengths"
            raise OptionError(msg)

    @classmethod
    def constant(cls, offset: float) -> Bias:
        """Return the same offset everywhere [m]."""
        return cls(np.zeros(1), np.array([offset]))

    @classmethod
    def between(cls, limits: Limits) -> Bias:
        """Return the middle of the drivable limits, which gives both sides the same clearance."""
        return cls(limits.s, 0.5 * (limits.left + limits.right))

    def at(self, s: FloatArray) -> FloatArray:
        """Return the offset at arclengths ``s`` [m]."""
        return np.interp(s, self.s, self.offset)


NONE = Bias.constant(0.0)


def bias_named(text: str, limits: Limits | None) -> Bias:
    """Return the bias that users call ``text``: metres, a CSV file with columns s,bias, or ``centre`` of the ``limits``.

    Raises:
        OptionError: none of these, a file that cannot be read, or a centre without limits.

    """
    if text == CENTRE:
        if limits is None:
            msg = "--bias centre needs limits"
            raise OptionError(msg, hint="give them with --left and --right, or in the road file")
        return Bias.between(limits)
    try:
        offset = float(text)
    except ValueError:
        return _of_file(Path(text))
    return Bias.constant(offset)


def _of_file(path: Path) -> Bias:
    try:
        s, offset = read_columns(path, _COLUMNS, "bias file")[0].values()
        return Bias(s, offset)
    except (OSError, ValueError) as error:  # a name may have a zero byte
        msg = f"--bias {path} is neither a number of metres, {CENTRE!r}, nor a file that can be read"
        raise OptionError(msg) from error
    except RoadError as error:
        raise OptionError(str(error), hint=error.hint) from error
    except OptionError as error:
        msg = f"bias file {path.name}: {error}"
        raise OptionError(msg) from error


def shifted(curvature: FloatArray, offset: FloatArray, s: FloatArray) -> FloatArray:
    """Return the curvature [1/m] of the line ``offset`` [m] to the left of a road of ``curvature`` at arclengths ``s``.

    Raises:
        OptionError: the line lies beyond the road's centre of curvature, or nearly so.

    """
    turned = curvature * offset
    if np.any(turned > _TIGHTEST):
        at = float(s[int(np.argmax(turned))])
        msg = f"a bias of {offset[int(np.argmax(turned))]:g} m leaves no road at s = {at:z.1f} m, which bends by {np.max(turned):.2f} of it"
        raise OptionError(msg, hint="choose a smaller --bias")
    return curvature / (1.0 - turned)
