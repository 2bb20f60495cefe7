"""What makes a drawing a map: scale bar, north arrow, direction of travel; axes without numbers nobody reads."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.font_manager import FontProperties
from mpl_toolkits.axes_grid1.anchored_artists import AnchoredSizeBar  # type: ignore[import-untyped] # Matplotlib types only its core

from hdvplan.report.colours import INK, MUTED
from hdvplan.road.path import ReferencePath

_BARS_M = (1000.0, 500.0, 200.0, 100.0, 50.0, 20.0, 10.0, 5.0, 2.0, 1.0)
_SHARE = 0.3  # of the map's smaller side, at most
_ARROW_LONG = 0.05  # of the map's larger side


def finish_map(axes: Axes, *, north: bool) -> None:
    """Replace the axes' numbers by a scale bar and, on maps with a place on earth, a north arrow, when the map's extent is known."""
    axes.set_xticks([])
    axes.set_yticks([])
    for spine in axes.spines.values():
        spine.set_visible(True)
        spine.set_color(MUTED)
    axes.set_xlabel("")
    axes.set_ylabel("")
    _scale_bar(axes)
    if north:
        axes.annotate(
            "N", (0.97, 0.98), (0.97, 0.86), xycoords="axes fraction", textcoords="axes fraction", ha="center", va="center",
            fontsize="small", fontweight="bold", arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.2}, zorder=9,
        )  # fmt: skip


def _scale_bar(axes: Axes) -> None:
    """Draw a round number of metres into the lower left corner; its length is that of the data, wherever the axes' limits end up."""
    extent = min(float(np.ptp(axes.get_xlim())), float(np.ptp(axes.get_ylim())))
    metres = next((bar for bar in _BARS_M if bar <= _SHARE * extent), _BARS_M[-1])
    text = f"{metres / 1e3:g} km" if metres >= 1e3 else f"{metres:g} m"  # noqa: PLR2004 - metres in a kilometre
    bar = AnchoredSizeBar(
        axes.transData, metres, text, "lower left", pad=0.3, borderpad=0.3, sep=3, frameon=True, color=INK, label_top=True,
        size_vertical=0.0, fontproperties=FontProperties(size="small"),
    )  # fmt: skip
    bar.size_bar.get_children()[0].set(linewidth=2.2, edgecolor=INK)
    bar.patch.set(facecolor="white", edgecolor="none", alpha=0.8)
    axes.add_artist(bar)


def draw_direction(axes: Axes, path: ReferencePath, s_from: float, s_to: float, *, count: int) -> None:
    """Draw arrows in the direction of travel on the road's centre, ``count`` of them between two arclengths [m]."""
    points = np.column_stack(path.to_plane(np.linspace(s_from, s_to, 50), 0.0))
    long = min(_ARROW_LONG * float(np.max(np.ptp(points, axis=0))), 0.2 * (s_to - s_from) / count)
    for s in s_from + (np.arange(count) + 0.5) * (s_to - s_from) / count:
        x, y = path.to_plane(np.array([s, min(s + long, path.length)]), 0.0)
        axes.annotate(
            "", (float(x[1]), float(y[1])), (float(x[0]), float(y[0])), zorder=5,
            arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.2, "mutation_scale": 14.0, "shrinkA": 0.0, "shrinkB": 0.0},
        )  # fmt: skip
