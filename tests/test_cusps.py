"""Legs that are driven past their drawn cusps, or stop short of them, where these lack room."""

import numpy as np
import pytest
import shapely

from hdvplan.legs import past, plan_legs
from hdvplan.road.legs import Leg, Legs
from hdvplan.road.load_legs import within
from hdvplan.road.path import from_curvature
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road
from hdvplan.vehicle.load import load_vehicle

STRAIGHT = from_curvature([0.0, 20.0], [0.0, 0.0])
BOTH = Legs("back and forth", (Leg(Road("out", STRAIGHT), False), Leg(Road("back", STRAIGHT), True)))


def bend(wall_m: float) -> Legs:
    """Return a bend that is driven and backed along again, and a wall so far beyond its end."""
    path = from_curvature([0.0, 12.0, 16.0, 26.0], [0.0, 0.0, 0.06, 0.06])
    end = path.at(path.length)
    ahead, left = np.array([np.cos(end.heading), np.sin(end.heading)]), np.array([-np.sin(end.heading), np.cos(end.heading)])
    centre = np.array([float(end.x), float(end.y)]) + wall_m * ahead
    wall = Region(
        Kind.OBSTACLE, shapely.Polygon([centre - 9 * left, centre + 9 * left, centre + 9 * left + ahead, centre - 9 * left + ahead]), "wall"
    )
    return Legs("bend", tuple(within(Leg(Road("bend", path), backward), (wall,)) for backward in (False, True)), (), (wall,))


def test_a_cusp_past_the_drawn_one_lengthens_both_of_its_legs_and_moves_nothing_else() -> None:
    for by in (1.5, -1.5):
        first, second = past(BOTH, np.array([by])).legs
        assert first.road.path.length == second.road.path.length == pytest.approx(20.0 + by, abs=1e-9)
        for leg in (first, second):
            end = leg.road.path.at(leg.road.path.length)
            assert float(end.x) == pytest.approx(20.0 + by, abs=1e-6)
            assert float(leg.road.path.at(0.0).x) == pytest.approx(0.0, abs=1e-6)


def test_where_the_drawn_cusp_leaves_no_room_to_a_wall_the_legs_stop_short_of_it() -> None:
    truck = load_vehicle("rigid-truck")
    legs = bend(truck.lead.front - 0.4)  # the front would stand in the wall
    drawn = plan_legs(legs, truck, refine=False)
    assert drawn.fits is False
    assert drawn.past == ()
    moved = plan_legs(legs, truck)
    assert moved.fits
    assert -8.0 <= moved.past[0] < -0.3  # as far as legs may stop short; as far as they lack room, but for what planning finds beside it
    assert moved.room > drawn.room


def test_a_single_leg_has_no_cusp_to_move() -> None:
    narrow = Road("back", STRAIGHT).with_limits(1.0, 1.0)
    assert plan_legs(Legs("back", (Leg(narrow, True),)), load_vehicle("rigid-truck")).past == ()


def test_a_plan_that_fits_is_along_the_drawn_cusps() -> None:
    truck = load_vehicle("rigid-truck")
    assert plan_legs(bend(truck.lead.front + 3.0), truck).past == ()
