"""Steered axles: kinematics against rolling wheels in the plane, stationary circles against brute force."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hdvplan.arrays import FloatArray
from hdvplan.centring.stationary import stationary, tightest_kappa
from hdvplan.driving.drive import simulate
from hdvplan.road.path import from_curvature
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import STEP, axles, body_points, differences, few, linearised, placed, rates, three_units, vehicles

PROFILE_S = np.array([0.0, 10.0, 20.0, 30.0, 45.0, 60.0])
PROFILE_K = np.array([0.0, 0.0, 0.06, 0.06, -0.04, -0.04])


def all_steered() -> Vehicle:
    """Return three units whose axles all steer; the first two meet their stops in the motions below."""
    ratios, most = (0.4, 0.6, 0.9), (0.1, 0.15, 0.6)
    units = three_units().units
    return Vehicle(
        "all steered",
        tuple(replace(unit, steering_ratio=r, max_steering_angle=m) for unit, r, m in zip(units, ratios, most, strict=True)),
    )


RIGID = [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()]
STEERED = [load_vehicle("rear-steered-bus"), load_vehicle("semitrailer-steered"), all_steered()]
each_steered = pytest.mark.parametrize("vehicle", STEERED, ids=lambda v: v.name)


@st.composite
def steered_vehicles(draw: st.DrawFn) -> Vehicle:
    chain = draw(vehicles())
    steering = draw(st.lists(st.tuples(st.floats(0.0, 1.2), st.floats(0.05, 0.7)), min_size=4, max_size=4))
    units = tuple(replace(u, steering_ratio=r, max_steering_angle=m) for u, (r, m) in zip(chain.units, steering, strict=False))
    return Vehicle("drawn", units)


def wheel_angles(vehicle: Vehicle, headings: FloatArray, kappa: float) -> FloatArray:
    """Return how every unit's axle is turned off its body, from the law as a maker would write it [rad]."""
    angles = np.concatenate([[np.arctan(vehicle.lead.wheelbase * kappa)], headings[:-1] - headings[1:]])
    found = []
    for unit, angle in zip(vehicle.units, angles, strict=True):
        found.append(-np.sign(angle) * min(unit.steering_ratio * abs(angle), unit.max_steering_angle))
    return np.array(found)


def near_a_stop(vehicle: Vehicle, z: FloatArray, kappa: float) -> bool:
    """Tell whether a step of the numerical derivative would cross the corner of a steering law."""
    headings = -np.concatenate([[0.0], np.cumsum(z[2:])])
    free = wheel_angles(Vehicle("free", tuple(replace(u, max_steering_angle=0.25 * np.pi) for u in vehicle.units)), headings, kappa)
    stops = np.array([[unit.max_steering_angle, 0.25 * np.pi] for unit in vehicle.units])
    return bool(np.any(np.abs(np.abs(free)[:, None] - stops) < 10.0 * STEP))  # wheelbase times ratio times the step


unit_box = st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5)


@given(vehicle=steered_vehicles(), draw=unit_box, kappa=st.floats(-0.1, 0.1), k=st.floats(-0.2, 0.2))
@few
def test_the_jacobian_of_steered_axles_is_the_derivative_by_state_and_control(
    vehicle: Vehicle, draw: list[float], kappa: float, k: float
) -> None:
    z = np.array([2.0, 0.5, 1.2, 1.2, 1.2])[: vehicle.states] * draw[: vehicle.states]
    assume(not near_a_stop(vehicle, z, kappa))
    f, a, b = linearised(vehicle, k, z, kappa)
    assert np.allclose(f, rates(vehicle, k, z, kappa), rtol=0.0, atol=1e-13)
    # fifth derivatives of tan reach a few thousand at 1.2 rad of heading and wheels: 1e-12 / 30 times that
    assert np.allclose(a, differences(lambda v: rates(vehicle, k, v, kappa), z), rtol=0.0, atol=1e-8)
    by_kappa = differences(lambda v: rates(vehicle, k, z, float(v[0])), np.array([kappa]), step=1e-4)[:, 0]
    assert np.allclose(b, by_kappa, rtol=0.0, atol=1e-8)  # fifth derivatives of atan(14 m kappa) reach 1e7: 1e-16 / 30 times that


@given(vehicle=steered_vehicles(), draw=unit_box, kappa=st.floats(-0.1, 0.1), k=st.floats(-0.1, 0.1))
@few
def test_no_axle_slides_off_the_direction_of_its_wheels(vehicle: Vehicle, draw: list[float], kappa: float, k: float) -> None:
    z = np.array([2.0, 0.5, 1.2, 1.2, 1.2])[: vehicle.states] * draw[: vehicle.states]
    f = rates(vehicle, k, z, kappa)

    def moved(s: FloatArray) -> FloatArray:
        """Return x, y of every axle and of the front wheels when the road point has moved on by ``s`` on its circle."""
        turned = k * s[0]
        chord = s[0] * np.sinc(0.5 * turned / np.pi)
        x, y = chord * np.cos(0.5 * turned), chord * np.sin(0.5 * turned)
        return axles(vehicle, placed(vehicle, z + s[0] * f, x, y, turned))

    moves = differences(moved, np.zeros(1))[:, 0].reshape(-1, 2)  # metres per metre of road
    headings = z[1] - np.concatenate([[0.0], np.cumsum(z[2:])])
    along = np.append(headings + wheel_angles(vehicle, headings, kappa), headings[0] + np.arctan(vehicle.lead.wheelbase * kappa))
    slides = -np.sin(along) * moves[:, 0] + np.cos(along) * moves[:, 1]
    assert np.max(np.abs(slides)) < 1e-8  # the five-point rule at 30 m; the demand is 1e-6


def plane_rates(vehicle: Vehicle, q: FloatArray, road: FloatArray, kappa: float, wheels: FloatArray | None = None) -> FloatArray:
    """Return the rates of (x, y, headings) per metre of road of a chain on wheels that do not slide.

    As many linear conditions as unknown rates: no velocity across the front wheels, nor across any axle's wheels, and the
    lead axle stays abreast of the road point: ``road`` holds that point's direction and the rate that the axle must have along it.
    ``wheels`` are every axle's angles off its body where no law gives them.
    """
    off = wheel_angles(vehicle, q[2:], kappa) if wheels is None else wheels
    count = len(vehicle.units)
    body = np.stack([-np.sin(q[2:]), np.cos(q[2:])], axis=1)  # d(along)/d(heading)
    moves = np.zeros((count + 1, 2, count + 2))  # of every axle and the front wheels by every coordinate
    moves[:, :, :2] = np.eye(2)
    for i in range(1, count):
        moves[i] = moves[i - 1]
        moves[i, :, 1 + i] -= vehicle.units[i - 1].hitch_offset * body[i - 1]
        moves[i, :, 2 + i] -= vehicle.units[i].wheelbase * body[i]
    moves[count, :, 2] = vehicle.lead.wheelbase * body[0]
    along = np.append(q[2:] + off, q[2] + np.arctan(vehicle.lead.wheelbase * kappa))
    conditions, wanted = np.zeros((count + 2, count + 2)), np.zeros(count + 2)
    for i in range(count + 1):
        conditions[i] = np.array([-np.sin(along[i]), np.cos(along[i])]) @ moves[i]
    conditions[count + 1], wanted[count + 1] = road[:2] @ moves[0], road[2]
    return np.asarray(np.linalg.solve(conditions, wanted), float)


@pytest.mark.parametrize(
    ("vehicle", "within"),
    # The road's curvature between its knots is good to 1e-7 and adds up over 50 m; a wheel that meets its stop inside a step costs
    # some 1e-6.
    [*((rigid, 1e-6) for rigid in RIGID), *((steered, 1e-5) for steered in STEERED)],
    ids=lambda value: getattr(value, "name", None),
)
def test_the_simulation_agrees_with_wheels_rolling_in_the_plane(vehicle: Vehicle, within: float) -> None:
    step, count = 0.5, 100
    kappa = 0.04 * np.sin(0.11 * np.arange(count)) + 0.01 * (-1.0) ** np.arange(count)  # held over each step, and jumping
    z = np.array([0.4, -0.1, 0.2, -0.1][: vehicle.states])

    def motion(s: float, y: FloatArray, held: float) -> FloatArray:
        k, tangent = float(np.interp(s, PROFILE_S, PROFILE_K)), np.array([np.cos(y[2]), np.sin(y[2])])
        offset = float((y[3:5] - y[:2]) @ [-tangent[1], tangent[0]])
        own = plane_rates(vehicle, y[3:], np.array([*tangent, 1.0 - k * offset]), held)
        return np.concatenate([tangent, np.array([k]), own])

    headings = z[1] - np.concatenate([[0.0], np.cumsum(z[2:])])
    y, expected = np.concatenate([[0.0, 0.0, 0.0, 0.0, z[0]], headings]), [z]
    for i in range(count):
        whole = solve_ivp(motion, (i * step, (i + 1) * step), y, "DOP853", args=(kappa[i],), rtol=1e-5 * within, atol=1e-6 * within)
        y = whole.y[:, -1]
        e_y = float((y[3:5] - y[:2]) @ [-np.sin(y[2]), np.cos(y[2])])
        expected.append(np.array([e_y, y[5] - y[2], *(y[5:-1] - y[6:])]))
    found = simulate(vehicle.table(), from_curvature(PROFILE_S, PROFILE_K), 0.0, step, z, kappa, 1)
    assert np.max(np.abs(found - np.array(expected))) < within


@pytest.mark.parametrize("curvature", [1e-6, 0.02, 0.05, 0.08])
@each_steered
def test_a_steered_vehicle_on_its_balanced_circle_stays_there(vehicle: Vehicle, curvature: float) -> None:
    found = stationary(vehicle, np.array([curvature]))
    z = np.concatenate([[found.e_y[0], found.e_psi[0]], found.beta[0]])
    assert np.max(np.abs(rates(vehicle, curvature, z, float(found.kappa[0])))) < 1e-12  # rounding of angles


def outlines(vehicle: Vehicle) -> list[FloatArray]:
    """Return dense outlines in body axes, corners included."""
    found = []
    for unit in vehicle.units:
        x, y = np.linspace(-unit.rear_overhang, unit.front, 20001), np.array([-0.5, 0.5]) * unit.width
        found.append(np.concatenate([np.column_stack([x, np.full(x.size, side)]) for side in y]))
    return found


STEERED_CHAINS = [
    *STEERED,
    three_units(),
    Vehicle("wide tail", (Unit(4.0, 1.2, 1.0, 2.3, -0.5), Unit(3.0, 0.5, 6.0, 2.9, 3.0), Unit(6.0, 0.0, 2.0, 2.5))),
    Vehicle("swinging tail", (Unit(6.0, 2.0, 2.0, 2.5, 1.0), Unit(4.0, 0.0, 9.0, 2.5, 0.0, 1.5, 0.5))),
    Vehicle("sharply steered bus", (Unit(6.0, 2.7, 3.3, 2.55, 0.0, 1.6),)),
]


@pytest.mark.parametrize("vehicle", STEERED_CHAINS, ids=lambda v: v.name)
@pytest.mark.parametrize("curvature", [0.005, 0.03, 0.06])
def test_a_vehicle_is_balanced_on_its_circle_by_brute_force(vehicle: Vehicle, curvature: float) -> None:
    found = stationary(vehicle, np.array([curvature]))
    road = 1.0 / curvature
    axle = np.array([0.0, -(road - found.e_y[0])])  # the centre is the origin, the vehicle turns left
    heading = float(found.e_psi[0])
    placed = body_points(vehicle, axle, heading, found.beta[0], [np.array([[0.0, 0.0], [1.0, 0.0]])] * len(vehicle.units))
    headings = heading - np.concatenate([[0.0], np.cumsum(found.beta[0])])
    for (own, _), along in zip(placed, headings + wheel_angles(vehicle, headings, float(found.kappa[0])), strict=True):
        assert abs(own @ np.array([np.cos(along), np.sin(along)])) < 1e-9  # the wheels' axle line passes through the centre
    front = placed[0][0] + vehicle.lead.wheelbase * (placed[0][1] - placed[0][0])
    assert abs(road - np.hypot(*(front if found.axle == 0 else placed[found.axle][0])) - found.e_aux[0]) < 1e-9
    radii = np.concatenate([np.hypot(*points.T) for points in body_points(vehicle, axle, heading, found.beta[0], outlines(vehicle))])
    assert abs(np.max(radii) - road - found.half_width[0]) < 1e-9  # a corner, which is among the outline's points
    assert abs(road - np.min(radii) - found.half_width[0]) < 1e-7  # points 1 mm apart: h^2 / 8 over a radius of 10 m
    assert abs(found.lead[0] * found.e_y[0] + found.aux[0] * found.e_aux[0] - found.target[0]) < 1e-12


@pytest.mark.parametrize(("name", "unit"), [("rear-steered-bus", 0), ("semitrailer-steered", 1)])
def test_a_positive_ratio_narrows_the_swept_band(name: str, unit: int) -> None:
    steered, k = load_vehicle(name), np.array([0.02, 0.06])
    units = [replace(u, steering_ratio=0.0) if i == unit else u for i, u in enumerate(steered.units)]
    narrowed = stationary(Vehicle("rigid", tuple(units)), k).half_width - stationary(steered, k).half_width
    assert np.all(narrowed > 0.1)


def test_a_trailer_that_steers_as_much_as_it_articulates_follows_its_coupling_exactly() -> None:
    vehicle = Vehicle("follower", (Unit(4.0, 1.0, 1.0, 2.5), Unit(8.0, 0.5, 1.0, 2.5, 0.0, 1.0)))
    found = stationary(vehicle, np.array([0.04]))
    axle = np.array([0.0, -(1.0 / 0.04 - found.e_y[0])])
    own, coupling = body_points(vehicle, axle, 0.0, found.beta[0], [np.array([[0.0, 0.0], [8.0, 0.0]])] * 2)[1]
    assert np.hypot(*own) == pytest.approx(np.hypot(*coupling), abs=1e-9)


@each_steered
def test_the_tightest_circle_of_a_steered_vehicle_is_the_last_possible_one(vehicle: Vehicle) -> None:
    limit = tightest_kappa(vehicle)
    plain = tightest_kappa(Vehicle("plain", tuple(replace(unit, steering_ratio=0.0) for unit in vehicle.units)))
    tightest = stationary(vehicle, np.array([10.0]))
    assert tightest.saturated[0]
    assert tightest.kappa[0] == pytest.approx(limit, rel=1e-8)
    if len(vehicle.units) > 1:
        assert limit > plain  # steered wheels let a trailer follow tighter circles
