"""How far a driver may stray on the ten roads, before and after a plan with the largest clearance.

Limits lie 0.6 m beyond what a plan without limits sweeps, to 0.1 m. Writes roads.csv, roads.md, run.json and
place.png, where one part has the least room and another one beside it decides how far the driver may stray, with the largest clearance.

python benchmarks/tracking.py [--out results/tracking] [--roads a,b] [--vehicles a,b]
"""

from __future__ import annotations

import time

import numpy as np
import pandas as pd
from cases import case_within, free_case, options_of, suite_roads, words, write_results
from matplotlib.figure import Figure

from hdvplan.api import clearest, plan
from hdvplan.case import Case
from hdvplan.judging.result import Result, body_name
from hdvplan.judging.tracking import Tracking
from hdvplan.judging.verdict import verdict_of
from hdvplan.report import BREACH, INK
from hdvplan.report.grid import markdown_table
from hdvplan.report.kerbs import tubes_of
from hdvplan.report.layers import drawn_features
from hdvplan.report.maps import around, centre_of, draw_features, draw_tube, finish_map, frame, reach_within
from hdvplan.report.rooms import Window
from hdvplan.report.style import ON_WHITE, figure_bytes, styled

VEHICLES = ("bus", "tractor-trailer")
ROOM_M = 0.6
AROUND_M, SIZE_IN = 12.0, (7.0, 5.0)  # of the picture: line before and beyond its places; paper


def main() -> None:
    """Drive every road with every vehicle and write the table."""
    parser = options_of(__doc__, "tracking")
    parser.add_argument("--roads", type=words, default=suite_roads())
    parser.add_argument("--vehicles", type=words, default=list(VEHICLES))
    options = parser.parse_args()
    rows, cases, drawn = [], [], None
    for road in options.roads:
        for vehicle in options.vehicles:
            free = free_case(road, vehicle)
            half_width = float(np.ceil(10.0 * (plan(free).balance.half_width + ROOM_M))) / 10.0
            cases.append(case_within(free, half_width))
            clear, row = row_of(cases[-1], half_width)
            rows.append(row)
            print(*row.values(), sep="  ", flush=True)
            drawn = clear if _lost(clear) > _lost(drawn) else drawn
    table = pd.DataFrame(rows)
    write_results(options.out, {"roads": table}, {"roads": markdown(table)}, cases)
    if drawn is not None:
        (options.out / "place.png").write_bytes(figure_bytes(place_figure(drawn), "png"))


def _lost(result: Result | None) -> float:
    """Return by how much the driver may stray less than there is room, where different parts beside each other decide these [m]."""
    if result is None or result.tracking is None:
        return 0.0
    verdict, tracking = verdict_of(result), result.tracking
    apart = abs(verdict.s - tracking.s) > AROUND_M or (verdict.unit, verdict.part) == (tracking.unit, tracking.part)
    return 0.0 if apart else (result.balance.min_clearance or 0.0) - tracking.error


@styled()
def place_figure(result: Result) -> Figure:
    """Return a map of where a plan has least room, and of where a driver who strays comes to the limits first."""
    verdict, tracking = verdict_of(result), result.tracking
    assert tracking is not None  # noqa: S101 - for the type checker
    window = Window(min(verdict.s, tracking.s) - AROUND_M, max(verdict.s, tracking.s) + AROUND_M)
    points, room = centre_of(result, window), reach_within(result, window)
    figure = Figure(figsize=SIZE_IN, layout="constrained")
    axes = figure.subplots()
    draw_features(axes, drawn_features(result), around(points, room))
    draw_tube(axes, tubes_of(result, [(window.s_from - AROUND_M, window.s_to + AROUND_M)])[0])
    names = [body_name(result.drive.vehicle, one.unit) for one in (verdict, tracking)]
    told = (
        (verdict, f"least room: {result.balance.min_clearance:.2f} m\n{verdict.part} of the {names[0]}", INK, (-60.0, -60.0)),
        (tracking, f"decides E = {tracking.error:.2f} m:\n{tracking.part} of the {names[1]}", BREACH, (60.0, 60.0)),
    )
    for place, text, colour, away in told:
        arrow = {"arrowstyle": "->", "color": colour, "linewidth": 1.5}
        axes.annotate(
            text, (place.x, place.y), away, textcoords="offset points", ha="center", color=colour, fontweight="bold", bbox=ON_WHITE,
            zorder=9, arrowprops=arrow,
        )  # fmt: skip
    frame(axes, points, room)
    finish_map(axes, north=False)
    axes.set_title(f"{result.drive.vehicle.name} on {result.drive.road.name}", loc="left", fontweight="bold")
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def row_of(case: Case, half_width: float) -> tuple[Result, dict[str, object]]:
    """Return the plan with most clearance, and the row: what a plan leaves its driver, in which share of the drive's time, and this one."""
    begin = time.process_time()
    first = plan(case)
    planned = time.process_time()
    spare, tracking = first.balance.min_clearance, first.tracking
    share = (time.process_time() - planned) / (planned - begin)
    most = clearest(first)
    found: dict[str, object] = {"road": case.road.name, "vehicle": case.vehicle.name, "half_width_m": half_width, "spare_m": spare}
    verdict = verdict_of(first)
    found |= {"spare_s_m": verdict.s, "spare_part": f"{verdict.part} of the {body_name(case.vehicle, verdict.unit)}"}
    found |= _told(first, tracking) | {"share_of_drive": share, "clearance_m": most.case.settings.clearance}
    return most, found | {f"{name}_then": value for name, value in _told(most, most.tracking).items()}


def _told(result: Result, tracking: Tracking | None) -> dict[str, object]:
    if tracking is None:
        return {"error_m": None, "s_m": None, "part": None}
    name = body_name(result.drive.vehicle, tracking.unit)
    return {"error_m": tracking.error, "s_m": tracking.s, "part": f"{tracking.part} of the {name}" if tracking.decided else "none known"}


def markdown(table: pd.DataFrame) -> str:
    """Return the table as it is read."""
    shown = pd.DataFrame({"road": table["road"], "vehicle": table["vehicle"], "half width [m]": table["half_width_m"].map("{:.1f}".format)})
    shown["spare [m]"], shown["E [m]"] = (table[name].map("{:.2f}".format) for name in ("spare_m", "error_m"))
    shown["spare / E"] = (
        (table["spare_m"] / table["error_m"]).where(table["error_m"] > 0.0).map("{:.2f}".format, na_action="ignore").fillna("-")
    )
    shown["least room of, at s"] = table["spare_part"] + table["spare_s_m"].map(", {:.0f} m".format)
    shown["decided by, at s"] = table["part"] + table["s_m"].map(", {:.0f} m".format)
    shown["largest clearance [m]"] = table["clearance_m"].map("{:.2f}".format)
    shown["E then [m]"] = table["error_m_then"].map("{:.2f}".format)
    shown["decided then by, at s"] = table["part_then"] + table["s_m_then"].map(", {:.0f} m".format)
    shown["search / drive"] = table["share_of_drive"].map("{:.2f}".format)
    return f"""# How far a driver may stray

E is the largest lateral error of the front axle, its direction within E / 6 m, with which every body provably stays within limits that lie
{ROOM_M:g} m beyond what the vehicle sweeps without any; at most 1 m is looked for. Then the same with the largest clearance that a plan can
keep. The last column is CPU time of finding E over that of the drive.

{markdown_table(shown, text=("road", "vehicle", "least room of, at s", "decided by, at s", "decided then by, at s"))}
"""


if __name__ == "__main__":
    main()
