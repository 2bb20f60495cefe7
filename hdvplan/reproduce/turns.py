"""Turns of design vehicles: how far the swept envelope is from exact as its poses get coarser, and what planning gains over a template.

The second compares a vehicle in its own minimum turn, its front axle on the line, with the turn as planned.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.bodies import placed
from hdvplan.report.style import plain_decades, styled
from hdvplan.report.turn_plots import compared_figure
from hdvplan.reproduce import drawing
from hdvplan.reproduce.published import AUTOTURN_MM
from hdvplan.reproduce.study import Progress, Row, Study
from hdvplan.reproduce.swept import road_of, swept
from hdvplan.road.scenarios import uturn_profile
from hdvplan.turning.follow import Followed, follow, tightest
from hdvplan.turning.manoeuvre import GuidePoint, Manoeuvre, guide_offsets
from hdvplan.turning.swept import Band, band_of, chart_of, front_track
from hdvplan.turning.templates import load_template
from hdvplan.vehicle.load import load_vehicle

SPACINGS_M = (0.05, 0.1, 0.25, 0.5, 1.0)
_EXACT_M = 0.0125  # between the poses of the reference
_VEHICLES = ("CITY-BUS", "WB-62")
_STATED = "AutoTURN states 2 to 3 mm at 0.1 m; how it joins its poses is not said"
_PLAN = "the spacing at which `hdvplan plan` measures"
_TURNS = (("SU-30", 90.0), ("CITY-BUS", 90.0), ("A-BUS", 90.0), ("WB-40", 90.0), ("WB-62", 90.0), ("WB-62", 180.0))
_DRAWN = ("WB-62", 90.0)
_RAMP_M = 2.0  # of the road's curvature, which must be continuous; the front axle drives the same line
_LEAD_M = 50.0  # straight before and after


def turn_accuracy(on_progress: Progress) -> Study:
    """Measure the envelope of AASHTO's minimum turns with poses further and further apart, joined and as outlines alone."""
    rows, data = [], []
    for number, name in enumerate(_VEHICLES, start=1):
        vehicle, template = load_vehicle(name), load_template("aashto-180")
        manoeuvre = template.manoeuvre(vehicle)
        exact = follow(vehicle, manoeuvre, spacing=_EXACT_M)
        reference = band_of(exact)
        for spacing in SPACINGS_M:
            driven = follow(vehicle, manoeuvre, spacing=spacing)
            joined, outlines = (_error_mm(reference, band_of(driven, joined=joined), exact) for joined in (True, False))
            data.append({"vehicle": name, "spacing_m": spacing, "joined_mm": joined, "outlines_mm": outlines})
            stated = AUTOTURN_MM if spacing == 0.1 else None  # noqa: PLR2004 - its spacing
            remark = _STATED if stated else _PLAN if spacing == 0.25 else ""  # noqa: PLR2004 - the plan's
            rows.append(Row(f"{name}: every {spacing:g} m, joined", "mm", stated, joined, remark, headline=stated is not None))
            rows.append(Row(f"{name}: every {spacing:g} m, outlines alone", "mm", None, outlines))
        on_progress(number / len(_VEHICLES))
    table = pd.DataFrame(data)
    return Study(
        "turn-accuracy",
        "Accuracy of the swept envelope",
        "AutoTURN: helpdesk.transoftsolutions.com, article 31417619910291",
        "Largest difference of either edge of the swept band, over the turn, from poses "
        f"every {1e3 * _EXACT_M:g} mm; AASHTO's half turn, outline points 0.1 m apart. The motion itself is integrated in steps "
        "of 12.5 mm throughout, exact to 1e-10 rad.",
        (),
        tuple(rows),
        table,
        partial(_accuracy_figure, table),
    )


def _error_mm(reference: Band, coarse: Band, driven: Followed) -> float:
    """Return the largest difference of the edges of two bands over the turn itself [mm]."""
    stations = reference.t[(reference.t >= 0.0) & (reference.t <= driven.manoeuvre.radius * driven.angle)]

    def at(band: Band, edge: FloatArray) -> FloatArray:
        return np.interp(stations, band.t, edge)

    inner = np.abs(at(coarse, coarse.inner) - at(reference, reference.inner))
    outer = np.abs(at(coarse, coarse.outer) - at(reference, reference.outer))
    return 1e3 * float(max(inner.max(), outer.max()))


@styled()
def _accuracy_figure(table: pd.DataFrame) -> Figure:
    """Return the error of the swept envelope over the distance between poses, a vehicle a colour."""
    figure = Figure(figsize=(7.5, 4.8), layout="constrained")
    axes = figure.subplots()
    for (name, rows), colour in zip(table.groupby("vehicle"), (drawing.BLUE, drawing.YELLOW), strict=True):
        axes.loglog(rows["spacing_m"], rows["joined_mm"], color=colour, marker="o", label=f"{name}, poses joined")
        axes.loglog(rows["spacing_m"], rows["outlines_mm"], color=colour, marker="s", linestyle="--", label=f"{name}, outlines alone")
    plain_decades(axes, "x")
    plain_decades(axes, "y")
    drawing.finish(axes, "between poses [m]", "largest error of an edge [mm]", "swept envelope")
    return figure


@dataclass(frozen=True)
class Room:
    """What a drive sweeps about the line [m]: largest reach inside and outside it, and the largest width at one place."""

    inside: float
    outside: float
    width: float

    @property
    def even(self) -> float:
        """The half width that a road with the line in its middle needs."""
        return max(self.inside, self.outside)


def planned_turn(on_progress: Progress) -> Study:
    """Drive design vehicles through their minimum turns by their front axle, and as planned by the geometric objective."""
    rows: list[Row] = []
    cases, data, driven = [], [], dict[tuple[str, float], tuple[Followed, Followed]]()
    for number, (name, degrees) in enumerate(_TURNS, start=1):
        case, line = turn_of(name, np.deg2rad(degrees))
        planned = planned_along(case, line)
        cases.append(case)
        rooms = room_of(line, line), room_of(planned, line)
        rows += _rows(f"{name}, {degrees:g} deg", *rooms, headline=(name, degrees) == _DRAWN)
        data.append({"vehicle": name, "angle_deg": degrees, "radius_m": line.manoeuvre.radius} | _columns(*rooms))
        driven[name, degrees] = line, planned
        on_progress(number / len(_TURNS))
    return Study(
        "planned-turn",
        "A turn as planned, and with the front axle on the line",
        "AASHTO's minimum turns",
        "The line is the vehicle's own minimum turn with ramps of 2 m. Planned: geometric objective, receding horizon (RTI), no limits. "
        "Even half width: what a road needs whose kerbs stand equally far from the line, which is what the objective asks for. Planning "
        "moves reach from the inside kerb to the outside one; the band itself narrows only where the turn is long.",
        tuple(cases),
        tuple(rows),
        pd.DataFrame(data),
        partial(compared_figure, *driven[_DRAWN], ("front axle on the line", "planned"), "{}, {:g} degrees".format(*_DRAWN)),
    )


def turn_of(name: str, angle: float) -> tuple[Case, Followed]:
    """Return a design vehicle's minimum turn by ``angle`` [rad]: to be planned along the line, and with its front axle on it."""
    vehicle = load_vehicle(name)
    radius = tightest(vehicle, guide_offsets(GuidePoint.FRONT_AXLE, vehicle))
    line = follow(vehicle, Manoeuvre(radius, angle, ramp=_RAMP_M, lead_in=_LEAD_M, lead_out=_LEAD_M))
    profile = uturn_profile(1.0 / radius, _RAMP_M, angle=angle, lead_in=_LEAD_M, lead_out=_LEAD_M)
    return Case(road_of(f"{name}-turn", profile), vehicle), line


def planned_along(case: Case, line: Followed) -> Followed:
    """Return a case's drive as if it were a driven manoeuvre along ``line``: measured and drawn is where its bodies were."""
    drive = swept(case).drive
    poses = placed(drive, np.arange(len(drive.poses_s)))
    headings = np.unwrap(np.arctan2(poses["sin"], poses["cos"]), axis=0)
    axles = np.stack([poses["x"], poses["y"]], axis=-1)
    s = drive.poses_s + drive.vehicle.lead.wheelbase
    beta = drive.poses_z[:, 2 : drive.vehicle.rigid_states]
    kappa = drive.kappa[np.clip(np.searchsorted(drive.stations.s, drive.poses_s, side="right") - 1, 0, len(drive.kappa) - 1)]
    return replace(line, s=s, guide=line.path.at(np.clip(s, 0.0, line.s[-1])), kappa=kappa, beta=beta, axles=axles, headings=headings)


def room_of(driven: Followed, line: Followed) -> Room:
    """Return what ``driven`` sweeps about the path of the front axle of ``line``."""
    band = band_of(driven)
    offset = np.interp(band.t, *front_track(line, chart_of(line)))
    return Room(float(np.nanmax(band.inner - offset)), float(np.nanmax(offset - band.outer)), float(np.nanmax(band.width)))


def _rows(what: str, line: Room, planned: Room, *, headline: bool) -> list[Row]:
    def reaches(room: Room) -> str:
        return f"{room.inside:.2f} m inside the line, {room.outside:.2f} m outside"

    gain = line.even - planned.even
    return [
        Row(f"{what}: half width, axle on line", "m", None, line.even, reaches(line), headline=headline),
        Row(f"{what}: half width, planned", "m", None, planned.even, f"{reaches(planned)}; saves {gain:.2f} m", headline=headline),
        Row(f"{what}: swept width, axle on line", "m", None, line.width, headline=headline),
        Row(f"{what}: swept width, planned", "m", None, planned.width, headline=headline),
    ]


def _columns(line: Room, planned: Room) -> dict[str, float]:
    return {
        f"{how}_{what}_m": getattr(room, what)
        for how, room in (("line", line), ("planned", planned))
        for what in ("inside", "outside", "width", "even")
    }
