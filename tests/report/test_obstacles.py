from __future__ import annotations

from dataclasses import replace

import pytest
import shapely

from hdvplan.judging.obstacles import approaches
from hdvplan.judging.result import Result
from hdvplan.road.regions import Kind, Region


def test_the_nearest_approach_is_told_for_every_obstacle(straight: Result) -> None:
    beside = Region(Kind.OBSTACLE, shapely.box(40.0, 2.0, 42.0, 3.0))
    hit = Region(Kind.OBSTACLE, shapely.box(50.0, -3.0, 51.0, -1.0))
    kerb = Region(Kind.SWEEPABLE, shapely.box(40.0, 0.0, 42.0, 3.0))
    road = replace(straight.drive.road, regions=(beside, hit, kerb))
    near, touched = approaches(replace(straight.drive, road=road))
    assert near.distance == pytest.approx(2.0 - 1.27, abs=1e-6)  # a bus on the centre line of a straight, 2.54 m wide
    assert 40.0 - 9.34 - 0.25 <= near.s <= 42.0 + 2.66 + 0.25  # a bus reaches 9.34 m ahead of its axle and 2.66 m behind
    assert touched.distance == pytest.approx(-0.27, abs=1e-6)  # 1.27 m to the side, less 1 m
    assert approaches(straight.drive) == ()
