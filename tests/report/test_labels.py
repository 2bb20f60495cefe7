"""Labels beside places on maps: they cover neither bodies nor kerbs, least of all where these come closest."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import shapely
from matplotlib.figure import Figure
from matplotlib.text import Text

from hdvplan.judging.bodies import corners
from hdvplan.judging.result import Result, result_of
from hdvplan.report.layers import Layer, drawn_features
from hdvplan.report.maps import UNTURNED, Turn
from hdvplan.report.paper import SheetOptions, map_mm, pages_of
from hdvplan.report.plots import plan_figure
from hdvplan.report.rooms import Room, pose_touching, tightest_windows
from hdvplan.report.sheet import sheet_bytes
from hdvplan.report.sheetmap import places_of
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from tests.report.conftest import driven


@pytest.fixture(scope="module", params=[1.0, -1.0], ids=["left", "right"])
def bend(request: pytest.FixtureRequest) -> Result:
    """A bus in a quarter turn between kerbs, on a road of 155 m whose other half runs up or down: beside it texts are wider than high."""
    s, kappa = np.array([0.0, 55.0, 60.0, 78.0, 83.0, 155.0]), request.param * np.array([0.0, 0.0, 0.07, 0.07, 0.0, 0.0])
    free = driven(Road("bend", from_curvature(s, kappa)), "bus")
    half = 0.1 + max(float(np.max(free.envelope.reach_left)), -float(np.min(free.envelope.reach_right)))
    return result_of(replace(free.drive, road=free.drive.road.with_limits(half, half)), solver="riccati", objective="geometric")


def labels_in(figure: Figure, text: str) -> Iterator[shapely.Polygon]:
    """Yield what a text covers, in the metres of its axes."""
    figure.draw_without_rendering()
    for axes in figure.axes:
        for written in axes.texts:
            if written.get_text() == text:
                yield shapely.box(*Text.get_window_extent(written).transformed(axes.transData.inverted()).extents)


def assert_free(box: shapely.Polygon, result: Result, room: Room, turned: Turn) -> None:
    """Fail where a text covers a kerb, a body or what is swept, or is far from its place."""
    shown = [shapely.make_valid(one.geometry) for one in drawn_features(result) if one.layer in {Layer.LIMITS, Layer.ENVELOPE}]
    bodies = shapely.polygons(corners(result.drive, np.array([pose_touching(result, room)]))[0])
    for geometry in (*shown, *bodies, shapely.LineString(room.ends)):
        assert not box.intersects(shapely.transform(geometry, turned))
    assert box.distance(shapely.transform(shapely.Point(room.beyond), turned)) < 5.0


def test_the_room_is_written_beside_the_place_in_pictures(bend: Result) -> None:
    rooms = [window.room for window in tightest_windows(bend)]
    assert rooms
    for room in rooms:
        assert room is not None
        assert not room.broken
        found = list(labels_in(plan_figure(bend), f"{-room.depth:.2f} m"))
        assert found
        for box in found:
            assert_free(box, bend, room, UNTURNED)


def test_the_room_is_written_beside_the_place_on_sheets(figures: list[Figure], bend: Result) -> None:
    options = SheetOptions("a3")
    sheet_bytes(bend, options)
    (page,), (figure,) = pages_of(bend, map_mm(options), None), figures
    for _, room in places_of(bend, page, map_mm(options), 1):
        found = list(labels_in(figure, room.text))
        assert found
        for box in found:
            assert_free(box, bend, room, page.turned)
