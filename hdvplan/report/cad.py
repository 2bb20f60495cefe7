"""A drawing as a file: a picture, DXF for CAD, whose polylines lie on layers that can be switched, or GeoPackage for GIS."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

import numpy as np
import shapely
from numpy.typing import NDArray

from hdvplan.judging.bodies import TRACK_NOTE
from hdvplan.report import DRAWINGS
from hdvplan.report.layers import Drawn, Layer, System, drawing_system, map_system
from hdvplan.road.regions import polygons_of
from hdvplan.road.road import Road
from hdvplan.texts import printable
from hdvplan.version import __version__

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts.layout import Modelspace
    from matplotlib.figure import Figure

_NOWHERE = 'LOCAL_CS["metres of the road file",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'  # of a GeoPackage
_VERSION = "R2010"
_TEXT_M = 0.5  # height of what is written beside places
_NOTES_SHARE, _NOTES_M = 1.0 / 120.0, (0.8, 20.0)  # height of the notes: of the drawing's larger side, and within these [m]
_BODIES_ACI = (150, 30, 92, 213)  # blue, orange, green, magenta as in the pictures, to be seen on white and on black
_NOTES = "NOTES"

_LOOKS: dict[Layer, tuple[int, str, int]] = {  # colour index, linetype and line width [mm / 100]
    Layer.ROAD: (8, "CENTER", 25),
    Layer.OBSTACLES: (34, "CONTINUOUS", 35),
    Layer.SWEEPABLE: (53, "DASHED", 25),
    Layer.KERBS: (7, "CONTINUOUS", 50),
    Layer.LIMITS: (7, "CONTINUOUS", 50),
    Layer.TRACKS: (9, "DASHED2", 18),
    Layer.CLEARANCE: (4, "CONTINUOUS", 18),
    Layer.CONFLICTS: (1, "CONTINUOUS", 70),
    Layer.GUIDED_PATH: (8, "CENTER", 25),
    Layer.WIDENING: (1, "CONTINUOUS", 50),
    Layer.WIDENING_LEAST_DEPTH: (6, "DASHED", 35),
}
_HATCHED = (Layer.CONFLICTS, Layer.WIDENING)


def drawing_bytes(
    kind: str, figure: Callable[[], Figure], features: Callable[[], Sequence[Drawn]], notes: Sequence[str], where: Road | System
) -> bytes:
    """Return a file of one of ``PICTURES``, of ``figure``, or of ``DRAWINGS``, of ``features`` under the lines ``notes``.

    These are in the coordinate system ``where``, that of a road or one that suits the kind.
    """
    if kind not in DRAWINGS:
        from hdvplan.report.style import figure_bytes  # noqa: PLC0415 - Matplotlib, GDAL and ezdxf take a while to import

        return figure_bytes(figure(), kind)
    if kind == "gpkg":
        return geopackage_bytes(features(), where if isinstance(where, System) else map_system(where))
    system, notice = (where, None) if isinstance(where, System) else (drawing_system(where), where.notice)
    return dxf_bytes(features(), system, notes, notice)


def dxf_bytes(features: Sequence[Drawn], system: System, notes: Sequence[str], notice: str | None = None) -> bytes:
    """Return a drawing of ``features`` in ``system``, with the lines ``notes`` above everything else.

    Below them stands what coordinates and wheel tracks are, who drew them, and the ``notice`` of the road's source.
    ``$INSUNITS`` is metres. Areas are closed polylines, holes too; every body has separate layers.
    """
    from ezdxf import units  # noqa: PLC0415 - as above
    from ezdxf.filemanagement import new  # noqa: PLC0415 - as above

    how_to_read = [f"coordinates: {system.note}", f"wheel tracks: {TRACK_NOTE}", f"hdvplan {__version__}"]
    document = new(_VERSION, setup=True)
    document.units = units.M
    document.header["$MEASUREMENT"] = 1
    document.header["$LUNITS"] = 2
    document.header.custom_vars.append("hdvplan", __version__)
    document.header.custom_vars.append("coordinates", system.note)
    space = document.modelspace()
    for feature in features:
        _draw(document, space, feature, system)
    left, low, right, high = map(float, shapely.total_bounds([system.place(feature.geometry) for feature in features]))
    height = min(max(_NOTES_SHARE * max(right - left, high - low), _NOTES_M[0]), _NOTES_M[1])
    document.layers.add(_NOTES, color=7)
    lines = [_plain(line) for line in (*notes, *how_to_read, *filter(None, [notice]))]
    text = space.add_mtext("\\P".join(lines), dxfattribs={"layer": _NOTES, "char_height": height})
    text.set_location((left, high + 2.0 * height), attachment_point=7)  # its lower left corner
    buffer = StringIO()
    document.write(buffer)
    return document.encode(buffer.getvalue())


def _draw(document: Drawing, space: Modelspace, feature: Drawn, system: System) -> None:
    from ezdxf.enums import TextEntityAlignment  # noqa: PLC0415 - as above

    layer = _layer(document, feature)
    placed = system.place(feature.geometry)
    if isinstance(placed, shapely.LineString):
        space.add_lwpolyline(placed.coords, dxfattribs={"layer": layer})
        where = np.mean(placed.coords, axis=0)
    else:
        polygons = polygons_of(placed)
        for polygon in polygons:
            for ring in (polygon.exterior, *polygon.interiors):
                space.add_lwpolyline(ring.coords[:-1], close=True, dxfattribs={"layer": layer})
        if feature.layer in _HATCHED:
            hatch = space.add_hatch(dxfattribs={"layer": layer})
            for polygon in polygons:
                hatch.paths.add_polyline_path(list(polygon.exterior.coords), is_closed=True)
        where = np.array(placed.representative_point().coords[0])
    if feature.label:
        text = space.add_text(_literal(feature.label), height=_TEXT_M, dxfattribs={"layer": layer})
        text.set_placement(tuple(where), align=TextEntityAlignment.MIDDLE_LEFT)


def _layer(document: Drawing, feature: Drawn) -> str:
    """Return the name of a feature's layer, which is made when it is first needed.

    Bodies have their own, numbered from the front, and of several legs those that are driven forward and backward.
    """
    name, look = feature.layer.upper(), _LOOKS.get(feature.layer)
    if look is None:  # of one body
        body = int(feature.properties["body"] or 0)
        name = f"{name}_{body}_{re.sub('[^A-Z0-9]+', '_', str(feature.properties['unit']).upper())}"
        look = (_BODIES_ACI[(body - 1) % len(_BODIES_ACI)], "CONTINUOUS", 35 if feature.layer is Layer.ENVELOPE else 25)
    if "direction" in feature.properties:
        name = f"{name}_{str(feature.properties['direction']).upper()}"
    if name not in document.layers:
        colour, linetype, width = look
        document.layers.add(name, color=colour, linetype=linetype, lineweight=width)
    return name


def _plain(line: str) -> str:
    return re.sub(r"([\\{}])", r"\\\1", _literal(line))


def _literal(line: str) -> str:
    """Return a line without what TEXT reads as a command: carets and percent signs are spaced, control signs are numbers."""
    return printable(line).replace("^", "^ ").replace("%%", "% %")


def geopackage_bytes(features: Sequence[Drawn], system: System) -> bytes:
    """Return a GeoPackage, for QGIS and other map programs, of ``features`` in ``system``; layers without any are left out.

    Areas are MultiPolygons.
    """
    import pyogrio  # noqa: PLC0415 - as above

    with TemporaryDirectory() as folder:
        path = Path(folder) / "plan.gpkg"
        for layer in Layer:
            of_layer = [feature for feature in features if feature.layer is layer]
            if not of_layer:
                continue
            fields, lines = list(of_layer[0].properties), isinstance(of_layer[0].geometry, shapely.LineString)
            places = [system.place(feature.geometry) for feature in of_layer]
            shapes = places if lines else [shapely.MultiPolygon(polygons_of(place)) for place in places]
            pyogrio.raw.write(
                path,
                shapely.to_wkb(np.array(shapes, dtype=object)),
                [_column(of_layer, name) for name in fields],
                fields,
                layer=str(layer),
                driver="GPKG",
                crs=system.name or _NOWHERE,
                geometry_type="LineString" if lines else "MultiPolygon",
                append=path.exists(),
                layer_metadata={"coordinates": system.note},
            )
        return path.read_bytes()


def _column(features: Sequence[Drawn], name: str) -> NDArray[np.generic]:
    """Return a property of all features of a layer: numbers, with NaN where there is none, or words."""
    values = [feature.properties[name] for feature in features]
    if all(isinstance(value, int) for value in values):
        return np.array(values, dtype=np.int64)
    if all(isinstance(value, float | None) for value in values) and any(value is not None for value in values):
        return np.array([np.nan if value is None else value for value in values])
    return np.array(values, dtype=object)
