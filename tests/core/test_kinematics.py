import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hdvplan.arrays import FloatArray
from hdvplan.driving.drive import simulate
from hdvplan.road.path import from_curvature
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle
from tests.core.chains import body_points, few, placed, rates, vehicles
from tests.core.test_steering import PROFILE_K, PROFILE_S


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
