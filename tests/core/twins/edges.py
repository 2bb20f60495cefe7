"""The tightest places of a body's edges and their rows, see ``core/edges.c``."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from hdvplan.arrays import FloatArray, Records
from hdvplan.planning.stations import LimitTable, Stations
from tests.core.twins.kinematics import body_point, gradient
from tests.core.twins.path import PLANNING_STEP_M, Record, project
from tests.core.twins.screening import CLEAR

WALL = 1.0  # slope of a limit from which on it is a wall


def limit_at(table: LimitTable, row: int, s: float) -> tuple[float, float]:
    """Return a limit and its slope: linear between the table's entries, constant beyond them."""
    values, place = table.values[row], (s - table.s_first) / table.spacing
    value, last = float(np.interp(place, np.arange(len(values)), values)), len(values) - 1
    if not 0.0 <= place <= last:
        return value, 0.0
    index = min(int(place), last - 1)
    return value, float(values[index + 1] - values[index]) / table.spacing


@dataclass
class Place:
    """A place on an edge: ahead of the axle, in the plane, its foot (s, offset, cos, sin, curvature), and its limit."""

    ahead: float
    at: FloatArray
    foot: FloatArray
    slope: float
    gap: float


@dataclass(frozen=True)
class Edge:
    """One edge of one body at one stage: ``axles`` are all units' poses there."""

    units: Records
    stations: Stations
    station: Record
    axles: FloatArray
    unit: int
    side: int
    points: Records
    margin: float

    @property
    def sign(self) -> float:
        """1 left, -1 right."""
        return 1.0 - 2.0 * self.side

    def look(self, ahead: float, region: int, near: float) -> Place:
        """Return all about the place so far ahead of the axle."""
        at = body_point(self.axles[self.unit], ahead, self.sign * self.units[self.unit]["half_width"])
        foot = project(self.stations.path, float(at[0]), float(at[1]), near, PLANNING_STEP_M)
        limit, slope = limit_at(self.stations.limits, self.side + 2 * region, foot[0])
        return Place(ahead, at, foot, slope if abs(slope) < WALL else 0.0, self.sign * (limit - foot[1]))

    def between(self, places: list[Place]) -> Place | None:
        """Return the tightest place between two sampled points, if it is tighter than both."""
        table, least, found = self.stations.limits, np.inf, None
        for number, (own, next_one) in enumerate(pairwise(places)):
            region = max(self.points["overhang"][number : number + 2])
            rise, length = next_one.foot[1] - own.foot[1], next_one.ahead - own.ahead
            k = 0.5 * (own.foot[4] + next_one.foot[4])
            bow = 0.5 * k / (1.0 - k * own.foot[1]) * length**2
            looked: list[tuple[float, int, float]] = []  # part of the way, entry of the table, gap
            if self.station["varies"] == 0.0:
                if self.sign * bow > abs(rise):
                    part = 0.5 + 0.5 * rise / bow
                    looked.append((part, -1, own.gap - self.sign * (part * rise + part * (1.0 - part) * bow)))
            else:
                grid = table.s_first + table.spacing * np.arange(table.values.shape[1])
                for entry in map(int, np.flatnonzero((grid >= own.foot[0]) & (grid <= next_one.foot[0]))):
                    part = (grid[entry] - own.foot[0]) / (next_one.foot[0] - own.foot[0])
                    beside = own.foot[1] + part * rise + part * (1.0 - part) * bow
                    looked.append((part, entry, self.sign * (table.values[self.side + 2 * region, entry] - beside)))
            for part, entry, gap in looked:
                if gap < min(least, own.gap, next_one.gap):
                    least, found = gap, (own.ahead + part * length, region, own.foot[0], entry)
        return None if found is None else self.look_between(*found)

    def look_between(self, ahead: float, region: int, near: float, entry: int) -> Place:
        """Return that place, whose limit counts as running like the edge."""
        place, table, (_, _, cos, sin) = self.look(ahead, region, near), self.stations.limits, self.axles[self.unit]
        s, offset, road_cos, road_sin, k = place.foot
        place.slope = (1.0 - k * offset) * (sin * road_cos - cos * road_sin) / (cos * road_cos + sin * road_sin)
        if entry >= 0:
            beyond = table.s_first + entry * table.spacing - s
            place.gap = self.sign * (table.values[self.side + 2 * region, entry] - offset - place.slope * beyond)
        return place

    def row(self, place: Place, slope: float, n: int) -> FloatArray:
        """Return g of the row that keeps a place inside a limit of that slope."""
        _, offset, cos, sin, k = place.foot
        normal = np.array([-self.station["sin"], self.station["cos"]])
        across, along = (
            gradient(self.units, self.axles, self.unit, place.at, normal, direction, n)
            for direction in (np.array([-sin, cos]), np.array([cos, sin]))
        )
        g: FloatArray = self.sign * (across - slope / (1.0 - k * offset) * along)
        return g

    def written(self, feet: FloatArray, g: FloatArray, h: FloatArray) -> tuple[float, float]:
        """Write the rows g, h of the edge, and ``feet`` of its points; return its gap, and its clearance to the wheels' limit, too."""
        places = [self.look(point["ahead"], point["overhang"], near) for point, near in zip(self.points, feet, strict=True)]
        feet[:] = [place.foot[0] for place in places]
        more = self.between(places)
        everything, middle = [*places, *([more] if more else [])], 0.5 * (places[0].ahead + places[-1].ahead)
        gap = clear = min(place.gap for place in everything)
        for half in range(2):
            own = [places[-half]] + [place for place in everything if (place.ahead > middle) == (half == 1)]
            pick = min(own, key=lambda place: place.gap)
            g[half], h[half] = self.row(pick, pick.slope, g.shape[1]), pick.gap - self.margin
        for end in range(len(h) - 2):
            place, number = places[-end], 2 + end
            g[number], h[number] = 0.0, CLEAR
            if self.points["overhang"][-end]:
                limit, slope = limit_at(self.stations.limits, self.side, place.foot[0])
                h[number] = self.sign * (limit - place.foot[1])
                g[number], clear = self.row(place, slope, g.shape[1]), min(clear, h[number])
        return gap, clear
