"""Streets drawn around a drive that is known, integrated by itself: a plan finds its way, and is judged by poses every 2 cm."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from hdvplan import api
from hdvplan.api import replanned
from hdvplan.case import Case
from hdvplan.judging.balance import KEPT_M
from hdvplan.judging.verdict import verdict_of
from hdvplan.vehicle.load import load_vehicle
from tests.nightly import nightly

sys.path.insert(0, str(Path(__file__).parents[1] / "benchmarks"))
from random_drives import crosses, edges_around, random_drive, road_around


def answers(name: str, margin: float, seeds: range) -> list[float]:
    """Return what every plan around a known drive has to spare [m]; no YES may cross an edge."""
    vehicle, found = load_vehicle(name), []
    for seed in seeds:
        poses = random_drive(vehicle, seed)
        edges = edges_around(vehicle, poses, margin)
        if edges is not None:
            result = replanned(api.plan(Case(road_around(vehicle, poses, edges), vehicle)))
            verdict = verdict_of(result)
            assert verdict.spare is not None
            found.append(verdict.spare)
            assert not (verdict.fits and crosses(result, edges, KEPT_M + 2e-3)), seed  # chords of edges 2 mm, sweeps of the judge
    assert found
    return found


def test_a_known_drive_that_ends_in_a_bend_is_found() -> None:
    """Edges go on beyond the line's end, where the front must keep them until the lead axle has left the road."""
    assert min(answers("tractor-trailer", 0.05, range(2, 3))) >= -KEPT_M


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bus", nightly("articulated-bus"), "tractor-trailer", nightly("a-double")])
@pytest.mark.parametrize(("margin", "share"), [nightly(0.05, 0.98), (0.02, 0.95)])
def test_a_vehicle_finds_its_way_along_a_drive_with_centimetres_of_room(name: str, margin: float, share: float) -> None:
    found = np.array(answers(name, margin, range(12)))
    assert np.mean(found >= -KEPT_M) >= share
    assert np.min(found) >= -0.02  # what following the drive would lack, which is nothing, and the 2 cm that are allowed


@pytest.mark.slow
@pytest.mark.parametrize("name", ["bus", nightly("articulated-bus"), "tractor-trailer", nightly("a-double")])
def test_a_street_narrower_than_the_vehicle_lacks_no_more_than_following_a_known_drive_does(name: str) -> None:
    found = answers(name, -0.1, range(4))
    assert max(found) < -KEPT_M  # never YES
    assert min(found) >= -0.12  # following the drive lacks 10 cm


@pytest.mark.slow
def test_nearer_stations_find_a_plan_that_lacks_a_centimetre_less() -> None:
    """With stations 0.5 m apart the plan lacks 12.3 cm."""
    (lacking,) = answers("articulated-bus", -0.1, range(4, 5))
    assert lacking >= -0.11
