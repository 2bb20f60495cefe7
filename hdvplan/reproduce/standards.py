"""Published turning figures of standards beside ours: design vehicles in the manoeuvres that the standards prescribe."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
from scipy.optimize import brentq

from hdvplan.answers import room_text
from hdvplan.errors import TurnError
from hdvplan.report.manoeuvre_plots import turns_figure
from hdvplan.report.manoeuvres import turn_json
from hdvplan.reproduce import published
from hdvplan.reproduce.study import NOT_EXPLAINED, Progress, Row, Study
from hdvplan.turning.follow import Followed
from hdvplan.turning.manoeuvre import Manoeuvre
from hdvplan.turning.swept import chart_of, places
from hdvplan.turning.turn import Turn, load_template, turn
from hdvplan.vehicle.load import load_vehicle, preset_groups
from hdvplan.vehicle.model import Unit, Vehicle

_INNER_M, _OUTER_M = 5.30, 12.50
_CORNER_M = 2.04  # from the kingpin to the furthest front corner of a semitrailer
_DRAWN = ("P", "CITY-BUS", "WB-40", "WB-62")

_SECOND_HAND = ("SU-30", "SU-40", "S-BUS-36")  # whose outer radius was read in a vehicle library, not in the manual
_CORNER = "not reproduced: with a square front the corner runs here; a cab with rounded or cut corners is the likely cause"
_ANGLE = "not reproduced, though the inside radius is, and both follow from the same wheelbases; not explained"
_PRINTED = {"WB-67": "the figure prints 0.59 m beside 1.9 ft"}
_RECALLED = "no figure that could be read in a source"
_WHEELBASE = "the abstract gives no wheelbase: one that meets it is"
_CLOSED = "closed form, not published:"


def standards(on_progress: Progress) -> Study:
    """Drive the manoeuvres of AASHTO, the EU, Australia and the FHWA."""
    minimum = load_template("aashto-180")
    turns = {name: turn(load_vehicle(name), minimum) for name in preset_groups()["aashto"]}
    on_progress(0.3)
    circles = _circles()
    on_progress(0.8)
    rows = [*_aashto(turns), *_europe(circles), *_tail_swing(), *_map21()]
    on_progress(1.0)
    data = pd.json_normalize([_flat(one) for one in (*turns.values(), *circles.values()) if isinstance(one, Turn)])
    return Study(
        "standards",
        "Turning figures of standards",
        f"{published.GREEN_BOOK}; {published.SDDC}; {published.PBS}; {published.MAP21}; Directives 97/27/EC and 96/53/EC",
        "A point of the vehicle follows the prescribed path exactly; a value stands under published only where it was read in the source.",
        (),
        tuple(rows),
        data,
        partial(turns_figure, {name: turns[name] for name in _DRAWN}, {name: published.TURN_INSIDE[name].value for name in _DRAWN}),
    )


def deemed_wheelbase(width: float) -> float:
    """Return the wheelbase at which a semitrailer driven alone, its kingpin on 10.46 m, just keeps 5.30 m inside [m]."""

    def excess(wheelbase: float) -> float:
        alone = Vehicle("semitrailer", (Unit(wheelbase, _CORNER_M, 12.0 - wheelbase, width),), max_curvature=1.0)
        return turn(alone, Manoeuvre(_OUTER_M - _CORNER_M, None)).figures.bodies.inside - _INNER_M

    return float(brentq(excess, 7.0, 9.0, xtol=1e-6))


def outer_wheel(driven: Followed) -> float:
    """Return the outer front wheel's radius where the front wheels are turned most [m]."""
    lead, chart = driven.vehicle.lead, chart_of(driven)
    _, e = places(driven, chart, 0, np.array([lead.wheelbase]), np.array([-0.5 * lead.width]))
    return chart.radius - float(e[int(np.argmax(driven.kappa)), 0])


def _aashto(turns: dict[str, Turn]) -> list[Row]:
    rows = []
    for name, found in turns.items():
        figures = found.figures
        inside = published.TURN_INSIDE.get(name)
        remark = _PRINTED.get(name, "") if inside else _RECALLED
        rows.append(Row(f"{name}: inside radius", "m", inside, figures.wheels.inside, remark))
        if name in published.TURN_OUTSIDE:
            rows.append(_outside(name, found))
        if name in published.TURN_OVERHANG:
            rows.append(Row(f"{name}: outside radius, front overhang", "m", published.TURN_OVERHANG[name], figures.bodies.outside, _CORNER))
        if name in published.TURN_ARTICULATION:
            angle, remark = float(np.rad2deg(figures.articulation[0])), _ANGLE if name == "WB-67" else ""
            rows.append(Row(f"{name}: articulation", "deg", published.TURN_ARTICULATION[name], angle, remark))
        if name in published.TURN_STEERING:
            settled = float(np.rad2deg(np.arctan(found.driven.vehicle.max_curvature * found.driven.vehicle.lead.wheelbase)))
            steering, remark = float(np.rad2deg(figures.steering)), f"at the end of the half turn; the settled circle has {settled:.1f}"
            rows.append(Row(f"{name}: steering angle", "deg", published.TURN_STEERING[name], steering, remark))
    return rows


def _outside(name: str, found: Turn) -> Row:
    """Return the outer front wheel's radius; where wheels that turn at once decide, with what they give at the begin of the arc."""
    value, ours, begin = published.TURN_OUTSIDE[name], outer_wheel(found.driven), found.figures.wheels.outside
    between = (
        f"between ours where the wheels are turned most and at the begin of the arc, {begin:.2f} m: how fast AASHTO's turn was not read"
    )
    row = Row(f"{name}: outside radius, front wheel", "m", value, ours)
    remark = (between if ours <= value.value <= begin else NOT_EXPLAINED) if row.differs else ""
    return replace(
        row, remark="; ".join([*(["published value second hand"] if name in _SECOND_HAND else []), *([remark] if remark else [])])
    )


def _circles() -> dict[str, Turn | TurnError]:
    circle, found = load_template("eu-circle"), dict[str, Turn | TurnError]()
    for name in preset_groups()["europe"]:
        try:
            found[name] = turn(load_vehicle(name), circle)
        except TurnError as error:
            found[name] = error
    return found


def _europe(circles: dict[str, Turn | TurnError]) -> list[Row]:
    rows = []
    for width in (2.55, 2.60):
        closed = np.sqrt((_OUTER_M - _CORNER_M) ** 2 - (_INNER_M + 0.5 * width) ** 2)
        remark = f"{_CLOSED} sqrt((12.50 - 2.04)^2 - (5.30 + width / 2)^2) = {closed:.4f}"
        name = f"EU: deemed wheelbase, {width:.2f} m wide"
        rows.append(Row(name, "m", None, deemed_wheelbase(width), remark))
    for name, found in circles.items():
        if isinstance(found, TurnError):
            least = np.nan if found.least_radius_m is None else found.least_radius_m
            rows.append(Row(f"EU, {name}: least radius", "m", None, least, "it cannot drive 12.50 m: does not comply"))
        else:
            spare = found.figures.bodies.inside - _INNER_M
            remark = f"complies, {room_text(spare, fits=True, digits=3)}" if found.complies else f"does not comply, {-spare:.3f} m short"
            rows.append(Row(f"EU, {name}: inside radius", "m", None, found.figures.bodies.inside, remark))
    return rows


def _tail_swing() -> list[Row]:
    template, rows = load_template("pbs-90"), []
    for wheelbase, overhang in ((4.5, 3.7), (6.0, 7.0)):
        rigid = Vehicle("rigid", (Unit(wheelbase, 1.2, overhang, 2.5),), max_curvature=0.2)
        swing = turn(rigid, template).figures.tail_swing[0]
        words = f"PBS tail swing, overhang {overhang:g} m"
        rows.append(Row(words, "m", published.TAIL_SWING[overhang], swing, f"{_WHEELBASE} {wheelbase:g} m", fitted=True))
    return rows


def _map21() -> list[Row]:
    template, foot = load_template("map21"), published.FOOT_M
    found = turn(load_vehicle("WB-67"), template).figures.off_tracking
    lead, trailer = 18.6 * foot, 44.0 * foot
    fitted = Vehicle("fitted", (Unit(lead, 1.2, 0.0, 2.5), Unit(trailer, 0.9, 1.4, 2.5)), max_curvature=0.12)
    other = turn(fitted, template).figures.off_tracking
    inches = [off / published.INCH_M for off in other]
    remark = f"the study's wheelbases could not be read; ours is WB-67's. 18.6 and 44 ft give {inches[0]:.0f} and {inches[1]:.0f} inches"
    words = ("drive axles", "trailer axles")
    return [
        Row(f"MAP-21 off-tracking, {what}", "m", value, ours, remark)
        for what, value, ours in zip(words, published.MAP21_OFF_TRACKING, found, strict=True)
    ]


def _flat(found: Turn) -> dict[str, object]:
    return {
        key: ";".join(f"{item:.6g}" for item in value) if isinstance(value, list) else value
        for key, value in turn_json(found).items()
        if key not in {"limits", "text"}
    }
