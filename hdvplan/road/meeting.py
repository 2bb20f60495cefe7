"""What another plan swept on the same street, read from its file: an obstacle for the vehicle that meets it."""

from __future__ import annotations

from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import shapely
from shapely.geometry import shape

from hdvplan.answers import NO
from hdvplan.errors import OptionError
from hdvplan.fileio import read_json
from hdvplan.road.crs import LONLAT, IntoPlane, ToLonLat
from hdvplan.road.passages import Line
from hdvplan.road.regions import OPEN_M, Kind, Region, distances, polygons_of
from hdvplan.road.road import Road

_SWEPT = "swept.geojson"
_AREA = "swept area"  # a kind of feature there


def beside_swept(road: Road, folder: Path, between: tuple[float, float] | None = None) -> Road:
    """Return a road on which everything that the plan in ``folder`` swept is an obstacle, with a note if that plan breaks its limits.

    Where the other vehicle stays ``between`` two arclengths of the road [m] until this one has passed, only what it swept there is one.

    Raises:
        OptionError: the folder holds no swept areas, or they lie in another frame than the road, or not beside it or that stretch.

    """
    name = folder.resolve().name
    try:
        features = read_json(folder / _SWEPT)["features"]
        swept = [feature for feature in features if feature["properties"].get("kind") == _AREA]
        area = shapely.union_all([shape(feature["geometry"]) for feature in swept])
        named = swept[0]["properties"]
        label, on_earth = f"{named['vehicle']}, plan {name}", "note" not in named
    except (OSError, ValueError, LookupError, TypeError, AttributeError, shapely.errors.ShapelyError) as error:
        msg = f"{folder} has no {_SWEPT} with the area that a plan swept"
        raise OptionError(
            msg, hint="plan the other vehicle first, `hdvplan plan ROAD --vehicle OTHER --out other`, then this one with `--beside other`"
        ) from error
    into = IntoPlane(LONLAT, road.to_lonlat.plane) if isinstance(road.to_lonlat, ToLonLat) else None
    if on_earth != (into is not None):
        msg = f"what {label} swept is in {'degrees' if on_earth else 'metres'}, and {road.name} is not"
        raise OptionError(msg, hint="plan both from the same road file")
    area = area if into is None else shapely.transform(area, into)
    where, told = road.name, name
    if between is not None:
        s_from, s_to = _stretch(between, road.path.length, folder)
        area = shapely.intersection(area, shapely.buffer(Line.of(road.path).between(s_from, s_to), OPEN_M, cap_style="flat"))
        stretch = f"between s = {s_from:z.1f} and {s_to:z.1f} m"
        where, told = f"{road.name} {stretch}", f"{name}, which stays {stretch} until this one has passed"
    regions = tuple(Region(Kind.OBSTACLE, polygon, label, plan=told) for polygon in polygons_of(area))
    beside = tuple(region for region, apart in zip(regions, distances(road.path, regions), strict=True) if apart <= OPEN_M)
    if not beside:
        msg = f"what {label} swept lies more than {OPEN_M:.0f} m from {where}"
        raise OptionError(msg, hint="plan both from the same road file")
    return replace(road, regions=(*road.regions, *beside), faces=None, notes=(*road.notes, *broken_notes(folder)))


def _stretch(between: tuple[float, float], length: float, folder: Path) -> tuple[float, float]:
    """Return where on a road of this ``length`` the vehicle of the plan in ``folder`` waits [m].

    Raises:
        OptionError: that is beyond the road, or shorter than the vehicle, or nothing says how long this is.

    """
    s_from, s_to = (float(s) for s in np.clip(between, 0.0, length))
    if s_from >= s_to:
        msg = f"the two meet between s = {between[0]:z.1f} and {between[1]:z.1f} m, and the road is {length:.1f} m long"
        raise OptionError(msg)
    try:
        bodies = read_json(folder / "summary.json")["bodies"]
        behind = sum(ahead["hitch_offset_m"] + body["wheelbase_m"] for ahead, body in pairwise(bodies))
        own = bodies[0]["front_m"] + behind + bodies[-1]["rear_m"]
    except (OSError, ValueError, LookupError, TypeError) as error:
        msg = f"{folder} has no summary.json that says how long the other vehicle is"
        raise OptionError(msg, hint="plan the other vehicle again") from error
    if s_to - s_from < own:
        msg = f"the two meet within {s_to - s_from:.1f} m of the road, and the other vehicle is {own:.1f} m long"
        raise OptionError(msg, hint="a longer stretch holds it")
    return s_from, s_to


def broken_notes(folder: Path) -> tuple[str, ...]:
    """Return a note where the plan in ``folder`` does not keep its own limits."""
    with suppress(OSError, ValueError, LookupError, TypeError):  # of a folder that is none, and of older files
        verdict = read_json(folder / "summary.json")["verdict"]
        if verdict["word"] == NO:
            return (f"the plan in {folder} does not keep its own limits: {verdict['text']}",)
    return ()
