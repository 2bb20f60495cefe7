"""What is said, drawn and written about manoeuvres: prescribed turns, and forward and backward legs. The JSON file comes last."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import shapely
from rich.table import Table
from shapely.geometry import mapping
from shapely.geometry.base import BaseGeometry

from hdvplan.arrays import FloatArray
from hdvplan.fileio import Together, csv_bytes, json_bytes
from hdvplan.judging.result import body_name
from hdvplan.report import PICTURES, TURN_DRAWINGS
from hdvplan.report.cad import drawing_bytes
from hdvplan.report.files import SHEET
from hdvplan.report.grid import grid
from hdvplan.report.layers import System, line_of, reversal_features, turn_features, view_of
from hdvplan.report.paper import SheetOptions
from hdvplan.road.crs import LONLAT, placed
from hdvplan.turning.follow import Followed
from hdvplan.turning.reversing import words
from hdvplan.turning.reversing.answer import Answer
from hdvplan.turning.turn import Turn, manoeuvre_words, verdict

Json = dict[str, Any]


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


def reversal_json(answer: Answer) -> Json:
    """Return the answer under the command line's names; metres and degrees, legs in the order of driving."""
    chosen = answer.chosen
    room = answer.room
    return {
        "vehicle": answer.vehicle.name,
        "text": [words.verdict(answer), words.details(answer)],
        "template": str(answer.template),
        "fits": answer.fits,
        "sought": answer.template.sought,
        "given_m": answer.given,
        "needed_m": chosen.manoeuvre.size,
        "fits_with_m": chosen.manoeuvre.rounded,
        "options": {name: value for name, value in vars(answer.options).items() if value is not None},
        "ends_m": {name: float(far) for (name, _), far in zip(chosen.manoeuvre.site.ends, chosen.manoeuvre.reaches, strict=True)},
        "arms_m": dict(zip(("left", "right"), answer.arms, strict=True)) if answer.arms else None,
        "equal_arms_fit_with_m": answer.size_of_equal_arms if answer.arms else None,
        "least_room_m": float(room.min()),
        "over_kerbs_m": chosen.manoeuvre.over_kerbs,
        "tried": [
            {
                "legs": tried.legs,
                "fits_with_m": tried.manoeuvre.rounded,
                "starts": tried.starts,
                "found_m": list(tried.sizes),
                "polished": tried.polished,
                "closed_form_m": words.closed_form(answer.vehicle, answer.template, tried),
            }
            for tried in answer.tried
        ],
        "legs": [
            {
                "leg": number,
                "direction": leg.direction,
                "length_m": leg.length,
                "heading_deg": [float(np.rad2deg(leg.lead[end, 2])) for end in (0, -1)],
                "articulation_deg": [[float(np.rad2deg(angle)) for angle in leg.beta[end]] for end in (0, -1)],
                "articulation_most_deg": [float(np.rad2deg(angle)) for angle in np.abs(leg.beta).max(axis=0)],
                "least_room_m": float(gaps.min()),
                "beside": answer.blocks[int(np.argmin(gaps))].name,
            }
            for number, (leg, gaps) in enumerate(zip(chosen.manoeuvre.legs, room, strict=True), start=1)
        ],
    }


def reversal_tables(answer: Answer, directory: str) -> tuple[Table, ...]:
    """Return the legs, a row each, and the numbers of legs that were tried."""
    summary = reversal_json(answer)
    rows = [
        (
            f"{leg['leg']}", leg["direction"], f"{leg['length_m']:.2f}", " to ".join(f"{angle:.0f}" for angle in leg["heading_deg"]),
            f"{max(leg['articulation_most_deg'], default=0.0):.1f}", f"{leg['least_room_m']:.2f}", leg["beside"],
        )
        for leg in summary["legs"]
    ]  # fmt: skip
    arms = f"arms: {words.arms_text(answer)}; " if answer.arms else ""
    columns = ("leg", "direction", "length [m]", "heading [deg]", "articulation [deg]", "least room [m]", "beside")
    legs = grid(
        f"{answer.vehicle.name}, {answer.template}, {answer.size:.2f} m of {answer.template.words}", columns, rows,
        text=("direction", "beside"),
        caption=f"{arms}articulation: the largest of the leg; room: what the least {answer.template.words} leaves; written to {directory}",
    )  # fmt: skip
    return (legs,) if answer.template.docks else (legs, _tried_table(summary["tried"], answer.template.words))


def _tried_table(tried: Sequence[Json], sought: str) -> Table:
    """Return what each number of legs needs: found by the best and the worst start, and by a formula where there is one."""
    rows = []
    for one in tried:
        formula, sizes = one["closed_form_m"], one["found_m"]
        found = (f"{one['fits_with_m']:.2f}", f"{sizes[0]:.3f}", f"{sizes[-1]:.3f}", f"{len(sizes)} of {one['starts']}")
        rows.append((f"{one['legs']}", *found, "-" if formula is None else f"{formula:.3f}"))
    columns = ("legs", "fits with [m]", "best start [m]", "worst start [m]", "found by", "no swing [m]")
    swing = "; no swing: by formula, without swinging out first" if any(row[-1] != "-" for row in rows) else ""
    return grid(f"{sought}, found", columns, rows, caption=f"starts: before the best is polished{swing}")


def reversal_poses(answer: Answer) -> pd.DataFrame:
    """Return the drive, one row a pose in the order of driving: leg, direction, s, lead rear axle, angles [m, rad, 1/m].

    The curvature of a row is held until the next; the last row of a leg has none.
    """
    tables = []
    for number, leg in enumerate(answer.chosen.manoeuvre.legs, start=1):
        columns: dict[str, object] = {"leg": number, "direction": -1 if leg.backward else 1, "s": leg.s}
        columns |= {"x": leg.lead[:, 0], "y": leg.lead[:, 1], "heading": leg.lead[:, 2]}
        columns |= {f"beta{coupling}": beta for coupling, beta in enumerate(leg.beta.T, start=1)}
        tables.append(pd.DataFrame(columns | {"kappa": np.append(leg.kappa, np.nan)}).round(9))
    return pd.concat(tables, ignore_index=True)


def legs_road(answer: Answer) -> Json:
    """Return the manoeuvre as a road file: a line a leg in the order of driving, and what stands as obstacles.

    It lies about longitude 0 and latitude 0, which is no place, as GeoJSON knows no metres; there they are true to 1e-6.
    """
    to_lonlat = placed(np.zeros((2, 2)), LONLAT).to_lonlat
    view, site = view_of(answer), answer.chosen.manoeuvre.site

    def there(points: FloatArray) -> FloatArray:
        return np.asarray(np.round(np.column_stack(to_lonlat(points[:, 0], points[:, 1])), 10), dtype=float)

    def feature(geometry: BaseGeometry, properties: Json) -> Json:
        return {"type": "Feature", "properties": properties, "geometry": mapping(shapely.transform(geometry, there))}

    features = [
        feature(shapely.LineString(line_of(leg)), {"leg": number, "direction": leg.direction})
        for number, leg in enumerate(answer.chosen.manoeuvre.legs, start=1)
    ]
    allowed = [site.overhang] * len(site.blocks) + [site.beyond_ends] * len(answer.walls)
    for block, overhang in zip(answer.blocks, allowed, strict=True):
        solid, whole = block.eroded(overhang).area(view), block.area(view)
        areas = {"obstacle": solid, "sweepable": shapely.difference(whole, solid)}
        features += [feature(area, {"name": block.name, "region": kind}) for kind, area in areas.items() if not area.is_empty]
    note = f"{answer.vehicle.name}, {answer.template}; drawn about longitude 0, latitude 0: no place on earth"
    return {"type": "FeatureCollection", "name": f"{answer.template}", "note": note, "features": features}


def write_turn(turn: Turn, directory: Path, *, kinds: Collection[str] = ()) -> None:
    """Write ``turn.json``, ``poses.csv``, ``width.csv`` and what is drawn, of ``PICTURES`` and ``TURN_DRAWINGS``, into ``directory``.

    An ``OptionError``: the folder holds files of others.
    """
    contents: dict[str, Callable[[], bytes]] = {
        "poses.csv": lambda: csv_bytes(poses_table(turn.driven)),
        "width.csv": lambda: csv_bytes(width_table(turn)),
    }
    contents |= {f"turn.{kind}": partial(_turn_bytes, turn, kind) for kind in kinds}
    contents["turn.json"] = lambda: json_bytes(turn_json(turn))
    Together("turn.json", _pictures("turn"), {"turn.json": "swept_width_m"}).write(directory, contents)


def write_reversal(answer: Answer, directory: Path, name: str, *, kinds: Collection[str] = (), sheet: SheetOptions | None = None) -> None:
    """Write ``<name>.json``, ``poses.csv``, ``legs.geojson`` and what is drawn, of ``PICTURES`` and ``TURN_DRAWINGS``, into ``directory``.

    ``sheet`` adds a drawing to scale. An ``OptionError``: the folder holds files of others, or the sheet has no room at its scale.
    """
    contents: dict[str, Callable[[], bytes]] = {
        "poses.csv": lambda: csv_bytes(reversal_poses(answer)),
        "legs.geojson": lambda: json_bytes(legs_road(answer), indent=None),
    }
    contents |= {f"{name}.{kind}": partial(_reversal_bytes, answer, kind) for kind in kinds}
    if sheet is not None:
        from hdvplan.report.leg_sheet import reversal_sheet_bytes  # noqa: PLC0415 - Matplotlib takes half a second to import

        contents[SHEET] = partial(reversal_sheet_bytes, answer, sheet)
    contents[f"{name}.json"] = lambda: json_bytes(reversal_json(answer))
    Together(f"{name}.json", (*_pictures(name), SHEET), {f"{name}.json": "fits_with_m"}).write(directory, contents)


def _pictures(name: str) -> tuple[str, ...]:
    return tuple(f"{name}.{kind}" for kind in (*PICTURES, *TURN_DRAWINGS))


def _turn_bytes(turn: Turn, kind: str) -> bytes:
    from hdvplan.report.manoeuvre_plots import turn_figure  # noqa: PLC0415 - Matplotlib takes half a second to import

    template = [] if turn.template is None else [f"template: {turn.template.name}; {turn.template.source}"]
    notes = [verdict(turn), *template, f"vehicle: {turn.driven.vehicle.name}"]
    system = System(None, "metres; the turn is to the left, mirror it for one to the right")
    return drawing_bytes(kind, partial(turn_figure, turn), partial(turn_features, turn), notes, system)


def _reversal_bytes(answer: Answer, kind: str) -> bytes:
    from hdvplan.report.manoeuvre_plots import reversal_figure  # noqa: PLC0415 - as above

    system = System(None, "metres; all turns are to the left, mirror it where one drives on the left")
    notes = [words.verdict(answer), words.details(answer)]
    return drawing_bytes(kind, partial(reversal_figure, answer), partial(reversal_features, answer), notes, system)
