"""Read a road from any vector file that GDAL knows: GeoPackage, Shapefile, DXF, KML, GPX, FlatGeobuf, spreadsheets and more."""

from __future__ import annotations

import re
import warnings
from contextlib import closing, suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import shapely
from numpy.typing import NDArray

from hdvplan.errors import RoadError
from hdvplan.road.assemble import road_of
from hdvplan.road.checks import Unit
from hdvplan.road.features import POINTS, Feature
from hdvplan.road.line import RawRoad
from hdvplan.road.load_csv import Table, read_table
from hdvplan.road.options import RoadOptions
from hdvplan.road.recorded import tracks_of
from hdvplan.road.regions import Kind
from hdvplan.road.scenarios import NOTICE

_MOST_FEATURES = 200_000
_MOST_STEPS = 50_000_000  # of SQLite for one view: a second or two
_SQLITE = "SQLite format 3\0"
_POINTS_ONLY = {"Point", "MultiPoint", "2.5D Point", "Point Z", "Point M", "Point ZM", "MultiPoint Z", "3D Point", "3D MultiPoint"}
_SHEETS = {"XLSX", "ODS", "XLS"}
_DRAWINGS = {"DXF", "DGN", "CAD"}
_POINT = "AcDbPoint"  # of a drawing, where texts are points too
_ROUTES = {"GPX", "OSM"}
_TRACKS = ("GPX", "tracks")
_REACHES = {"left_m", "right_m", "width_m", "corner_radius_m"}
_NETWORK = ("<OGRVRTDataSource", "<OGRWFSDataSource", "<OGRCSWDataSource", "gdal_streamed_alg")  # files that name other sources to open
_HEADER_BYTES = 65536  # of a drawing, which hold its settings
_INSUNITS = re.compile(r"\$INSUNITS(?:\s+70\s+(\d+)\s|\0F\0(..))", re.DOTALL)  # of a text, or of a binary drawing
_INCHES = 1
_OLD = "cp1252"  # texts that are no UTF-8
_OF_ADDRESSES = re.compile(r"[!?;\t\n\r\ud800-\udfff]")  # what begins another part, what is left out, and undecodable bytes
_CONVERT = "ogr2ogr road.gpkg {name}"


def read_vector(path: Path, options: RoadOptions) -> RawRoad:
    """Return the road in the vector file ``path``; ``options`` say which line.

    The file says its coordinate reference system, layer by layer; their ``crs`` overrides it. Without either, as in drawings,
    coordinates are in their ``unit``, else in what a drawing says, else in metres.

    Raises:
        RoadError: GDAL is missing or cannot read the file, or what ``road_of`` refuses.

    """
    name = path.name
    with path.open("rb") as file:
        head = file.read(4096).decode("latin-1")
    if any(word in head for word in _NETWORK):
        msg = f"{name} names other data and has none itself"
        raise RoadError(msg, hint=f"convert it to a file with the data first: {_CONVERT.format(name=name)}")
    pyogrio, plain = _pyogrio(name), _plain(path)
    if path.suffix.casefold() == ".dxf":
        _refuse_cut_off(path)
    if head.startswith(_SQLITE):
        _refuse_endless_views(plain)
    try:
        content = _content(_Source(pyogrio, plain), options)
    except UnicodeDecodeError:
        content = _content(_Source(pyogrio, plain, _OLD), options)
    if isinstance(content, Table):
        return read_table(content, name, options)
    driver, features = content
    if not features:
        msg = f"{name} has no lines"
        raise RoadError(msg, hint="a road is a line feature; a file that was cut off may have lost its own")
    return road_of(features, name, options, Unit(options.unit, _drawn_in(path) if driver == "DXF" else None), routes=driver in _ROUTES)


def _plain(path: Path) -> Path:
    """Return the whole path of a file, which pyogrio reads as an address: it would open another file, or ask the network for one."""
    whole = path.absolute()  # no address of another kind begins with a slash
    odd = _OF_ADDRESSES.search(whole.as_posix())
    if odd is not None:
        msg = f"{path} cannot be given to GDAL: its path has the sign {odd[0]!r}"
        raise RoadError(msg, hint="rename it, or copy it to a folder with a plain name")
    return whole


def _refuse_endless_views(path: Path) -> None:
    """Refuse a database with a view that would never be read to its end: GDAL counts the rows of every layer first."""
    import sqlite3  # noqa: PLC0415 - few files need it

    damaged = (sqlite3.DatabaseError, UnicodeDecodeError)  # the second of what SQLite quotes; GDAL tells of both
    with suppress(*damaged), closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as base:
        base.set_progress_handler(lambda: 1, _MOST_STEPS)  # ends a statement after so many steps
        for (view,) in base.execute("SELECT name FROM sqlite_master WHERE type = 'view'").fetchall():
            quoted = str(view).replace('"', '""')
            try:
                rows = sum(1 for _ in base.execute(f'SELECT 1 FROM "{quoted}" LIMIT {_MOST_FEATURES + 1}'))  # noqa: S608 - quoted
            except (sqlite3.OperationalError, UnicodeDecodeError) as error:
                rows = _MOST_FEATURES + 1 if "interrupted" in str(error) else 0  # else it calls what only GDAL has
            if rows > _MOST_FEATURES:
                msg = f"{path.name}: view {view!r} has no end, or more than {_MOST_FEATURES} rows"
                raise RoadError(msg, hint=f"write the layer that you need to a file of its own: {_CONVERT.format(name=path.name)} LAYER")


def _pyogrio(name: str) -> ModuleType:
    """Load GDAL: it takes half a second, which CSV and GeoJSON files do not need."""
    try:
        return import_module("pyogrio")
    except ImportError as error:  # its wheel does not exist for every machine
        msg = f"{name} needs GDAL to be read, and pyogrio cannot be loaded: {error}"
        raise RoadError(msg, hint="pip install pyogrio, or convert the file first: ogr2ogr road.geojson FILE") from error


@dataclass(frozen=True)
class _Source:
    """A file that GDAL reads, and the encoding of its texts where that is not what the file says."""

    pyogrio: ModuleType
    path: Path
    encoding: str | None = None

    def info(self, layer: str) -> dict[str, Any]:
        """Return what GDAL says about a layer."""
        info: dict[str, Any] = self.pyogrio.read_info(self.path, layer=layer, force_feature_count=True, encoding=self.encoding)
        return info

    def read(self, layer: str) -> tuple[list[str], Any, Any, list[Any]]:
        """Return the names of a layer's columns, the features' numbers, their shapes and the columns."""
        meta, numbers, shapes, columns = self.pyogrio.raw.read(self.path, layer=layer, return_fids=True, encoding=self.encoding)
        return [str(title) for title in meta["fields"]], numbers, shapes, columns


def _content(source: _Source, options: RoadOptions) -> Table | tuple[str, list[Feature]]:
    """Return the table in a spreadsheet, or of other files the driver and the lines and polygons."""
    errors = source.pyogrio.errors
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # GDAL's remarks on fields that no road needs,
        warnings.simplefilter("ignore", UserWarning)  # and on measures beside coordinates, which it drops
        try:
            layers = _layers(source)
            driver = layers[0][2] if layers else ""
            if driver in _SHEETS:
                return _sheet(source, layers, options)
            return driver, [feature for layer, system, _ in layers for feature in _features(source, layer, options.crs or system, driver)]
        except UnicodeDecodeError as error:
            if source.encoding is None:
                raise
            raise _unreadable(source.path, "its texts are in no known encoding") from error
        except (errors.DataSourceError, errors.DataLayerError, errors.FeatureError, OverflowError, ValueError) as error:  # of a date, too
            raise _unreadable(source.path, str(error)) from error
        except Exception as error:
            if not type(error).__module__.startswith("pyogrio."):  # it passes on some of GDAL's own as classes that are not public
                raise
            raise _unreadable(source.path, str(error)) from error


def _layers(source: _Source) -> list[tuple[str, str | None, str]]:
    """Return the name, the system and the driver of every layer that may hold lines, polygons or rows of a table."""
    name = source.path.name
    found: list[tuple[str, str | None, str]] = []
    for layer, geometry in source.pyogrio.list_layers(source.path):
        if geometry in _POINTS_ONLY:
            continue
        info = source.info(layer)
        if info["features"] > _MOST_FEATURES:
            msg = f"{name}: layer {layer!r} has {info['features']} features; at most {_MOST_FEATURES} are read"
            raise RoadError(msg, hint=f"take out the road's surroundings first: ogr2ogr -spat XMIN YMIN XMAX YMAX road.gpkg {name}")
        if geometry is not None or info["driver"] in _SHEETS:
            found.append((layer, info["crs"], info["driver"]))
    return found


def _features(source: _Source, layer: str, system: str | None, driver: str) -> list[Feature]:
    titles, numbers, shapes, columns = source.read(layer)
    if shapes is None:
        return []
    if (driver, layer) == _TRACKS:
        points, _, places, values = source.read("track_points")
        geometries, times = tracks_of(numbers, dict(zip(points, values, strict=True)), places)
    else:
        geometries, times = _geometries(shapes, source.path.name, layer), [None] * len(shapes)
    titles = [title.casefold() for title in titles]
    found: list[Feature] = []
    for number, geometry, when, *values in zip(numbers, geometries, times, *columns, strict=True):
        properties = {title: _value(value, title) for title, value in zip(titles, values, strict=True)}
        if geometry is None or (geometry.geom_type in POINTS and not str(properties.get("subclasses")).endswith(_POINT)):
            continue
        properties = {title: value for title, value in properties.items() if value is not None}
        labels = [str(properties[key]) for key in ("name", "id", "osm_id", "osm_way_id", "ref", "entityhandle") if key in properties]
        if driver == "OSM":
            properties = {"attribution": NOTICE}
        elif "region" in properties:
            region = str(properties.pop("region")).casefold()
            properties |= {"region": region} if geometry.geom_type in {"Polygon", "MultiPolygon"} or region in list(Kind) else {}
        drawn = driver in _DRAWINGS
        shown = str(properties.get("layer", layer)) if drawn else layer
        found.append(Feature(shapely.geometry.mapping(geometry), properties, (*labels, str(number)), shown, system, drawn, when))
    return found


def _geometries(shapes: NDArray[np.object_], name: str, layer: str) -> list[Any]:
    missing = sum(shape is None for shape in shapes)
    if missing and missing == len(shapes):
        msg = f"{name}: no feature of layer {layer!r} has a geometry"
        raise RoadError(msg, hint="is the file complete? it may have been cut off, or be encrypted")
    try:
        geometries = shapely.from_wkb(shapes)
    except shapely.errors.ShapelyError as error:
        msg = f"{name}: layer {layer!r} has a geometry that cannot be used: {error}"
        raise RoadError(msg, hint=f"make it plain first: ogr2ogr -nlt CONVERT_TO_LINEAR road.gpkg {name}") from error
    return list(geometries)


def _value(value: Any, title: str) -> object:  # noqa: ANN401 - whatever a database holds
    """Return a field's value as JSON would have it, None where it is missing; widths as numbers."""
    if isinstance(value, np.ndarray):  # of a field that holds several
        return value.tolist()
    if value is None or value != value:  # noqa: PLR0124 - NaN and NaT mean missing
        return None
    plain = value.item() if isinstance(value, np.generic) else value
    if title in _REACHES and isinstance(plain, str):
        try:
            return float(plain.replace(",", "."))
        except ValueError:
            return plain
    return plain


def _sheet(source: _Source, layers: list[tuple[str, str | None, str]], options: RoadOptions) -> Table:
    """Return the table in a spreadsheet: its only sheet, or the one that ``options`` call for."""
    sheets = [layer for layer, _, _ in layers]
    wanted = [sheet for sheet in sheets if options.layer in {None, sheet}]
    if len(wanted) != 1:
        what = "none is chosen" if options.layer is None else f"none is called {options.layer!r}"
        msg = f"{source.path.name}: {len(sheets)} sheets, and {what}: {', '.join(map(repr, sheets))[:200]}"
        raise RoadError(msg, hint="choose one with --layer")
    titles, numbers, _, columns = source.read(wanted[0])
    cells = [["" if _value(value, "") is None else str(_value(value, "")) for value in column] for column in columns]
    rows = [list(row) for row in zip(*cells, strict=True)]
    kept = [(int(number) + 1, row) for number, row in zip(numbers, rows, strict=True) if any(row)]  # line 1 is the header
    return Table(titles, [line for line, _ in kept], [row for _, row in kept])


def _refuse_cut_off(path: Path) -> None:
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 64))
        if b"EOF" not in file.read():
            msg = f"{path.name} is cut off: it lacks the end that drawings have"
            raise RoadError(msg, hint="fetch the file again")


def _drawn_in(path: Path) -> int:
    """Return the unit that a drawing says it is in, its INSUNITS; 0 without any.

    GDAL copies inches without meaning them, from a template that AutoCAD made and that lacks only the time of it.
    """
    with path.open("rb") as file:
        head = file.read(_HEADER_BYTES).decode("latin-1")
    units = _INSUNITS.search(head)
    if units is None:
        return 0
    code = int(units[1] or int.from_bytes(units[2].encode("latin-1"), "little"))
    return 0 if code == _INCHES and "$MENU" in head and "$TDCREATE" not in head else code


def _unreadable(path: Path, reason: str) -> RoadError:
    """Return the refusal of a file that GDAL cannot read, without its source files and our folders."""
    plain = re.sub(r"\S+\.(cpp|h), \d+: ", "", reason.splitlines()[0] if reason else "").replace(str(path), path.name)
    plain = plain.partition("; It might help")[0].rstrip(". ")
    if "not recognized" in plain:
        msg = f"{path.name} is not a vector file that can be read; it may be cut off, encrypted or of another kind"
    elif "malformed" in plain:
        msg = f"{path.name} is damaged or cut off"
    else:
        msg = f"{path.name} cannot be read: {plain}"
    line = re.search(r"error at line (\d+) of .*\.dxf$", plain, re.IGNORECASE)
    if line is not None:  # GDAL's own converter fails at it as well
        return RoadError(
            f"{msg}, {_entity_before(path, int(line[1]))}", hint="in CAD, explode or delete that one, and save the drawing again"
        )
    return RoadError(msg, hint=f"convert it first, such as: {_CONVERT.format(name=path.name)}")


def _entity_before(path: Path, line: int) -> str:
    """Return what a drawing as text calls the last thing that begins before a line of its file, and that thing's layer."""
    lines = [text.strip().decode("latin-1") for text in path.read_bytes().splitlines()[: line - 1]]
    pairs = list(zip(lines[::2], lines[1::2], strict=False))
    first = max((at for at, (code, _) in enumerate(pairs) if code == "0"), default=0)
    layer = next((f" in layer {value!r}" for code, value in pairs[first:] if code == "8"), "")
    return f"in a {pairs[first][1]}{layer}"
