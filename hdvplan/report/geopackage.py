"""A plan as a GeoPackage: one layer of features for every layer of the drawing, for QGIS and other map programs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyogrio
import shapely
from numpy.typing import NDArray

from hdvplan.report.layers import Drawn, Layer, System
from hdvplan.road.regions import polygons_of

_NOWHERE = 'LOCAL_CS["metres of the road file",UNIT["metre",1],AXIS["x",EAST],AXIS["y",NORTH]]'


def geopackage_bytes(features: Sequence[Drawn], system: System) -> bytes:
    """Return a GeoPackage of ``features`` in ``system``; areas are MultiPolygons. Layers without features are left out."""
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
