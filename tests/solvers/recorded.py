"""Planning's own programs, recorded while driving roads whose limits bind."""

from dataclasses import replace

import numpy as np

from hdvplan.driving.drive import drive
from hdvplan.errors import PlanError
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.qp.program import StageQp
from hdvplan.road.limits import Limits
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle
from tests.core.spying import Spy

# A bus needs 2.49 m on either side of this U-turn, a tractor-trailer 2.79 m.
COURSES = (("bus", 2.6), ("bus", 2.48), ("bus", 2.2), ("tractor-trailer", 2.9), ("tractor-trailer", 2.7))
PINCHED = (("bus", 3.2), ("tractor-trailer", 3.8))


def pinched(half_width: float) -> Road:
    """Return the U-turn with 1.5 m less on the right over six metres in its bend."""
    road = SCENARIOS["uturn"]()
    s = np.array([0.0, 89.75, 90.0, 96.0, 96.25, road.path.length])
    left = np.full(s.size, half_width)
    right = -left + 1.5 * np.array([0.0, 0.0, 1.0, 1.0, 0.0, 0.0])
    return replace(road, limits=Limits(s, left, right, left, right))


def uturn(half_width: float) -> Road:
    """Return the U-turn of the first paper between parallel limits."""
    return SCENARIOS["uturn"]().with_limits(half_width, half_width)


def record(road: Road, vehicle: str, settings: PlannerSettings | None = None) -> list[StageQp]:
    """Return every program of a drive; one that ends early has recorded what it had to solve until there."""
    spy = Spy(RiccatiWorkspace)
    try:
        drive(road, load_vehicle(vehicle), geometric, spy, settings or PlannerSettings())
    except PlanError:
        assert spy.programs
    return spy.programs
