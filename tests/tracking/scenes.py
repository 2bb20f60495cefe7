"""Streets that a body can meet in every way: kerbs along bends, sharp corners, noses, obstacles, and kerbs that bind wheels alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import shapely

import hdvplan
from hdvplan.arrays import FloatArray
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.limits import Limits
from hdvplan.road.path import from_curvature
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region
from hdvplan.road.road import Road

RADIUS_M, BEFORE_M, AFTER_M = 14.0, 60.0, 60.0  # of the junction's line: straight, to the left, straight


@dataclass(frozen=True)
class Scene:
    """A road, the vehicle that drives it, and what its bodies and its wheels must stay within, and out of, in the plane."""

    road: Road
    vehicle: str
    bodies: shapely.Polygon
    wheels: shapely.Polygon
    obstacles: tuple[shapely.Polygon, ...] = ()


def _line(name: str) -> Road:
    turn = 0.5 * np.pi * RADIUS_M
    s = np.array([0.0, BEFORE_M, BEFORE_M + 1.0, BEFORE_M + turn, BEFORE_M + turn + 1.0, BEFORE_M + turn + 1.0 + AFTER_M])
    return Road(name, from_curvature(s, np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0]) / RADIUS_M))


def _between(left: FloatArray, right: FloatArray) -> shapely.Polygon:
    return shapely.Polygon(np.concatenate([left, right[::-1]]))


def junction(vehicle: str, width: float, nose: float = 0.0) -> Scene:
    """Return a turn between kerbs with one sharp corner each, the inner one protruding; ``nose`` narrows the street beyond it."""
    road = _line("junction")
    last = road.path.at(np.array([road.path.length]))
    end_x, end_y = float(last.x[0]), float(last.y[0])
    middle, half = BEFORE_M + 0.5 + 0.25 * np.pi * RADIUS_M, 0.5 * width
    inner = [(0.0, half), (end_x - half, half), (end_x - half, end_y)]
    outer = [(0.0, -half), (end_x + half, -half), (end_x + half, end_y)]
    s_inner = s_outer = [0.0, middle, road.path.length]
    if nose:
        inner[2:2] = [(end_x - half, 35.0), (end_x - half + nose, 36.0), (end_x - half, 37.0)]
        s_inner = [0.0, middle, *(road.path.length - end_y + np.array([35.0, 36.0, 37.0])), road.path.length]
    kerbs = (Kerb(np.array(inner), np.array(s_inner), True), Kerb(np.array(outer), np.array(s_outer), False))
    drawn = Road("junction", road.path, Limits.constant(half, half, road.path.length), drawn=kerbs)
    street = _between(kerbs[0].points, kerbs[1].points)
    return Scene(drawn, vehicle, street, street)


def along(vehicle: str, half: float, sweep: float = 0.0, obstacles: tuple[shapely.Polygon, ...] = ()) -> Scene:
    """Return a turn between kerbs beside its line; overhangs may reach ``sweep`` further, and obstacles are left out."""
    road, s = _line("bend"), np.linspace(0.0, 200.0, 1001)
    s = s[s < road.path.length]
    ones = np.ones(len(s))
    limits = Limits(s, half * ones, -half * ones, (half + sweep) * ones, -(half + sweep) * ones)
    regions = tuple(Region(Kind.OBSTACLE, obstacle, f"o{number}") for number, obstacle in enumerate(obstacles))
    road = Road("bend", road.path, limits, regions=regions)
    sides = [np.stack(road.path.to_plane(s, sign * ones), axis=1) for sign in (half, -half, half + sweep, -half - sweep)]
    return Scene(road, vehicle, _between(*sides[2:]), _between(*sides[:2]), obstacles)


SCENES = {
    "a bend": along("tractor-trailer", 3.3),
    "wheels' own kerbs": along("bus", 3.0, 0.4),
    "obstacles in a bend": along("bus", 3.5, 0.0, (shapely.box(40.0, 1.9, 44.0, 3.5), shapely.Point(74.0, 6.0).buffer(0.8, 2))),
    "sharp corners": junction("bus", 8.0),
    "sharp corners and a nose": junction("semitrailer-steered", 9.5, 0.8),
}


def case_of(scene: Scene) -> hdvplan.Case:
    """Return the case that plans a scene, with some room to err."""
    return hdvplan.Case(scene.road, hdvplan.load_vehicle(scene.vehicle), settings=PlannerSettings(clearance=0.25))
