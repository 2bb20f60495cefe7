import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import simulate
from hdvplan.road.path import from_curvature
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import body_points, few, linearised, placed, rates, three_units, vehicles
from tests.core.differences import differences

PROFILE_S = np.array([0.0, 10.0, 20.0, 30.0, 45.0, 60.0])
PROFILE_K = np.array([0.0, 0.0, 0.06, 0.06, -0.04, -0.04])


def states(vehicle: Vehicle, draw: list[float]) -> FloatArray:
    scale = np.array([2.0, 0.9, 1.2, 1.2, 1.2])[: vehicle.states]
    return np.asarray(scale * draw[: vehicle.states], float)


unit_box = st.lists(st.floats(-1.0, 1.0), min_size=5, max_size=5)


@given(beta=st.floats(-1.4, 1.4), e_y=st.floats(-3.0, 3.0), e_psi=st.floats(-1.0, 1.0), kappa=st.floats(-0.1, 0.1), k=st.floats(-0.1, 0.1))
@few
def test_a_tractor_trailer_follows_the_published_equations(beta: float, e_y: float, e_psi: float, kappa: float, k: float) -> None:
    vehicle = load_vehicle("tractor-trailer")
    hitch, length = -0.30, 9.40
    inside = 1.0 - e_y * k
    expected = [
        inside * np.tan(e_psi),
        inside / np.cos(e_psi) * kappa - k,
        inside / np.cos(e_psi) * (kappa - np.sin(beta) / length + hitch / length * np.cos(beta) * kappa),
    ]
    assert np.allclose(rates(vehicle, k, np.array([e_y, e_psi, beta]), kappa), expected, rtol=0.0, atol=1e-13)  # rounding


@given(vehicle=vehicles(), draw=unit_box, kappa=st.floats(-0.2, 0.2), k=st.floats(-0.2, 0.2))
@few
def test_the_kinematic_jacobian_is_the_derivative_by_state_and_curvature(
    vehicle: Vehicle, draw: list[float], kappa: float, k: float
) -> None:
    z = states(vehicle, draw)
    f, a, b = linearised(vehicle, k, z, kappa)
    assert np.allclose(f, rates(vehicle, k, z, kappa), rtol=0.0, atol=1e-14)
    # fifth derivatives of tan reach a few hundred at 0.9 rad: 1e-12 / 30 times that
    assert np.allclose(a, differences(lambda v: rates(vehicle, k, v, kappa), z), rtol=0.0, atol=1e-9)
    assert np.allclose(b, differences(lambda v: rates(vehicle, k, z, float(v[0])), np.array([kappa]))[:, 0], rtol=0.0, atol=1e-11)


@given(vehicle=vehicles(), draw=unit_box, heading=st.floats(-3.1, 3.1))
@few
def test_every_unit_is_placed_where_its_couplings_put_it(vehicle: Vehicle, draw: list[float], heading: float) -> None:
    z = states(vehicle, draw)
    poses = placed(vehicle, z, 3.0, -7.0, heading)
    axle = np.array([3.0 - z[0] * np.sin(heading), -7.0 + z[0] * np.cos(heading)])
    local = [np.array([[0.0, 0.0], [1.0, 0.0], [u.wheelbase if i else 0.0, 0.0]]) for i, u in enumerate(vehicle.units)]
    turned = z[1 : 1 + len(vehicle.units)]
    for pose, angle, (own, ahead, coupling) in zip(poses, turned, body_points(vehicle, axle, heading + z[1], z[2:], local), strict=True):
        expected = [*own, *(ahead - own), *coupling, np.cos(angle), np.sin(angle)]
        assert np.allclose(pose.tolist(), expected, rtol=0.0, atol=1e-12)  # rounding at 30 m


def plane_rates(vehicle: Vehicle, q: FloatArray, speed: float, kappa: float) -> FloatArray:
    """Return the rates of (x, y, headings) of a chain whose axles roll without slipping sideways.

    Unknown rates of all coordinates, and as many conditions: the lead axle rolls at ``speed`` and turns with
    ``kappa``; no axle's velocity has a component across its body.
    """
    count = len(vehicle.units)
    along, across = np.stack([np.cos(q[2:]), np.sin(q[2:])], axis=1), np.stack([-np.sin(q[2:]), np.cos(q[2:])], axis=1)
    moves = np.zeros((count, 2, count + 2))  # of every axle by every coordinate
    moves[:, :, :2] = np.eye(2)
    for i in range(1, count):
        moves[i] = moves[i - 1]
        moves[i, :, 1 + i] -= vehicle.units[i - 1].hitch_offset * across[i - 1]
        moves[i, :, 2 + i] -= vehicle.units[i].wheelbase * across[i]
    conditions, wanted = np.zeros((count + 2, count + 2)), np.zeros(count + 2)
    for i in range(count):
        conditions[i] = across[i] @ moves[i]
    conditions[count] = along[0] @ moves[0]
    conditions[count + 1, 2] = 1.0
    wanted[count:] = speed, kappa * speed
    return np.asarray(np.linalg.solve(conditions, wanted), float)


@pytest.mark.parametrize("vehicle", [load_vehicle("bus"), load_vehicle("tractor-trailer"), three_units()], ids=lambda v: v.name)
def test_the_simulation_agrees_with_rolling_axles_in_the_plane(vehicle: Vehicle) -> None:
    step, count = 0.5, 100
    kappa = 0.05 * np.sin(0.11 * np.arange(count)) + 0.01 * (-1.0) ** np.arange(count)  # held over each step, and jumping
    z = np.array([0.4, -0.1, 0.2, -0.1, 0.3][: vehicle.states])

    def road_curvature(s: float) -> float:
        return float(np.interp(s, PROFILE_S, PROFILE_K))

    def motion(s: float, y: FloatArray, held: float) -> FloatArray:
        """Move road point and chain so that the lead axle stays abreast of the road point: (P - gamma) . t = 0."""
        k, tangent = road_curvature(s), np.array([np.cos(y[2]), np.sin(y[2])])
        normal = np.array([-tangent[1], tangent[0]])
        offset = (y[3:5] - y[:2]) @ normal
        speed = (1.0 - k * offset) / (np.cos(y[5]) * tangent[0] + np.sin(y[5]) * tangent[1])
        return np.concatenate([tangent, np.array([k]), plane_rates(vehicle, y[3:], speed, held)])

    headings = z[1] - np.concatenate([[0.0], np.cumsum(z[2:])])
    y, expected = np.concatenate([[0.0, 0.0, 0.0, 0.0, z[0]], headings]), [z]
    for i in range(count):
        whole = solve_ivp(motion, (i * step, (i + 1) * step), y, "DOP853", args=(kappa[i],), rtol=1e-11, atol=1e-12)
        y = whole.y[:, -1]
        e_y = float((y[3:5] - y[:2]) @ [-np.sin(y[2]), np.cos(y[2])])
        expected.append(np.array([e_y, y[5] - y[2], *(y[5:-1] - y[6:])]))
    path = from_curvature(PROFILE_S, PROFILE_K)
    found = simulate(vehicle.table(), path, 0.0, step, z, kappa, 2)
    assert found.shape == (2 * count + 1, vehicle.states)
    # both integrate to 1e-9; the road's curvature between its knots is good to 1e-7 and adds up over 50 m
    assert np.max(np.abs(found[::2] - np.array(expected))) < 1e-6


def test_kept_states_do_not_depend_on_how_many_are_kept() -> None:
    vehicle, path = load_vehicle("tractor-trailer"), from_curvature(PROFILE_S, PROFILE_K)
    z, kappa = np.array([0.1, 0.0, 0.1]), np.full(40, 0.03)
    one, four = (simulate(vehicle.table(), path, 5.0, 0.5, z, kappa, keep) for keep in (1, 4))
    assert np.max(np.abs(one - four[::4])) < 1e-9  # fourth-order steps of 0.05 m and less


def test_a_motion_that_leaves_the_models_domain_ends_in_nan() -> None:
    vehicle, path = load_vehicle("bus"), from_curvature(np.array([0.0, 80.0]), np.zeros(2))
    found = simulate(vehicle.table(), path, 0.0, 0.5, np.zeros(2), np.full(100, 0.1), 1)  # turns back after a quarter circle
    lost = int(np.argmin(np.isfinite(found[:, 0])))
    assert np.all(np.isnan(found[lost:]))
    assert lost * 0.5 == pytest.approx(10.0, abs=0.51)  # a circle of 10 m radius is parallel to the y axis at s = 10 m
