"""How every picture of a plan looks: colours, lines and type, for print, slides and colour-blind readers."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.text import Annotation, Text
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

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


def write_within(axes: Axes, text: str, at: FloatArray, *, of: tuple[float, float] | None = None, **look: Any) -> None:  # noqa: ANN401 - Matplotlib's
    """Write a text at a place of a map (2,) [m], moved into the map as far as it lies beyond its frame; it may be ``of`` another place."""
    place = (float(at[0]), float(at[1]))
    axes.add_artist(_Within(text, of or place, place, bbox=ON_WHITE, **look))


class _Within(Annotation):
    """An annotation that is moved into its axes when it is drawn: before, nobody knows what they show."""

    def draw(self, renderer: RendererBase) -> None:
        """Move it, and draw it."""
        if self.axes is not None:
            own, frame = Text.get_window_extent(self, renderer).padded(_LABEL_PAD), self.axes.bbox
            moved = np.maximum(np.subtract(frame.min, own.min), 0.0) + np.minimum(np.subtract(frame.max, own.max), 0.0)
            if np.any(moved):
                data = self.axes.transData
                x, y = data.inverted().transform(data.transform(self.get_position()) + moved)
                self.set_position((float(x), float(y)))
        super().draw(renderer)


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
