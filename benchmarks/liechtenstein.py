"""Which buses can drive which bus lines of Liechtenstein at which lane width, and what to widen: tables of a finished study.

hdvplan roads extract liechtenstein --out benchmarks/studies/liechtenstein.bus
hdvplan study benchmarks/studies/liechtenstein.toml --out benchmarks/studies/liechtenstein.out
python benchmarks/liechtenstein.py [--study DIR] [--roads DIR] [--out results/liechtenstein]

Writes as CSV and Markdown ``shares`` (what each vehicle can drive at each width), ``lines`` (the least width of each line and
vehicle), ``worst`` (the places that lack most room, with their streets) and ``checked`` (a bad place of each vehicle, planned again by
itself, with a proof if there is one); ``ranking.csv`` as the study has it; ``map.png``; run.json.
"""

from __future__ import annotations

import json
import shutil
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import shapely
from cases import options_of, write_table
from matplotlib.artist import Artist
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure

from hdvplan.api import plan, prove, replanned
from hdvplan.case import Case
from hdvplan.cli.app import run
from hdvplan.fileio import json_bytes, write_atomically
from hdvplan.judging.verdict import verdict_of
from hdvplan.network.extract import RECORD as EXTRACT
from hdvplan.record import NAME, command, now
from hdvplan.report.grid import markdown_table
from hdvplan.report.style import figure_bytes, styled
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.study.conduct import RANKING, RECORD
from hdvplan.study.store import CELLS
from hdvplan.vehicle.load import load_vehicle

_WORST = 10  # places of each width
_WORDS = ("line", "lines", "name", "vehicle", "vehicles", "road", "street", "side", "place")  # columns of text
_NOTICE = "© OpenStreetMap contributors, Open Database License (ODbL) 1.0."
_CAPTIONS = {
    "shares": (
        "What each bus can drive",
        (
            "half_width_m: the lane that the bus has to either side of the line. It can drive so many routes, roads and kilometres, "
            "of how many; places_too_narrow keep it out, and roads_too_tight cannot be planned, because they bend too tightly."
        ),
    ),
    "lines": (
        "The least lane for each line",
        (
            "The least half width [m] of the study with which a bus fits on all roads of a route; -: with none. whole: the map has "
            "the route without a gap."
        ),
    ),
    "worst": (
        "The places that lack most room",
        (
            "The ten worst of each half width. widening_m: the most that a bus lacks there; -: it cannot be planned further. way: "
            "number in OpenStreetMap; vehicles, courses: which buses it keeps out, and how many combinations of bus and road."
        ),
    ),
    "checked": (
        "Cells planned again",
        (
            "The worst cell of each bus, no road twice, planned separately: room to spare at s (negative: lacking), the same in the "
            "study, and the stretch over which it is proved that nothing can be driven."
        ),
    ),
}  # title, and what the columns are
STUDY = Path(__file__).parent / "studies" / "liechtenstein.toml"
_COLOURS = ("#440154", "#31688e", "#35b779", "#b8c400")  # the widths, the least first
_NONE = "#d7191c"  # no width is enough
_LINE_PT, _DOT_PT2, _PANEL_IN = 1.6, 8.0, (1.9, 4.6)


def main() -> None:
    """Make the tables and the picture."""
    parser = options_of(__doc__, "liechtenstein")
    parser.add_argument("--study", type=Path, default=Path("benchmarks/studies/liechtenstein.out"))
    parser.add_argument("--roads", type=Path, default=Path("benchmarks/studies/liechtenstein.bus"))
    parser.add_argument("--again", metavar="ROAD,VEHICLE,HALF_WIDTH", help="plan this cell again, and write its row of checked.csv alone")
    asked = parser.parse_args()
    if asked.again:
        again(asked.again, asked.out)
        return
    cells, ranking = pd.read_parquet(asked.study / CELLS), pd.read_csv(asked.study / RANKING)
    cells["fits"] = cells["outcome"].eq("planned") & cells["fits"].eq(other=True)
    routes = routes_of(json.loads((asked.roads / EXTRACT).read_text(encoding="utf-8")))
    least = least_widths(cells)
    asked.out.mkdir(parents=True, exist_ok=True)
    tables = {"shares": shares(cells, routes), "lines": lines(least, routes), "worst": worst(ranking, asked.roads)}
    tables["checked"] = checked(cells, asked.roads)
    for name, table in tables.items():
        write_table(asked.out / f"{name}.csv", table, "%.6g")
        shown = table.map(lambda value: f"{value:g}" if isinstance(value, float) else value).fillna("-").replace("nan", "-")
        text = markdown_table(shown, text=[column for column in table if column in _WORDS])
        title, about = _CAPTIONS[name]
        (asked.out / f"{name}.md").write_text(f"# {title}\n\n{about} {_NOTICE}\n\n{text}\n", encoding="utf-8")
    shutil.copyfile(asked.study / RANKING, asked.out / RANKING)
    (asked.out / "map.png").write_bytes(figure_bytes(figure(cells, least, ranking), "png"))
    told = json.loads((asked.study / RECORD).read_text(encoding="utf-8"))
    write_atomically(asked.out / NAME, json_bytes(record(told)))


def record(told: dict[str, Any]) -> dict[str, object]:
    """Return what run.json says of a study: what was asked for and what came of it, with versions and machine of its last session."""
    session, study = told["sessions"][-1], told["study"]
    asked = {name: study[name] for name in ("widths", "objectives", "solvers", "manners", "reading", "prove", "refine")}
    asked |= {"roads": {road["label"]: road["digest"] for road in study["roads"]}}
    asked |= {"vehicles": [variant["vehicle"]["name"] for variant in study["vehicles"]]}
    made = {name: session[name] for name in ("engine", "commit", "software", "machine")}
    ran = [[Path(word).name if Path(word).is_absolute() else word for word in words] for words in (session["command"], command())]
    began = {"commands": ran, "date": told["finished"], "written": now()}
    return {"suite": asked, "cells": told["cells"], "outcomes": told["outcomes"], "fits": told["fits"]} | began | made


def routes_of(extracted: dict[str, Any]) -> pd.DataFrame:
    """Return the roads of the extracted routes, a row a road: its line, the line's name, and whether the map has it without gaps."""
    rows = [
        {
            "road": Path(road["file"]).stem,
            "relation": route["relation"],
            "line": route["ref"] or "-",
            "name": route["name"] or "-",
            "whole": "yes" if route["whole"] else "no",
            "km": 1e-3 * road["length_m"],
        }
        for route in extracted["hdvplan_routes"]
        for road in route["roads"]
    ]
    return pd.DataFrame(rows)


def least_widths(cells: pd.DataFrame) -> pd.DataFrame:
    """Return from which half width on a vehicle fits a road [m], a row a road, a column a vehicle; infinite where none is enough."""
    rows = []
    for (road, vehicle), group in cells.groupby(["road", "vehicle"], sort=False):
        downwards = group.sort_values("half_width_m", ascending=False)
        enough = downwards["half_width_m"][downwards["fits"].cumprod().astype(bool)]
        rows.append({"road": road, "vehicle": vehicle, "half_width_m": enough.min() if len(enough) else np.inf})
    return pd.DataFrame(rows).pivot_table(index="road", columns="vehicle", values="half_width_m", sort=False)


def shares(cells: pd.DataFrame, routes: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each vehicle and width: how many routes and roads it can drive, and how many kilometres of these."""
    table = cells.merge(routes, on="road")
    rows = []
    for (vehicle, width), group in table.groupby(["vehicle", "half_width_m"], sort=False):
        whole = group.groupby("relation")["fits"].all()
        km = group["km"]
        rows.append(
            {
                "vehicle": vehicle,
                "half_width_m": width,
                "routes": int(whole.sum()),
                "of_routes": len(whole),
                "roads": int(group["fits"].sum()),
                "of_roads": len(group),
                "km": round(float(km[group["fits"]].sum()), 1),
                "of_km": round(float(km.sum()), 1),
                "places_too_narrow": int(group["breaches"].sum()),
                "roads_too_tight": int(group["outcome"].isin(["no plan", "refused"]).sum()),
            }
        )
    return pd.DataFrame(rows)


def lines(least: pd.DataFrame, routes: pd.DataFrame) -> pd.DataFrame:
    """Return a row for each route: the least half width from which on each vehicle fits all of its roads [m]; empty where none does."""
    table = routes.merge(least, left_on="road", right_index=True)
    grouped = table.groupby(["line", "relation", "name", "whole"], sort=False)
    found = grouped[list(least)].max().replace(np.inf, np.nan)
    return found.assign(roads=grouped.size()).reset_index()[["line", "relation", "name", "whole", "roads", *least]]


def worst(ranking: pd.DataFrame, roads: Path) -> pd.DataFrame:
    """Return the places that lack most room at each width, with the street and the way of the map that they lie on."""
    found = ranking.sort_values("worst_rank").groupby("half_width_m", sort=True).head(_WORST).sort_values(["half_width_m", "worst_rank"])
    rows = []
    for place in found.to_dict("records"):
        street, way = street_at(roads / f"{place['road']}.geojson", place["s_m"])
        rows.append(
            {
                "half_width_m": place["half_width_m"],
                "widening_m": round(place["widening_m"], 2),
                "side": place["side"],
                "street": street,
                "way": way,
                "lon": round(place["lon"], 5),
                "lat": round(place["lat"], 5),
                "road": place["road"],
                "s_m": round(place["s_m"], 1),
                "vehicle": place["vehicle"],
                "vehicles": place["which_vehicles"],
                "courses": place["courses"],
            }
        )
    return pd.DataFrame(rows)


def again(cell: str, out: Path) -> None:
    """Extract the roads again, plan one cell on them, "ROAD,VEHICLE,HALF_WIDTH", and write its row of ``checked``."""
    road, vehicle, half_width = cell.split(",")
    if run(["roads", "extract", "liechtenstein", "--quiet", "--out", str(out / "bus")]):
        sys.exit(1)
    pd.DataFrame([planned_again(out / "bus", road, vehicle, float(half_width))]).to_csv(out / "checked.csv", index=False)


def planned_again(folder: Path, name: str, vehicle_name: str, width: float) -> dict[str, object]:
    """Plan a cell by itself, look for a proof, and return its row of ``checked``, without the study's numbers."""
    file, vehicle = folder / f"{name}.geojson", load_vehicle(vehicle_name)
    options = RoadOptions(corner_radius=tomllib.loads(STUDY.read_text(encoding="utf-8"))["settings"]["corner_radius"])
    road = load_road(file, options.followed_by(vehicle.max_curvature))
    result = prove(replanned(plan(Case(road.with_limits(width, width), vehicle))))
    verdict = verdict_of(result)
    street, _ = street_at(file, verdict.s)
    row = {"vehicle": vehicle.name, "road": name, "street": street, "half_width_m": width, "case": result.case.key}
    there = verdict.proof
    row |= {"spare_m": verdict.spare, "s_m": verdict.s}
    return row | {"proved_from_m": there and there.s_from, "proved_to_m": there and there.s_to}


def checked(cells: pd.DataFrame, folder: Path) -> pd.DataFrame:
    """Plan each vehicle's worst cell again by itself, no road twice, and look for a proof; the study's numbers stand beside."""
    rows: list[dict[str, object]] = []
    for _, group in cells[cells["outcome"] == "planned"].sort_values("spare_m").groupby("vehicle", sort=False):
        cell = group[~group["road"].isin([row["road"] for row in rows])].iloc[0]
        row = planned_again(folder, cell["road"], cell["vehicle"], cell["half_width_m"])
        rows.append(row | {"study_spare_m": cell["spare_m"], "study_s_m": cell["s_m"]})
    return pd.DataFrame(rows)


def street_at(file: Path, s: float) -> tuple[str, int]:
    """Return what the map calls the street at a length along a road [m], and its way; smoothing moves lengths by metres at most."""
    stretches = json.loads(file.read_text(encoding="utf-8"))["properties"]["stretches"]
    here = next((one for one in stretches if s < one["s_to_m"]), stretches[-1])
    name = here.get("name") or here.get("ref") or here["highway"]
    return (f"{name} (roundabout)" if here.get("junction") == "roundabout" else name), here["way"]


def figure(cells: pd.DataFrame, least: pd.DataFrame, ranking: pd.DataFrame) -> Figure:
    """Return the map: a panel for each vehicle, every road in the colour of the least width that is enough, and the places in its way."""
    shaped = cells.dropna(subset="geometry")
    shapes = {
        road: shapely.get_coordinates(shapely.from_wkb(shape)) for road, shape in zip(shaped["road"], shaped["geometry"], strict=True)
    }
    widths = sorted(cells["half_width_m"].unique())
    colours = dict(zip((*widths, np.inf), (*_COLOURS[: len(widths)], _NONE), strict=True))
    widest = ranking[ranking["half_width_m"] == widths[-1]]
    lacking = widest.assign(vehicle=widest["which_vehicles"].str.split("; ")).explode("vehicle")
    with styled():
        drawn = Figure(figsize=(len(least.columns) * _PANEL_IN[0], _PANEL_IN[1]), layout="constrained")
        panels = drawn.subplots(1, len(least.columns), sharex=True, sharey=True)
        for panel, vehicle in zip(np.atleast_1d(panels), least, strict=True):
            order = least[vehicle].sort_values()  # narrow roads above
            places = [shapes[road] for road in order.index]
            panel.add_collection(LineCollection(places, colors=[colours[width] for width in order], linewidths=_LINE_PT))
            wide = lacking[lacking["vehicle"] == vehicle]
            panel.scatter(wide["lon"], wide["lat"], s=_DOT_PT2, color="black", zorder=3)
            panel.autoscale()
            panel.set_aspect(1.0 / np.cos(np.deg2rad(np.mean(panel.get_ylim()))))
            panel.set_axis_off()
            panel.set_title(vehicle, fontsize="small")
        names = [*(f"lanes of {width:g} m" for width in widths), "none of these", f"too narrow at {widths[-1]:g} m"]
        handles: list[Artist] = [drawn.axes[0].plot([], [], color=colour, linewidth=2.0 * _LINE_PT)[0] for colour in colours.values()]
        handles.append(drawn.axes[0].scatter([], [], s=2.0 * _DOT_PT2, color="black"))
        drawn.legend(handles, names, loc="outside lower center", ncols=len(names), title="fits all of the road from")
        drawn.text(1.0, 0.0, "© OpenStreetMap contributors, ODbL 1.0", ha="right", va="bottom", fontsize="x-small")
    return drawn


if __name__ == "__main__":
    main()
