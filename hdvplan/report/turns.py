"""What ``hdvplan turn`` says, draws and writes. Each file appears whole or not at all, and ``turn.json`` comes last."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
from rich.table import Table

from hdvplan.fileio import Together, csv_bytes, json_bytes
from hdvplan.judging.result import body_name
from hdvplan.report import PICTURES, TURN_DRAWINGS
from hdvplan.report.files import drawing_bytes
from hdvplan.report.grid import grid
from hdvplan.report.layers import System
from hdvplan.report.manoeuvre_layers import turn_features
from hdvplan.turning.follow import Followed
from hdvplan.turning.turn import Turn, manoeuvre_words, verdict

Json = dict[str, object]


def turn_json(turn: Turn) -> Json:
    """Return the figures under the command line's names; metres and degrees, lists by unit or coupling from the front."""
    figures, manoeuvre = turn.figures, turn.driven.manoeuvre
    return {
        "vehicle": turn.driven.vehicle.name,
        "text": [verdict(turn)],
        "template": None if turn.template is None else turn.template.name,
        "source": None if turn.template is None else turn.template.source,
        "guide": str(manoeuvre.point),
        "radius_m": manoeuvre.radius,
        "angle_deg": None if manoeuvre.angle is None else float(np.rad2deg(manoeuvre.angle)),
        "ramp_m": manoeuvre.ramp,
        "standstill": manoeuvre.standstill,
        "min_inside_radius_m": figures.bodies.inside,
        "max_outside_radius_m": figures.bodies.outside,
        "min_inside_radius_wheels_m": figures.wheels.inside,
        "max_outside_radius_wheels_m": figures.wheels.outside,
        "swept_width_m": figures.swept_width,
        "off_tracking_m": max(figures.off_tracking),
        "off_tracking_axles_m": list(figures.off_tracking),
        "tail_swing_m": max(figures.tail_swing),
        "tail_swing_units_m": list(figures.tail_swing),
        "frontal_swing_m": figures.frontal_swing,
        "articulation_deg": [float(np.rad2deg(angle)) for angle in figures.articulation],
        "steering_deg": float(np.rad2deg(figures.steering)),
        "complies": turn.complies,
        "limits": [
            {"figure": one.name, "least_m" if one.least else "most_m": one.value, "spare_m": one.spare(figures), "kept": one.kept(figures)}
            for one in turn.limits
        ],
    }


def turn_table(turn: Turn, directory: str) -> Table:
    """Return the figures: a quantity, its value and unit, and a remark a row."""
    figures, vehicle = turn.figures, turn.driven.vehicle
    names = [body_name(vehicle, unit) for unit in range(len(vehicle.units))]
    steady = "in the steady circle" if turn.driven.manoeuvre.angle is None else "largest along the turn"
    metres = [
        ("inside radius", figures.bodies.inside, f"bodies; wheels {figures.wheels.inside:.3f}"),
        ("outside radius", figures.bodies.outside, f"bodies; wheels {figures.wheels.outside:.3f}"),
        ("swept width", figures.swept_width, steady),
        *(
            ("off-tracking", off, f"axle of the {name}, inside the front axle's track")
            for name, off in zip(names, figures.off_tracking, strict=True)
        ),
        *(("tail swing", swing, f"{name}, beyond its side before the turn") for name, swing in zip(names, figures.tail_swing, strict=True)),
    ]
    if figures.frontal_swing is not None:
        metres.append(("frontal swing", figures.frontal_swing, "beyond its side in line with the exit"))
    couplings = zip(names, names[1:], figures.articulation, strict=False)
    degrees = [("articulation", angle, f"{ahead} to {behind}, largest") for ahead, behind, angle in couplings]
    degrees.append(("steering", figures.steering, "front wheels, largest"))
    rows = [(name, f"{value:.3f}", "m", remark) for name, value, remark in metres]
    rows += [(name, f"{np.rad2deg(angle):.1f}", "deg", remark) for name, angle, remark in degrees]
    source = "" if turn.template is None else f"{turn.template.source}; "
    title = f"{vehicle.name}, {manoeuvre_words(turn)}"
    return grid(title, ("", "value", "unit", "remark"), rows, text=("", "unit", "remark"), caption=f"{source}written to {directory}")


def poses_table(driven: Followed) -> pd.DataFrame:
    """Return the drive, one row a pose: s and place of the guided point, lead rear axle, angles [m, rad, 1/m]."""
    columns = {"s": driven.s, "guide_x": driven.guide[:, 0], "guide_y": driven.guide[:, 1]}
    columns |= {"x": driven.poses["x"][:, 0], "y": driven.poses["y"][:, 0], "heading": driven.headings[:, 0]}
    columns |= {f"beta{number}": beta for number, beta in enumerate(driven.beta.T, start=1)}
    return pd.DataFrame(columns | {"kappa": driven.kappa, "steering": driven.steering}).round(9)


def width_table(turn: Turn) -> pd.DataFrame:
    """Return the swept band along the turn: t, offsets of its edges from the arc and its tangents (inside positive), width [m]."""
    band = turn.figures.band
    return pd.DataFrame({"t": band.t, "inner": band.inner, "outer": band.outer, "width": band.width}).round(6)


def write_turn(turn: Turn, directory: Path, *, kinds: Collection[str] = ()) -> None:
    """Write ``turn.json``, ``poses.csv``, ``width.csv`` and what is drawn, of ``PICTURES`` and ``TURN_DRAWINGS``, into ``directory``.

    An ``OptionError``: the folder holds files of others.
    """
    contents: dict[str, Callable[[], bytes]] = {
        "poses.csv": lambda: csv_bytes(poses_table(turn.driven)),
        "width.csv": lambda: csv_bytes(width_table(turn)),
    }
    contents |= {f"turn.{kind}": partial(_drawn, turn, kind) for kind in kinds}
    contents["turn.json"] = lambda: json_bytes(turn_json(turn))
    names = (*(f"turn.{kind}" for kind in (*PICTURES, *TURN_DRAWINGS)),)
    Together("turn.json", names, {"turn.json": "swept_width_m"}).write(directory, contents)


def _drawn(turn: Turn, kind: str) -> bytes:
    from hdvplan.report.manoeuvre_plots import turn_figure  # noqa: PLC0415 - Matplotlib takes half a second to import

    template = [] if turn.template is None else [f"template: {turn.template.name}; {turn.template.source}"]
    notes = [verdict(turn), *template, f"vehicle: {turn.driven.vehicle.name}"]
    system = System(None, "metres; the turn is to the left, mirror it for one to the right")
    return drawing_bytes(kind, partial(turn_figure, turn), partial(turn_features, turn), notes, system)
