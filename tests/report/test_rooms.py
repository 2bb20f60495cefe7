from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import shapely

from hdvplan.answers import room_text
from hdvplan.arrays import FloatArray, IntArray
from hdvplan.driving.drive import Drive
from hdvplan.judging.bodies import corners
from hdvplan.judging.result import Result, result_of
from hdvplan.judging.verdict import verdict_of
from hdvplan.report.compared import answer_of
from hdvplan.report.layers import drawn_features
from hdvplan.report.rooms import breach_place, pose_touching, room_at, tightest_windows, tightness
from hdvplan.road.regions import Kind, Region


def beside_a_van(straight: Result, y: float) -> Result:
    """Return the straight drive, 1.27 m to either side, with a van whose side lies at ``y`` [m]."""
    road = replace(straight.drive.road, regions=(Region(Kind.OBSTACLE, shapely.box(40.0, y, 45.0, y + 2.0), "van"),))
    drive = replace(straight.drive, road=replace(road.within(straight.drive.road.limits)))
    return result_of(drive, solver="piqp", objective="geometric")


@pytest.mark.parametrize("name", ["bus", "kerbed", "straight", "near", "hit"])
def test_the_tightest_place_has_the_verdict_s_number(name: str, straight: Result, request: pytest.FixtureRequest) -> None:
    made = {"near": 1.5, "hit": 1.0}
    result = beside_a_van(straight, made[name]) if name in made else request.getfixturevalue(name)
    room, verdict = room_at(result, int(np.argmax(tightness(result)))), verdict_of(result)
    assert -room.depth == pytest.approx(verdict.spare, abs=1e-9)  # the same doubles, added in another order
    assert room.s == pytest.approx(verdict.s, abs=1e-9)
    assert room.broken == (verdict.fits is False)
    assert room.obstacle == ("van" if name in made else None)
    if not room.broken:
        assert np.hypot(*(room.ends[1] - room.ends[0])) == pytest.approx(-room.depth, abs=1e-6)


@pytest.mark.parametrize("name", ["trailer", "kerbed"])
def test_what_is_enlarged_is_named_by_the_tightest_place_in_it(name: str, request: pytest.FixtureRequest) -> None:
    result: Result = request.getfixturevalue(name)
    score, s = tightness(result), result.envelope.s
    for window in tightest_windows(result):
        assert window.room is not None
        depth = window.room.depth if window.room.limited else -window.room.depth  # without limits it is less the reach
        assert depth == pytest.approx(np.max(score[(s >= window.s_from) & (s <= window.s_to)]))


def test_a_comparison_of_vehicles_that_fit_has_no_negative_room(straight: Result) -> None:
    touching = beside_a_van(straight, 1.265)
    assert -0.01 < (verdict_of(touching).spare or 0.0) < 0.0  # limits are kept to 1 cm
    assert answer_of((touching,)).endswith(f"; {room_text(0.0, fits=True)} for the bus")


def test_a_van_that_is_hit_is_drawn_where_it_was_hit(straight: Result) -> None:
    result = beside_a_van(straight, 1.0)
    (breach,) = result.balance.breaches
    s, offset = breach_place(result, breach)
    assert 40.0 <= s <= 45.0 + 1e-9  # rounding of doubles
    assert 1.0 <= offset <= 1.275  # the bus keeps straight to a millimetre
    (conflict,) = [feature for feature in drawn_features(result) if feature.layer == "conflicts"]
    assert conflict.properties["obstacle"] == "van"
    assert conflict.geometry.area == pytest.approx(5.0 * 0.27, rel=0.01)  # likewise


def test_however_many_vans_are_hit_the_bodies_are_placed_once(straight: Result, monkeypatch: pytest.MonkeyPatch) -> None:
    vans = [shapely.box(s, 1.0, s + 1.0, 3.0) for s in np.arange(10.0, 70.0, 4.0)]
    regions = tuple(Region(Kind.OBSTACLE, van, str(number)) for number, van in enumerate(vans))
    road = replace(straight.drive.road, regions=regions).within(straight.drive.road.limits)
    result = result_of(replace(straight.drive, road=road), solver="piqp", objective="geometric")
    calls: list[IntArray] = []

    def counted(drive: Drive, numbers: IntArray) -> FloatArray:
        calls.append(numbers)
        return corners(drive, numbers)

    monkeypatch.setattr("hdvplan.judging.result.corners", counted)
    conflicts = [feature for feature in drawn_features(result) if feature.layer == "conflicts"]
    assert len(calls) == 1  # once for each takes minutes where there are thousands
    assert {feature.properties["obstacle"] for feature in conflicts} == {str(number) for number in range(len(vans))}
    for feature in conflicts:
        assert vans[int(str(feature.properties["obstacle"]))].buffer(1e-9).contains(feature.geometry)


def test_the_vehicle_stands_where_it_is_tightest(kerbed: Result) -> None:
    room = room_at(kerbed, int(np.argmax(tightness(kerbed))))
    (bodies,) = corners(kerbed.drive, np.array([pose_touching(kerbed, room)]))
    # The touch lies between two poses, which are 0.25 m apart: the nearer one is off by half of that at most.
    assert shapely.distance(shapely.Polygon(bodies[room.unit]).exterior, shapely.Point(room.ends[0])) < 0.125
