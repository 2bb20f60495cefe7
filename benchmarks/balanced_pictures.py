"""The pictures of benchmarks/balanced.py."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
from balanced_drives import EXAMPLE, RTI, VEHICLES, case_road
from matplotlib.figure import Figure

from hdvplan.case import Case
from hdvplan.judging.result import Result
from hdvplan.report.style import styled
from hdvplan.reproduce.study import swept, unevenness
from hdvplan.vehicle.load import load_vehicle


def example(name: str) -> dict[str, Result]:
    """Return the example S-turn driven with both objectives."""
    road, vehicle = case_road(*EXAMPLE), load_vehicle(name)
    return {objective: swept(Case(road, vehicle, objective, settings=RTI)) for objective in ("geometric", "balanced")}


def draw_examples(path: Path) -> None:
    """Draw reach to both sides, imbalance and curvature of the example."""
    with styled():
        figure = Figure(figsize=(11.0, 8.0), layout="constrained")
        axes = figure.subplots(3, len(VEHICLES), sharex="col", sharey="row")
        for column, name in enumerate(VEHICLES):
            for (way, found), colour in zip(example(name).items(), ("0.45", "#0072B2"), strict=True):
                s = found.envelope.s
                axes[0, column].plot(s, found.envelope.reach_left, color=colour, label=f"{way}: left")
                axes[0, column].plot(s, -found.envelope.reach_right, color=colour, linestyle="--", label="right")
                axes[1, column].plot(s, unevenness(found), color=colour, label=way)
                axes[2, column].plot(found.drive.stations.s[: len(found.drive.kappa)], found.drive.kappa, color=colour, label=way)
            axes[0, column].plot(s, found.expected.half_width, color="#E69F00", linewidth=0.8, label="stationary half width")
            axes[2, column].plot(s, found.drive.road.path.at(s).curvature, color="#E69F00", linewidth=0.8, label="road")
            axes[0, column].set_title(name)
            axes[2, column].set_xlabel("arclength s [m]")
        for row, label in enumerate(("reach [m]", "left + right [m]", "curvature [1/m]")):
            axes[row, 0].set_ylabel(label)
            axes[row, 0].legend(fontsize="small")
            for panel in axes[row]:
                panel.grid(visible=True, alpha=0.3)
        figure.suptitle(f"S-turn of {EXAMPLE[0]:g} 1/m and {EXAMPLE[1]:g} 1/m^2, receding horizon, as simulated")
        figure.savefig(path, dpi=120)


def draw_convergence(table: pd.DataFrame, trades: pd.DataFrame, path: Path) -> None:
    """Draw the imbalance over rounds, and gain against reach."""
    with styled():
        figure = Figure(figsize=(11.0, 4.2), layout="constrained")
        over, against = figure.subplots(1, 2)
        for name, line in zip(VEHICLES, ("--", "-"), strict=True):
            mine = table[table["vehicle"] == name]
            for rule, part in mine[mine["rounds"] > 0].groupby("rule"):
                over.loglog(part["rounds"], part["mean_abs_imbalance_m"], linestyle=line, marker=".", label=f"{name}: {rule}")
            here = trades[trades["vehicle"] == name]
            for what, part in (("magnitude", here[here["rounding_m"] < 1.0]), ("square", here[here["rounding_m"] > 1.0])):
                against.plot(part["furthest_most_percent"], part["gain_percent"], linestyle=line, marker="o", label=f"{name}: {what}")
        over.set(xlabel="programs, or corrections of c", ylabel="mean |left + right| [m]", title="One horizon over the whole S-turn")
        against.set(
            xlabel="largest growth of a largest reach [%]", ylabel="gain in mean |left + right| [%]", title="Share of the residual 0 to 0.3"
        )
        for panel in (over, against):
            panel.grid(visible=True, alpha=0.3)
            panel.legend(fontsize="x-small")
        figure.savefig(path, dpi=120)


def draw_roads(table: pd.DataFrame, path: Path) -> None:
    """Draw the mean imbalance on the real roads."""
    with styled():
        figure = Figure(figsize=(11.0, 4.5), layout="constrained")
        for axes, name in zip(figure.subplots(1, len(VEHICLES), sharey=True), VEHICLES, strict=True):
            wide = table[table["vehicle"] == name].pivot_table(index="road", columns="objective", values="mean_abs_imbalance_m", sort=False)
            rows = np.arange(len(wide))
            for offset, way, colour in ((-0.2, "geometric", "0.6"), (0.2, "balanced", "#0072B2")):
                axes.barh(rows + offset, wide[way], height=0.4, color=colour, label=way)
            axes.set(yticks=rows, yticklabels=wide.index, xlabel="mean |left + right| [m]", title=name)
            axes.invert_yaxis()
            axes.legend()
        figure.savefig(path, dpi=120)
