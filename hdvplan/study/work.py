"""One cell: read the road, plan, judge, and say as rows of tables what came of it. Nothing that goes wrong here ends a study."""

from __future__ import annotations

import pickle
import struct
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache, lru_cache, partial
from pathlib import Path
from time import perf_counter, process_time
from typing import Any, TypeVar

import numpy as np
import shapely

from hdvplan import api
from hdvplan.answers import NO
from hdvplan.arrays import FloatArray
from hdvplan.case import Case, content_digest
from hdvplan.errors import HdvplanError, OptionError, PlanError, QpDataError, RoadError, SolverError
from hdvplan.fileio import write_atomically
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.verdict import verdict_of
from hdvplan.machine import software
from hdvplan.need.answer import Need, need_of
from hdvplan.pieces import Piece, pieces_of, planned
from hdvplan.planning.bias import CENTRE
from hdvplan.planning.settings import LARGEST
from hdvplan.plugins import digest_of as file_digest
from hdvplan.plugins import error_text
from hdvplan.process import temporary_folder
from hdvplan.report.joined import joined_summary, kept_of
from hdvplan.report.needs import need_json, patch_json
from hdvplan.report.summary import summary_of
from hdvplan.road.line import LONG_M
from hdvplan.road.load import Found, find_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road
from hdvplan.study.cells import BREACH, DEAD_END, NEED, NEED_TIME, STEPS, SUMMARY, TIGHTEST, WIDENING, Cell, Row, taken
from hdvplan.study.engine import FAILED, NO_PLAN, PLANNED, REFUSED, Outcome
from hdvplan.study.inputs import RoadSource, road_digest

_VERDICT = ("s_m", "x", "y", "lon", "lat", "spare_m", "side", "unit", "part", "region", "obstacle")  # of the tightest place
_SPACING_M = 2.0  # of the line that stands for a road in tables
_SIMPLER_M = 0.5  # its points that move it by no more are left out
_UNPLANNED = (PlanError, QpDataError, SolverError)

Thing = TypeVar("Thing")
KEPT_ROADS = 64  # files, the newest; a road of 10 km takes some megabytes
_folder = cache(temporary_folder)  # one that nobody else can write to: what is in it runs as code


class _ChangedError(HdvplanError):
    """A file is another one than when the study began, or cannot be read here: the cell has no answer until that is mended."""


def work(cell: Cell) -> Outcome:
    """Plan and judge a cell; whatever it raises is an outcome with its reason."""
    cpu, wall = process_time(), perf_counter()
    row: Row = {"reason": None}
    places: list[Row] = []
    try:
        row["outcome"] = _answer(cell, row, places)
    except (_ChangedError, SolverError) as error:  # also a solver that only this machine lacks
        row |= {"outcome": FAILED, "reason": str(error)}
    except HdvplanError as error:
        row |= {"outcome": REFUSED, "reason": str(error)}
    except Exception as error:  # noqa: BLE001 - a bug, or memory that does not suffice: the other cells go on
        row |= {"outcome": FAILED, "reason": error_text(error)}
    spent: Row = {"parallel_cpu_s": process_time() - cpu, "parallel_wall_s": perf_counter() - wall}
    return Outcome(row | spent, tuple(places))


def _answer(cell: Cell, row: Row, places: list[Row]) -> str:
    setup = cell.setup
    if setup.bias is not None and setup.bias_digest is not None:
        _check_unchanged(setup.bias, setup.bias_digest, lambda name: file_digest(Path(name)))
    loaded = _loaded(cell.road, cell.reading)
    road = loaded.road
    row |= {"geometry": loaded.shape, "length_m": loaded.length, "notice": loaded.notice}
    if isinstance(road, Found):
        ending = _plan_pieces(cell, road, row, places)
    else:
        case = _case(cell, road)
        row["case"] = case.key
        ending = _plan(cell, case, row, places)
    if cell.need:
        _need(cell, road, row, places)
    return ending


def _check_unchanged(name: str, digest: str, digest_here: Callable[[str], str]) -> None:
    """Refuse to plan with a file that is not the one in the cell's key."""
    try:
        same = digest_here(name) == digest
    except (RoadError, OSError) as error:
        msg = f"{Path(name).name} cannot be read here: {error}"
        raise _ChangedError(msg) from error
    if not same:
        msg = f"{Path(name).name} differs here from the file with which the study began"
        raise _ChangedError(msg)


def _case(cell: Cell, road: Road) -> Case:
    if cell.width is not None:
        road = road.with_limits(cell.width.left, cell.width.right)
    if cell.setup.side is not None:
        road = road.passed_on(cell.setup.side)
    case = Case(road, cell.variant.vehicle, cell.objective, cell.solver, cell.setup.settings)
    return case if cell.setup.bias is None else api.biased(case, cell.setup.bias)


def _plan(cell: Cell, case: Case, row: Row, places: list[Row]) -> str:
    try:
        result = api.plan(case)
    except _UNPLANNED as error:
        return _no_plan(error, case.road, 0.0, row, places)
    if cell.prove and verdict_of(result).fits is False:
        result = api.prove(result)
    if cell.refine:
        result = api.replanned(result)
    if cell.setup.clearest:
        result = api.clearest(result)
    summary = summary_of(result, forecast=False)  # no column of a study has it
    row["case"] = result.case.key  # of the stations that it was planned with
    row |= taken(summary, SUMMARY) | taken(summary, STEPS)
    places += places_of(summary, result.drive.road)
    return PLANNED


def _plan_pieces(cell: Cell, found: Found, row: Row, places: list[Row]) -> str:
    """Plan a long road as ``hdvplan plan`` does, piece by piece: memory does not grow with it. There are no proofs and finer plans."""
    refused = {f"bias {CENTRE}": cell.setup.bias == CENTRE, f"clearance {LARGEST}": cell.setup.clearest}
    asked = next((name for name, given in refused.items() if given), None)
    if asked is not None:
        msg = f"{asked} is not for roads of more than {LONG_M / 1e3:.0f} km"
        raise OptionError(msg)
    taken_: list[Piece] = []

    def noted() -> Iterator[Piece]:
        for piece in pieces_of(found, cell.variant.vehicle, cell.setup.settings):
            taken_[:] = [piece]
            yield piece

    try:
        kept = [kept_of(one) for one in planned(noted(), partial(_case, cell))]
    except _UNPLANNED as error:
        return _no_plan(error, taken_[0].road, taken_[0].begins, row, places)
    summary = joined_summary(kept)
    row |= taken(summary, SUMMARY) | taken(summary, STEPS) | {"case": content_digest([piece.key for piece in kept])}
    places += places_of(summary, taken_[0].road)
    return PLANNED


def _no_plan(error: HdvplanError, road: Road, begins: float, row: Row, places: list[Row]) -> str:
    """Say from where on no plan goes on; ``road`` begins at arclength ``begins`` of the cell's road [m]."""
    if isinstance(error, SolverError) and error.status is None:  # it is missing, or unknown
        raise error
    row |= {"fits": False, "word": NO, "reason": str(error)}
    s = getattr(error, "s_m", None)
    if s is not None:
        places.append(dead_end(road, float(s), begins))
        row |= {name: places[-1][name] for name in ("s_m", "x", "y", "lon", "lat")}
    return NO_PLAN


def _need(cell: Cell, road: Road | Found, row: Row, places: list[Row]) -> None:
    """Add what the vehicle needs; where that cannot be found, the reason. A long road is not cut, as by ``hdvplan need``."""
    began = perf_counter()
    try:
        need = need_of(_case(cell, road() if isinstance(road, Found) else road), prove=None)
    except HdvplanError as error:
        row["reason"] = f"{row['reason']}; need: {error}" if row["reason"] else f"need: {error}"
        return
    row |= taken(need_json(need, perf_counter() - began), (*NEED, NEED_TIME))
    places += widening_places(need)


def places_of(summary: Mapping[str, Any], road: Road) -> list[Row]:
    """Return the tightest place of a plan, its breaches in order of s, and obstacles entered beyond the road's ends, from its summary.

    ``road`` is the plan's, or a part of it: all lie in one plane.
    """
    verdict = summary["verdict"]
    lonlat = None if verdict["lon"] is None else (verdict["lon"], verdict["lat"])
    tightest = {"kind": TIGHTEST} | {name: verdict[name] for name in _VERDICT} | {"geometry": _point(lonlat)}
    breaches = [_stretch(BREACH, road, (one["x"], one["y"]), one) | {"spare_m": -one["depth_m"]} for one in summary["breaches"]]
    entered = [
        _place(BREACH, road, near["s_m"], (near["x"], near["y"]))
        | {name: near[name] for name in ("s_from_m", "s_to_m", "side", "unit", "part")}
        | {"depth_m": -near["distance_m"], "spare_m": near["distance_m"], "obstacle": near["name"]}
        for near in summary["obstacles"]
        if near["distance_m"] < -KEPT_M and not 0.0 <= near["s_m"] <= summary["length_m"]
    ]
    return [tightest, *breaches, *entered]


def dead_end(road: Road, s: float, begins: float = 0.0) -> Row:
    """Return the place at arclength ``s`` [m] from which no plan goes on: on the line of a road that begins at arclength ``begins``."""
    x, y = (float(value[0]) for value in road.path.to_plane(np.array([s - begins]), np.zeros(1)))
    return _place(DEAD_END, road, s, (x, y))


def widening_places(need: Need) -> list[Row]:
    """Return the middles of the stretches that the widening of least area consists of; none where there is no widening."""
    widening, road = None if need.widenings is None else need.widenings.area, need.case.road
    middles = [] if widening is None else [(patch, patch.polygon.representative_point()) for patch in widening.patches]
    return [_stretch(WIDENING, road, (middle.x, middle.y), patch_json(patch)) for patch, middle in middles]


def _stretch(kind: str, road: Road, at: tuple[float, float], stretch: Mapping[str, object]) -> Row:
    """Return a place with what is told of its stretch of road, the deepest point being its s."""
    rest = {name: value for name, value in stretch.items() if name not in {"s_from", "s_to", "s_deepest"}}
    return _place(kind, road, stretch["s_deepest"], at) | {"s_from_m": stretch["s_from"], "s_to_m": stretch["s_to"]} | rest


def _place(kind: str, road: Road, s: object, at: tuple[float, float]) -> Row:
    """Return a point's columns; its geometry is WKB in longitude and latitude."""
    lonlat = road.lonlat(*at)
    lon, lat = lonlat or (None, None)
    return {"kind": kind, "s_m": s, "x": at[0], "y": at[1], "lon": lon, "lat": lat, "geometry": _point(lonlat)}


def _point(lonlat: tuple[float, float] | None) -> bytes | None:
    return None if lonlat is None else struct.pack("<BIdd", 1, 1, *lonlat)


@dataclass(frozen=True)
class _Loaded:
    """A road, or what was found of one that is too long to be loaded at once.

    ``shape`` is its line as WKB in longitude and latitude; None where it lies nowhere on the Earth. That of a long road is the given one.
    """

    road: Road | Found
    shape: bytes | None
    length: float
    notice: str | None


@lru_cache(maxsize=2)  # cells of one road and vehicle follow each other
def _loaded(source: RoadSource, options: RoadOptions) -> _Loaded:
    """Return the road of a cell, smoothed by this process or, if it was smoothed lately, by another one."""
    _check_unchanged(source.source, source.digest, road_digest)
    found = spooled(repr((source, options, software(()))), partial(_load, source, options))
    if isinstance(found, RoadError):
        raise found
    return found


def _load(source: RoadSource, options: RoadOptions) -> _Loaded | RoadError:
    """Return the road, or why it cannot be smoothed: that takes as long, and every cell of the road would find it anew."""
    found = find_road(source.source, options)
    if found.line is not None and found.line.long:
        line, raw = found.line, found.line.raw
        return _Loaded(found, _shape(raw.points[::-1] if options.reverse else raw.points, raw.to_lonlat), line.length, raw.notice)
    try:
        road = found()
    except RoadError as error:
        return error
    s = np.linspace(0.0, road.path.length, max(2, int(np.ceil(road.path.length / _SPACING_M)) + 1))
    points = np.column_stack(road.path.to_plane(s, np.zeros(len(s))))
    return _Loaded(road, _shape(points, road.to_lonlat), road.path.length, road.notice)


def _shape(points: FloatArray, to_lonlat: Callable[[FloatArray, FloatArray], tuple[FloatArray, FloatArray]] | None) -> bytes | None:
    if to_lonlat is None:
        return None
    simple = shapely.simplify(shapely.LineString(points), _SIMPLER_M, preserve_topology=False)
    return bytes(shapely.to_wkb(shapely.transform(simple, to_lonlat, interleaved=False), byte_order=1))  # type: ignore[arg-type] # of two arrays


def spooled(name: str, make: Callable[[], Thing]) -> Thing:
    """Return what is kept on disk under a name, which tells the content, or else what ``make`` returns, which is then kept.

    Smoothing a road takes longer than planning along it, and many cells of many processes share it.
    """
    folder = _folder("roads")
    if folder is None:
        return make()
    path = folder / f"{content_digest(name)}.pickle"
    with suppress(Exception):  # none is there, or a crash of the machine left half of one: the next one replaces it
        found: Thing = pickle.loads(path.read_bytes())  # noqa: S301 - see ``_folder``
        return found
    made = make()
    with suppress(OSError):  # a full disk only costs time
        write_atomically(path, pickle.dumps(made))
        for old in sorted(folder.glob("*.pickle"), key=_written)[:-KEPT_ROADS]:
            old.unlink(missing_ok=True)
    return made


def _written(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0
