"""What a drawing of a driven manoeuvre holds, layer by layer, in the plane of the manoeuvre."""

from __future__ import annotations

import shapely

from hdvplan.arrays import FloatArray
from hdvplan.judging.result import body_name
from hdvplan.report.dxf import drawing_bytes, how_to_read
from hdvplan.report.layers import SIMPLER_M, Drawn, Layer, Value
from hdvplan.report.placing import System
from hdvplan.report.turns import shown_poses, swept_area, verdict, wheel_tracks
from hdvplan.turning.swept import chart_of
from hdvplan.turning.turn import Turn

_RING_SEGMENTS = 128  # a quarter: on a radius of 15 m chords are off by 0.3 mm


def turn_dxf(turn: Turn) -> bytes:
    """Return the drawing of a manoeuvre [m]: the guided point enters along x, and the turn is to the left."""
    system = System(None, "metres; the turn is to the left, mirror it for one to the right")
    template = turn.template
    notes = [
        verdict(turn),
        *([] if template is None else [f"template: {template.name}; {template.source}"]),
        f"vehicle: {turn.driven.vehicle.name}",
        *how_to_read(system),
    ]
    return drawing_bytes(turn_features(turn), system, notes)


def turn_features(turn: Turn) -> tuple[Drawn, ...]:
    """Return all features of a manoeuvre's drawing, x, y [m]: path, swept areas, the limits' circles, wheel tracks, a few poses."""
    driven, found = turn.driven, [Drawn(Layer.GUIDED_PATH, _line(turn.driven.guide[:, :2]), {"point": str(turn.driven.manoeuvre.point)})]
    units = range(len(driven.vehicle.units))
    named: list[dict[str, Value]] = [{"body": unit + 1, "unit": body_name(driven.vehicle, unit)} for unit in units]
    found += [Drawn(Layer.ENVELOPE, swept_area(driven, unit), named[unit]) for unit in units]
    for limit in turn.limits:
        if limit.name.endswith("radius"):
            ring = shapely.Point(chart_of(driven).centre).buffer(limit.value, quad_segs=_RING_SEGMENTS).exterior
            found.append(Drawn(Layer.LIMITS, ring, {"limit": limit.words, "limit_m": limit.value}))
    found += [Drawn(Layer.TRACKS, _line(track), named[unit] | {"side": side}) for unit, side, track in wheel_tracks(driven)]
    outlines = [(unit, driven.corners(unit)) for unit in units]
    found += [
        Drawn(Layer.VEHICLES, shapely.Polygon(corners[pose]), named[unit]) for pose in shown_poses(driven) for unit, corners in outlines
    ]
    return tuple(found)


def _line(points: FloatArray) -> shapely.LineString:
    """Return a line without the points that it does not need."""
    line = shapely.simplify(shapely.LineString(points), SIMPLER_M, preserve_topology=False)
    assert isinstance(line, shapely.LineString)  # noqa: S101 - a line stays one
    return line
