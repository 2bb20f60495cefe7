"""Load a road: a file, a shipped road, or a scenario, as a reference path with limits."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from hdvplan.errors import RoadError
from hdvplan.road.checks import pointed_at, refuse_far, refuse_length, refuse_outliers, refuse_unreadable, text_of
from hdvplan.road.line import LONG_M, Line, RawRoad, noted_again, offset_road, reversed_road, smoothed
from hdvplan.road.load_csv import has_wkt, read_csv
from hdvplan.road.load_json import json_object, read_geojson, read_overpass
from hdvplan.road.load_vector import read_vector
from hdvplan.road.options import OF_FILES, OF_POINTS, USUAL, RoadOptions, refuse_unheeded
from hdvplan.road.parts import odd_points
from hdvplan.road.road import Road
from hdvplan.road.scenarios import NOTICE, SCENARIOS, shipped, shipped_roads
from hdvplan.texts import did_you_mean, printable

_OF_VECTORS = ("crs", "feature", "layer", "roles", "unit")  # options that say how to read a vector file
_HEAD_BYTES = 4096  # of an XML file, in which its root begins
_TEXTS = {".csv", ".tsv", ".txt", ".dat", ".asc", ""}  # and what these hold is told by their text


@dataclass(frozen=True)
class Found:
    """A road that was found: call it for the road itself, which takes longer. ``line`` is None of a scenario."""

    make: Callable[[], Road]
    options: RoadOptions
    line: Line | None = None

    def __call__(self) -> Road:
        """Return the road in the direction and at the offset at which it is driven.

        Raises:
            RoadError: the file holds the legs of a drive, its line cannot be smoothed within the options or moved, or its regions are all
                elsewhere.

        """
        if self.line is not None and self.line.raw.legs:
            msg = f"{self.line.name} holds the legs of a drive forwards and backwards, which only `hdvplan plan` plans"
            raise RoadError(msg, hint="--name chooses one line of a file as a road; in a table, leave the column direction out")
        road = self._driven()
        if road.regions:
            from hdvplan.road.regions import refuse_elsewhere  # noqa: PLC0415 - as below

            refuse_elsewhere(road.regions, road.path)
        return road

    def _driven(self) -> Road:
        if self.line is not None and self.line.windowed:
            from hdvplan.road.windows import whole_road  # noqa: PLC0415 - few files need it

            return whole_road(self.line)
        road = self.make()
        if self.options.reverse:
            road = reversed_road(road)
            road = road if self.line is None else noted_again(road, self.line.raw)
        return offset_road(road, self.options.offset) if self.options.offset else road


def load_road(source: str | Path, options: RoadOptions = USUAL) -> Road:
    """Return the road in the file ``source``, or the shipped road or scenario of that name; a file wins over a name.

    Raises:
        RoadError: no such file or name, an unusable file, or a line that cannot be smoothed within the options or moved.

    """
    return find_road(source, options)()


def find_road(source: str | Path, options: RoadOptions = USUAL, *, limited: bool = False) -> Found:
    """Read what ``load_road`` would load, and return what makes the road of it; one that is ``limited`` by options has no edges.

    Raises:
        RoadError: no such file or name, or an unusable file.

    """
    path = Path(source)
    files = shipped_roads()
    if path.is_file():
        line = Line(printable(path.stem), _read(path, options), options)
    elif str(source) in files:
        raw = _read(files[str(source)], options)
        line = Line(str(source), replace(raw, notice=raw.notice or NOTICE) if str(source) in shipped() else raw, options)
    elif str(source) in SCENARIOS:
        refuse_unheeded(f"the scenario {source}", options, *OF_FILES)
        return Found(SCENARIOS[str(source)], options)
    else:
        raise _unknown(source)
    if limited and (line.raw.edges or line.raw.sides is not None):
        note = f"{line.name}: the file's edges are not used: the limits that options give replace them"
        line = replace(line, raw=replace(line.raw, edges=(), edge_names=(), notes=(*line.raw.notes, note)))
    return Found(partial(_road, line), options, line)


def _unknown(source: str | Path) -> RoadError:
    path = Path(source)
    if path.is_dir():
        return RoadError(f"{path} is a folder, not a road file")
    names = [*shipped_roads(), *SCENARIOS]
    otherwise = "give a road file, or a name from `hdvplan roads list`"
    if not path.suffix and len(path.parts) == 1:
        msg = f"no road file, shipped road or scenario is called {str(source)!r}"
        return RoadError(msg, hint=did_you_mean(path.name, names, otherwise))
    beside = [file.name for file in path.parent.iterdir() if file.is_file()] if path.parent.is_dir() else []
    hint = did_you_mean(path.name, beside, did_you_mean(path.stem, names, otherwise))
    return RoadError(f"road file {path} does not exist", hint=hint)


def _read(path: Path, options: RoadOptions) -> RawRoad:
    try:
        refuse_unreadable(path)
        raw = _raw(path, options)
    except OSError as error:
        msg = f"road file {path} cannot be read: {error.strerror or error}"
        raise RoadError(msg) from error
    except RecursionError as error:
        msg = f"{path.name} is nested too deeply"
        raise RoadError(msg) from error
    if not raw.is_profile:
        refuse_far(raw.points, path.name)
        refuse_outliers(raw.points, raw.lines, path.name)
        raw = raw if raw.legs else replace(raw, notes=(*raw.notes, *odd_points(raw.points, raw.lines, path.name)))
        named = ((name, getattr(options, name)) for name in ("crs", "unit") if not raw.legs)
        refuse_length(raw.points, path.name, LONG_M, next((f"--{name} {value}" for name, value in named if value is not None), None))
    return raw


def _raw(path: Path, options: RoadOptions) -> RawRoad:
    """Return what the file says; its name says what kind it is, and where that says nothing, its text."""
    raw = _of_lanes(path, options)
    if raw is not None:
        return raw
    suffix = path.suffix.lower()
    if options.crs is not None:
        refuse_unheeded(f"{path.name}: a file in {options.crs}", options, "unit")
    text = text_of(path) if suffix in _TEXTS else None
    if suffix in {".json", ".geojson"} or (text is not None and text.lstrip().startswith("{")):
        document = json_object(text or text_of(path), path.name)
        if "elements" in document:
            refuse_unheeded(f"{path.name}: a file of OpenStreetMap", options, "crs", "unit")
            return read_overpass(document, path.name, options)
        if document.get("type") == "Topology" or "geometryType" in document:
            return read_vector(path, options)
        refuse_unheeded(f"{path.name}: a GeoJSON file, in degrees or a system that it names,", options, "unit")
        return read_geojson(document, path.name, options)
    if text is None or text.lstrip().startswith("<") or has_wkt(text):
        return read_vector(path, options)
    if options.feature is not None:
        msg = f"{path.name}: a CSV file has no features to choose {options.feature!r} from"
        raise RoadError(msg)
    refuse_unheeded(f"{path.name}: a CSV file", options, "layer", "roles")
    return read_csv(text, path.name, options)


def _of_lanes(path: Path, options: RoadOptions) -> RawRoad | None:
    """Return what a map of lanes says, along a route in it; None of any other file."""
    if path.suffix.lower() == ".xodr":
        from hdvplan.road.load_opendrive import read_opendrive  # noqa: PLC0415 - few files need it

        refuse_unheeded(f"{path.name}: an OpenDRIVE file", options, *_OF_VECTORS, *OF_POINTS)
        return read_opendrive(path, road_ids=options.road_ids, lane=options.lane)
    if path.suffix.lower() == ".osm":
        from hdvplan.road.load_lanelet2 import is_lanelet2, read_lanelet2  # noqa: PLC0415 - as above

        if is_lanelet2(path):
            refuse_unheeded(f"{path.name}: a Lanelet2 map", options, *_OF_VECTORS, "lane")
            return read_lanelet2(path, road_ids=options.road_ids)
    if path.suffix.lower() == ".xml":
        with path.open("rb") as file:
            if b"<commonRoad" in file.read(_HEAD_BYTES):
                msg = f"{path.name} is a CommonRoad file, which is not read"
                raise RoadError(
                    msg, hint="convert it to OpenDRIVE or Lanelet2 with CommonRoad's own crdesigner (commonroad-scenario-designer)"
                )
    if options.road_ids is not None or options.lane is not None:
        msg = f"{path.name} has no road ids and lanes to choose; OpenDRIVE files (.xodr) and Lanelet2 maps (.osm) have"
        raise RoadError(msg)
    return None


def _road(line: Line) -> Road:
    try:
        return smoothed(line)[0]
    except RoadError as error:
        raw = line.raw
        raise error if raw.is_profile else pointed_at(error, raw.points, raw.lines, raw.to_lonlat) from error
