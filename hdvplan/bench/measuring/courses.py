"""The cases of a benchmark: each vehicle's road with the limits that the suite asks for, by every scheme and solver."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.suite import AS_SET, GIVEN, Suite
from hdvplan.case import Case
from hdvplan.centring.stationary import CentringTable
from hdvplan.errors import RoadError
from hdvplan.road.limits import Limits
from hdvplan.road.load import find_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

PINCH_LENGTH_M = 6.0
PINCH_RAMP_M = 3.0  # before and behind it: a jump would lie between two stations, and no plan could keep it
_SPACING_M = 0.25
_CLASS_PINCH_M = 1.5  # of the class "binding", unless the suite says otherwise
_PLATEAU = 0.99  # of the largest curvature: the pinch lies in the middle of a bend, not where it begins


def cases_of(suite: Suite) -> list[Case]:
    """Load all roads and vehicles of a suite and return a case for each of ``Suite.cells``; limits as they stand in the QP.

    Raises:
        RoadError: a road that cannot be read, or a pinch that closes it.
        VehicleError: a vehicle that cannot be read.

    """
    vehicles = {name: load_vehicle(suite.file(name) or name) for name in suite.vehicles}
    reading = RoadOptions(road_ids=suite.road_ids)
    # what the files have wrong is said before any of them is smoothed
    found = {name: find_road(suite.file(name) or name, reading) for name in suite.roads}
    roads = {name: make() for name, make in found.items()}
    limited = {
        (road, vehicle, limits): with_limits(roads[road], vehicles[vehicle], suite, limits) for road, vehicle, limits in suite.courses()
    }
    return [
        Case(
            limited[cell.road, cell.vehicle, cell.limits], vehicles[cell.vehicle], suite.objective, cell.solver, suite.settings(cell.scheme)
        )
        for cell in suite.cells()
    ]


def with_limits(road: Road, vehicle: Vehicle, suite: Suite, limits: str = AS_SET) -> Road:
    """Return ``road`` with the limits that ``suite`` prescribes for ``vehicle``, or those of a class; all but ``GIVEN`` replace its own.

    Without a half width they lie beside the smoothed line, which is driven: beside the line as given they would bind where smoothing
    moved it.

    Raises:
        RoadError: the pinch leaves no room between the limits, or there are no limits of its own.

    """
    if limits == GIVEN:
        if road.street is None:
            msg = f"{road.name} has no limits of its own"
            raise RoadError(msg, hint=f"leave {GIVEN} out of the classes, or give the road file widths or edges")
        return road
    if not suite.limits or limits == "off":
        return replace(road, limits=None)
    s = np.linspace(0.0, road.path.length, int(np.ceil(road.path.length / _SPACING_M)) + 1)
    curvature = road.path.at(s).curvature
    tightest = int(np.argmax(np.abs(curvature)))
    geometric = float(CentringTable.of(vehicle).at(curvature[[tightest]]).half_width[0])
    if limits == "unkeepable":
        reach = 0.5 * (0.5 * vehicle.width + geometric)
        return road.within(Limits.constant(reach, reach, road.path.length))
    reach = geometric + suite.slack if suite.half_width is None else suite.half_width
    pinch = suite.pinch if limits == AS_SET else (suite.pinch or _CLASS_PINCH_M) if limits == "binding" else None
    if pinch is None:
        return road.within(Limits.constant(reach, reach, road.path.length)) if suite.half_width is None else road.with_limits(reach, reach)
    if pinch >= 2.0 * reach:
        msg = f"a pinch of {pinch:g} m closes {road.name}, whose limits are {2.0 * reach:.2f} m apart"
        raise RoadError(msg, s_m=float(s[tightest]), hint="choose a smaller --pinch")
    free = np.full(len(s), reach)
    away = np.abs(s - _bend(s, np.abs(curvature), tightest)) - 0.5 * PINCH_LENGTH_M
    pinched = reach - pinch * np.clip(1.0 - away / PINCH_RAMP_M, 0.0, 1.0)
    left, right = (free, pinched) if curvature[tightest] >= 0.0 else (pinched, free)
    return road.within(Limits(s, left, -right, left, -right))


def _bend(s: FloatArray, curvature: FloatArray, tightest: int) -> float:
    outside = np.flatnonzero(curvature < _PLATEAU * curvature[tightest])
    begin = outside[outside < tightest].max(initial=-1) + 1
    end = outside[outside > tightest].min(initial=len(s)) - 1
    return float(0.5 * (s[begin] + s[end]))
