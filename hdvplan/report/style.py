"""How every picture of a plan looks: colours, lines and type, for print, slides and colour-blind readers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
import shapely
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.offsetbox import AnchoredOffsetbox
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.report import BODY_COLOURS, BREACH, FAINT, INK, MUTED, body_colour

DPI = 150  # of PNG
SLIDE_IN = (16.0, 9.0)
ON_WHITE = {"boxstyle": "round,pad=0.15", "facecolor": "white", "edgecolor": "none", "alpha": 0.8}  # text on a map
BRIDGED = (0, (4, 3))  # dashes of a kerb that nobody drew

_PALE, _DARK = 0.4, 0.6
_PACKED = 1  # of 9: 13 % more bytes than with Matplotlib's 6, in a seventh of the time
_LEGEND_SHARE = 0.85  # of the width of a figure, or of a part of it: beside it stand the numbers of an axis
_LABEL_PAD = 6.0  # from a text to the frame of its axes [pixels]
_AWAY_PT = np.array([10.0, 20.0, 35.0, 55.0, 80.0, 120.0])  # from a place to the text that is written beside it
_TEXT = 100.0  # of a map it is the last that another text may cover
_TURNS = np.pi * np.array([0.0, 0.25, -0.25, 0.5, -0.5, 0.75, -0.75, 1.0])  # off outwards
_DECADES = 2.0  # on an axis, from which it has no numbers between them
_STYLE = {
    "axes.axisbelow": True,
    "axes.edgecolor": MUTED,
    "axes.grid": False,
    "axes.labelcolor": INK,
    "axes.labelsize": "small",
    "axes.linewidth": 0.7,
    "axes.prop_cycle": cycler(
        color=[*BODY_COLOURS, "#D55E00", "#56B4E9", "#000000", "#999999", "#7F4F24", "#B5A900"]  # Okabe and Ito's, with a darker yellow
    ),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.06,
    "figure.facecolor": "white",
    "font.size": 11.0,
    "grid.color": FAINT,
    "grid.linewidth": 0.7,
    "hatch.linewidth": 0.7,
    "legend.fontsize": "small",
    "legend.frameon": False,
    "pdf.fonttype": 42,  # text stays text
    "svg.fonttype": "none",
    "text.parse_math": False,  # a dollar in the name of a road is a dollar
    "text.usetex": False,  # whatever the user's own settings are: names are no TeX, and LaTeX may be missing
    "svg.hashsalt": "hdvplan",  # the same plan gives the same file
    "xtick.color": MUTED,
    "xtick.labelsize": "small",
    "ytick.color": MUTED,
    "ytick.labelsize": "small",
}


@contextmanager
def styled() -> Iterator[None]:
    """Apply the style to figures made and saved inside the block; Matplotlib's settings outside stay as they are."""
    with mpl.rc_context(_STYLE), warnings.catch_warnings():  # type: ignore[arg-type] # Matplotlib types the keys as literals
        warnings.filterwarnings("ignore", message="Glyph .* missing")  # of a name in another script: a box stands for it
        yield


def plain_decades(axes: Axes, axis: Literal["x", "y"]) -> None:
    """Write the numbers of a logarithmic axis as they are said, 0.1, 1, 10: as powers they would be formulas, which are not drawn."""
    one = axes.xaxis if axis == "x" else axes.yaxis
    one.set_major_locator(LogLocator(subs=(1.0,) if np.ptp(np.log10(one.get_view_interval())) > _DECADES else (1.0, 2.0, 5.0)))
    one.set_minor_locator(NullLocator())
    one.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))


def body_fill(unit: int) -> tuple[float, float, float]:
    """Return the opaque pale version of a body's colour: overlaps must not mix to a third one."""
    red, green, blue = (1.0 - _PALE * (1.0 - part) for part in to_rgb(body_colour(unit)))
    return red, green, blue


def body_dark(unit: int) -> tuple[float, float, float]:
    """Return the dark version of a body's colour, which stands out on the pale one."""
    red, green, blue = (_DARK * part for part in to_rgb(body_colour(unit)))
    return red, green, blue


def write_head(figure: Figure, title: str, colour: str = INK, *, size: str = "medium", notice: str | None = None) -> None:
    """Write the title above a figure and, where there is one, the source of its data below it."""
    figure.suptitle(title, x=0.01, ha="left", fontweight="bold", fontsize=size, color=colour)
    if notice is not None:
        figure.supxlabel(notice, x=0.01, ha="left", fontsize="x-small", color=MUTED)


def fitted_legend(make: Callable[[int], Legend], columns: int) -> Legend:
    """Return the legend that ``make`` makes of at most so many columns as its part of the figure has room for."""
    for count in range(columns, 0, -1):
        legend = make(count)
        if count == 1 or legend.get_window_extent().width <= _LEGEND_SHARE * legend.figure.bbox.width:
            break
        legend.remove()
    return legend


def legend_above(axes: Axes, columns: int = 4) -> Legend:
    """Return the legend above a diagram, of at most so many columns."""
    look: dict[str, Any] = {"bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.0, "handlelength": 1.6, "columnspacing": 1.2}
    return fitted_legend(lambda count: axes.legend(loc="lower left", ncols=count, **look), columns)


def mark_broken(axes: Axes, places: FloatArray, label: str) -> None:
    """Mark places (n, 2) where something is broken."""
    axes.plot(*places.T, linestyle="none", marker="X", color=BREACH, markersize=7, markeredgecolor="white", label=label, zorder=5)


def write_beside(axes: Axes, text: str, place: FloatArray, outwards: FloatArray, taken: Iterable[BaseGeometry], colour: str) -> None:
    """Write a text beside a place of a map (2,) [m] with a line to it: ``outwards`` or where else it covers least of what is ``taken``."""
    axes.add_artist(_Beside(text, place, outwards, taken, colour))


class _Beside(Annotation):
    """An annotation that finds its place when it is drawn: before, nobody knows what its axes show, and how large it is on them."""

    def __init__(self, text: str, place: FloatArray, outwards: FloatArray, taken: Iterable[BaseGeometry], colour: str) -> None:
        at = float(place[0]), float(place[1])
        line = {"arrowstyle": "-", "color": colour, "linewidth": 0.8, "shrinkA": 0.0, "shrinkB": 0.0}
        super().__init__(
            text, at, at, ha="center", va="center", color=colour, fontsize="small", fontweight="bold", zorder=9, bbox=ON_WHITE,
            clip_on=True, arrowprops=line,
        )  # fmt: skip
        self._outwards, self._taken = outwards, list(taken)

    def draw(self, renderer: RendererBase) -> None:
        """Move it, and draw it."""
        if self.axes is not None:
            self.set_position(self._free(renderer))
        super().draw(renderer)

    def _free(self, renderer: RendererBase) -> tuple[float, float]:
        """Return where it covers least within its axes, other texts included; of places as good the nearest."""
        axes = self.axes
        assert axes is not None  # noqa: S101 - for the type checker: they draw it
        data = axes.transData
        half = 0.5 * np.array(Text.get_window_extent(self, renderer).padded(_LABEL_PAD).size)
        place, out = data.transform(self.xy), data.transform(self.xy + self._outwards) - data.transform(self.xy)
        turned = np.arctan2(out[1], out[0]) + _TURNS
        directions = np.column_stack([np.cos(turned), np.sin(turned)])
        away = _AWAY_PT[:, None] * renderer.points_to_pixels(1.0) + np.abs(directions) @ half
        middles = (place + away[:, :, None] * directions).reshape(-1, 2)
        middles = np.clip(middles, axes.bbox.min + half, np.maximum(axes.bbox.max - half, axes.bbox.min + half))
        others = [child for child in axes.get_children() if child is not self and isinstance(child, Text | AnchoredOffsetbox)]
        written = [Text.get_window_extent(one, renderer) if isinstance(one, Text) else one.get_window_extent(renderer) for one in others]
        low, high = (data.inverted().transform(middles + sign * half) for sign in (-1.0, 1.0))
        own, boxes = shapely.box(*low.T, *high.T)[:, None], [shapely.box(*box.transformed(data.inverted()).extents) for box in written]
        covered = shapely.intersection(own, [*self._taken, *boxes])
        weights = np.array([1.0] * len(self._taken) + [_TEXT] * len(boxes))
        x, y = data.inverted().transform(middles[np.argmin((shapely.area(covered) + shapely.length(covered)) @ weights)])
        return float(x), float(y)


def figure_bytes(figure: Figure, kind: str) -> bytes:
    """Return a figure as a file of ``kind``, an extension that Matplotlib knows, without the time of day in it."""
    buffer = BytesIO()
    metadata = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(kind, {})
    with styled():
        if kind == "png":
            figure.set_dpi(DPI)
            FigureCanvasAgg(figure).print_png(buffer, pil_kwargs={"compress_level": _PACKED})  # type: ignore[no-untyped-call] # savefig draws twice
        else:
            figure.savefig(buffer, format=kind, dpi=DPI, metadata=metadata)
    return buffer.getvalue()
