"""Every preset drives: on constant radius as the geometry says, through the papers' scenarios, and along real roads."""

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import Drive, drive
from hdvplan.judging.envelope import Envelope
from hdvplan.planning.objectives import geometric
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.path import from_curvature
from hdvplan.road.road import Road
from hdvplan.road.scenarios import SCENARIOS, turn_profile
from hdvplan.solvers.riccati import RiccatiWorkspace
from hdvplan.vehicle.load import load_vehicle, preset_names
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import axles, differences, placed, rates

LEAD_IN, RAMP, CONSTANT = 50.0, 5.5, 320.0  # the roundabout of [GEO], driven three times round so that everything settles
SETTLED = (LEAD_IN + RAMP + 180.0, LEAD_IN + RAMP + CONSTANT - 70.0)  # before the plan sees the end, some 30 m ahead
SETTINGS = PlannerSettings()
QUICK = {  # every kind once, and the shortest
    "P", "bus", "rear-steered-bus", "articulated-bus", "tractor-trailer", "tractor-trailer-24m", "semitrailer-steered",
    "semitrailer-active", "truck-dolly-semitrailer",
}  # fmt: skip
each_preset = pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.nightly) for name in preset_names()]
)


def driven(road: Road, vehicle: Vehicle) -> Drive:
    return drive(replace(road, limits=None), vehicle, geometric, RiccatiWorkspace, SETTINGS)


def test_the_presets_that_are_always_driven_ship() -> None:
    assert set(preset_names()) >= QUICK


@each_preset
def test_on_constant_radius_a_preset_settles_in_its_stationary_circle_sweeps_both_sides_alike_and_no_axle_slides(name: str) -> None:
    run = driven(Road("circle", from_curvature(*turn_profile(1.0 / 17.88, RAMP, CONSTANT))), load_vehicle(name))
    s = run.stations.s[: len(run.z)]
    here = (s > SETTLED[0]) & (s < SETTLED[1])
    geometry = run.stations.centring
    for found, expected, tolerance in (
        (run.z[:, 2 : run.vehicle.rigid_states], geometry.beta[: len(s)], 1e-3),  # demanded
        (run.steering, geometry.steering[: len(s)], 1e-3),
        (run.z[:, 0], geometry.e_y[: len(s)], 0.01),
        (run.z[:, 1], geometry.e_psi[: len(s)], 1e-3),
    ):
        assert not found.size or np.max(np.abs(found[here] - expected[here])) < tolerance
    envelope = Envelope(run)
    here = (envelope.s > SETTLED[0]) & (envelope.s < SETTLED[1])
    left, right = envelope.reach_left[here], -envelope.reach_right[here]
    half_width = float(np.max(geometry.half_width))
    assert abs(np.max(left) - np.max(right)) < 0.03  # demanded
    assert np.max(np.abs(left - half_width)) < 0.02
    assert np.max(np.abs(right - half_width)) < 0.02
    for at in range(0, len(run.kappa), 7):
        assert np.max(slides(run, at)) < 1e-6  # demanded; the five-point rule at 100 m from the origin leaves 1e-10


def test_a_bus_whose_axles_run_on_one_circle_is_balanced_by_its_target() -> None:
    """Both axles lie equally far inside the centre: no weighted sum of theirs vanishes, so the residual aims at its stationary value."""
    crab = Vehicle("crab", (Unit(6.0, 2.7, 3.3, 2.55, 0.0, 1.0),))
    run = driven(Road("circle", from_curvature(*turn_profile(1.0 / 17.88, RAMP, CONSTANT))), crab)
    assert np.max(np.abs(run.stations.centring.target)) > 0.1
    envelope = Envelope(run)
    here = (envelope.s > SETTLED[0]) & (envelope.s < SETTLED[1])
    assert abs(np.max(envelope.reach_left[here]) + np.min(envelope.reach_right[here])) < 0.03


def slides(run: Drive, at: int) -> FloatArray:
    """Return how far every unit's axle and the front wheels slide across their wheels' direction, per metre of road."""
    vehicle, z, kappa = run.vehicle, run.z[at], float(run.kappa[at])
    point = run.stations.path.at(run.stations.s[at])
    k, psi = float(point.curvature), float(point.heading)
    f = rates(vehicle, k, z, kappa)

    def moved(ahead: FloatArray) -> FloatArray:
        turned = k * ahead[0]
        chord, towards = ahead[0] * np.sinc(0.5 * turned / np.pi), psi + 0.5 * turned
        x, y = float(point.x) + chord * np.cos(towards), float(point.y) + chord * np.sin(towards)
        return axles(vehicle, placed(vehicle, z + ahead[0] * f, x, y, psi + turned))

    moves = differences(moved, np.zeros(1))[:, 0].reshape(-1, 2)
    beta, wheels = np.split(z[2:], [len(vehicle.units) - 1])
    headings = psi + z[1] - np.concatenate([[0.0], np.cumsum(beta)])
    front = np.arctan(vehicle.lead.wheelbase * kappa)
    turns = np.append(front, beta)
    off = [-np.clip(u.steering_ratio * t, -u.max_steering_angle, u.max_steering_angle) for u, t in zip(vehicle.units, turns, strict=True)]
    for unit, angle in zip(vehicle.active, wheels, strict=True):
        off[unit] = angle
    along = np.append(headings + off, headings[0] + front)
    across: FloatArray = np.cos(along) * moves[:, 1] - np.sin(along) * moves[:, 0]
    return np.abs(across)


@pytest.mark.parametrize("scenario", ["uturn", "roundabout"])
@each_preset
def test_every_preset_drives_the_papers_scenarios(name: str, scenario: str) -> None:
    run = driven(SCENARIOS[scenario](), load_vehicle(name))
    envelope, expected = Envelope(run), float(np.max(run.stations.centring.half_width))
    assert all(plan.usable for plan in run.plans)
    assert len(run.kappa) * SETTINGS.step >= run.road.path.length - 1e-6
    # transients of combinations of more than 25 m reach up to 0.25 m further than their circle, those of all others 0.1 m
    spare = 0.25 if len(run.vehicle.units) > 2 else 0.1
    assert np.max(envelope.reach_left) < expected + spare
    assert -np.min(envelope.reach_right) < expected + spare


@pytest.mark.nightly
@pytest.mark.parametrize("road", ["goteborg_nya_allen", "goteborg_tuvevagen_brunnsbo", "neubrandenburg_ring"])
@each_preset
def test_every_preset_drives_real_roads(name: str, road: str) -> None:
    vehicle = load_vehicle(name)
    run = driven(load_road(road, RoadOptions(max_curvature=1.25 * vehicle.max_curvature)), vehicle)
    assert all(plan.usable for plan in run.plans)
    assert len(run.kappa) * SETTINGS.step >= run.road.path.length - 1e-6
    assert np.max(np.abs(run.kappa)) <= vehicle.max_curvature + 1e-6
    envelope = Envelope(run)
    assert np.nanmax(envelope.reach_left) < 8.0  # nothing runs away
    assert -np.nanmin(envelope.reach_right) < 8.0
