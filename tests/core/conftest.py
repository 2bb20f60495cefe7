from collections.abc import Callable
from functools import cache

import pytest

from hdvplan.driving.drive import Drive, drive
from hdvplan.planning.objectives import Objective, geometric
from hdvplan.planning.settings import PlannerSettings, Scheme
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle

Driven = Callable[..., Drive]


@pytest.fixture(scope="session")
def driven() -> Driven:
    """Return a function that drives a scenario once for all tests that look at it."""

    @cache
    def run(scenario: str, vehicle: str, scheme: Scheme, objective: Objective = geometric, step: float = 0.5) -> Drive:
        settings = PlannerSettings(scheme=scheme, step=step)
        return drive(SCENARIOS[scenario](), load_vehicle(vehicle), objective, RiccatiWorkspace, settings)

    return run
