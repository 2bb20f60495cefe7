"""What is said, drawn and written about a manoeuvre of forward and backward legs. The JSON file comes last."""

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
from hdvplan.report import PICTURES, TURN_DRAWINGS
from hdvplan.report.files import SHEET, drawing_bytes
from hdvplan.report.grid import grid
from hdvplan.report.layers import System
from hdvplan.report.manoeuvre_layers import line_of, reversal_features, view_of
from hdvplan.report.paper import SheetOptions
from hdvplan.road.crs import LONLAT, placed
from hdvplan.turning.reversing.answer import Answer
from hdvplan.turning.reversing.words import arms_text, closed_form, details, verdict

Json = dict[str, Any]


def reversal_json(answer: Answer) -> Json:
    """Return the answer under the command line's names; metres and degrees, legs in the order of driving."""
    chosen = answer.chosen
    room = answer.room
    return {
        "vehicle": answer.vehicle.name,
        "text": [verdict(answer), details(answer)],
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
                "closed_form_m": closed_form(answer.vehicle, answer.template, tried),
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
    arms = f"arms: {arms_text(answer)}; " if answer.arms else ""
    columns = ("leg", "direction", "length [m]", "heading [deg]", "articulation [deg]", "least room [m]", "beside")
    legs = grid(
        f"{answer.vehicle.name}, {answer.template}, {answer.size:.2f} m of {answer.template.words}", columns, rows,
        text=("direction", "beside"),
        caption=f"{arms}articulation: the largest of the leg; room: what the least {answer.template.words} leaves; written to {directory}",
    )  # fmt: skip
    return (legs,) if answer.template.docks else (legs, _tried_table(summary["tried"], answer.template.words))


def _tried_table(tried: Sequence[Json], words: str) -> Table:
    """Return what each number of legs needs: found by the best and the worst start, and by a formula where there is one."""
    rows = []
    for one in tried:
        formula, sizes = one["closed_form_m"], one["found_m"]
        found = (f"{one['fits_with_m']:.2f}", f"{sizes[0]:.3f}", f"{sizes[-1]:.3f}", f"{len(sizes)} of {one['starts']}")
        rows.append((f"{one['legs']}", *found, "-" if formula is None else f"{formula:.3f}"))
    columns = ("legs", "fits with [m]", "best start [m]", "worst start [m]", "found by", "no swing [m]")
    caption = "no swing: by formula, without swinging out first"
    return grid(f"{words}, found", columns, rows, caption=caption if any(row[-1] != "-" for row in rows) else None)


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


def write_reversal(answer: Answer, directory: Path, name: str, *, kinds: Collection[str] = (), sheet: SheetOptions | None = None) -> None:
    """Write ``<name>.json``, ``poses.csv``, ``legs.geojson`` and what is drawn, of ``PICTURES`` and ``TURN_DRAWINGS``, into ``directory``.

    ``sheet`` adds a drawing to scale. An ``OptionError``: the folder holds files of others, or the sheet has no room at its scale.
    """
    contents: dict[str, Callable[[], bytes]] = {
        "poses.csv": lambda: csv_bytes(reversal_poses(answer)),
        "legs.geojson": lambda: json_bytes(legs_road(answer), indent=None),
    }
    contents |= {f"{name}.{kind}": partial(_drawn, answer, kind) for kind in kinds}
    if sheet is not None:
        from hdvplan.report.leg_sheet import reversal_sheet_bytes  # noqa: PLC0415 - Matplotlib takes half a second to import

        contents[SHEET] = partial(reversal_sheet_bytes, answer, sheet)
    contents[f"{name}.json"] = lambda: json_bytes(reversal_json(answer))
    names = (*(f"{name}.{kind}" for kind in (*PICTURES, *TURN_DRAWINGS)), SHEET)
    Together(f"{name}.json", names, {f"{name}.json": "fits_with_m"}).write(directory, contents)


def _drawn(answer: Answer, kind: str) -> bytes:
    from hdvplan.report.manoeuvre_plots import reversal_figure  # noqa: PLC0415 - as above

    system = System(None, "metres; all turns are to the left, mirror it where one drives on the left")
    notes = [verdict(answer), details(answer)]
    return drawing_bytes(kind, partial(reversal_figure, answer), partial(reversal_features, answer), notes, system)
