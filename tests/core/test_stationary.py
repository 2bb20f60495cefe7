import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

from hdvplan.centring.stationary import CentringTable, coefficients, stationary, tightest_kappa, tightest_road
from hdvplan.vehicle.load import load_vehicle, preset_names
from hdvplan.vehicle.model import Unit, Vehicle
from tests.core.chains import few, three_units

TRACTOR_TRAILERS = ["tractor-trailer", "tractor-trailer-24m", "tractor-trailer-paper"]


def weight_of(name: str, curvature: float) -> float:
    return float(stationary(load_vehicle(name), np.array([curvature])).weight[0])


@given(radius=st.floats(10.0, 2000.0))
@few
def test_a_bus_circles_as_in_the_closed_form(radius: float) -> None:
    wheelbase, front, width = 6.00, 6.00 + 3.34, 2.54
    lead_radius = (4.0 * radius**2 + 2.0 * width * radius - front**2) / (4.0 * radius + 2.0 * width)
    e_y, e_front = radius - lead_radius, radius - np.hypot(wheelbase, lead_radius)
    found = stationary(load_vehicle("bus"), np.array([1.0 / radius]))
    assert abs(found.e_y[0] - e_y) < 1e-9
    assert abs(found.e_aux[0] - e_front) < 1e-9
    assert abs(found.kappa[0] - 1.0 / lead_radius) < 1e-9
    assert abs(found.half_width[0] - (radius - (lead_radius - 0.5 * width))) < 1e-9
    # the closed form subtracts radii up to 2000 m for offsets of centimetres: 1e-12 / 1e-2
    assert abs(found.weight[0] + e_front / e_y) < 1e-9


@given(radius=st.floats(10.0, 1000.0), name=st.sampled_from(TRACTOR_TRAILERS))
@few
def test_a_tractor_trailer_circles_as_in_the_closed_form(radius: float, name: str) -> None:
    tractor, trailer = load_vehicle(name).units
    front, hitch, length, width = tractor.wheelbase + tractor.front_overhang, tractor.hitch_offset, trailer.wheelbase, 2.54

    def balance(lead: float) -> float:
        outer, inner = np.hypot(lead + 0.5 * width, front), np.sqrt(lead**2 + hitch**2 - length**2) - 0.5 * width
        return float(outer + inner - 2.0 * radius)

    least = np.sqrt(length**2 - hitch**2 + 0.25 * width**2)
    lead = brentq(balance, least, radius + 20.0, xtol=1e-13, rtol=1e-15)
    last = np.sqrt(lead**2 + hitch**2 - length**2)
    found = stationary(load_vehicle(name), np.array([1.0 / radius]))
    assert abs(found.e_y[0] - (radius - lead)) < 1e-9
    assert abs(found.e_aux[0] - (radius - last)) < 1e-9
    assert abs(found.kappa[0] - 1.0 / lead) < 1e-9
    assert abs(found.beta[0, 0] - (np.arctan(hitch / lead) + np.arctan(length / last))) < 1e-9
    assert abs(found.half_width[0] - (radius - last + 0.5 * width)) < 1e-9
    # the root search leaves 1e-12 m in offsets of centimetres
    assert abs(found.weight[0] - (radius - last) / (lead - radius)) < 1e-8


def test_the_papers_roundabout_is_met_to_its_last_digit() -> None:
    found = stationary(load_vehicle("tractor-trailer-paper"), np.array([1.0 / 17.88]))
    assert abs(found.kappa[0] - 0.05393) < 1e-5
    assert abs(found.beta[0, 0] - 0.4604) < 1e-4
    assert abs(found.half_width[0] - 2.273) < 5e-4
    assert found.e_y[0] < 0.0 < found.e_aux[0]


def test_the_weight_of_a_bus_is_negative_on_gentle_curves() -> None:
    assert abs(weight_of("bus", 0.0) + 0.175) < 5e-4
    assert abs(weight_of("bus", 1.0 / 12.0) + 0.02) < 5e-3  # published with two decimals


@pytest.mark.parametrize(
    ("name", "curvature", "published", "searched"),
    [("tractor-trailer-24m", 0.065, 0.447, 0.45), ("tractor-trailer", 1.0 / 17.88, 0.395, 0.40)],
)
def test_the_weight_explains_what_others_found_by_exhaustive_search(name: str, curvature: float, published: float, searched: float) -> None:
    share = 1.0 / (1.0 + weight_of(name, curvature))
    assert abs(share - published) < 5e-4  # three decimals are given
    assert abs(share - searched) < 6e-3  # they searched in steps of 0.05


@pytest.mark.parametrize("vehicle", [*map(load_vehicle, preset_names()), three_units()], ids=lambda v: v.name)
def test_everything_is_continuous_at_the_straight(vehicle: Vehicle) -> None:
    k = np.array([0.0, 1e-9, 0.999e-7, 1.001e-7, 1e-6, 1e-5])
    found = stationary(vehicle, k)
    # coefficients change by a few m per 1/m of curvature; offsets grow like 50 m^2 times it, less rounding of 1e-15 m
    for values in (found.lead, found.aux):
        assert np.max(np.abs(values - values[0])) < 1e-4
        assert np.max(np.abs(values[:4] - values[0])) < 1e-6
    assert np.max(np.abs(found.e_y)) < 1e-3
    assert np.max(np.abs(np.diff(found.e_y / np.maximum(k, 1e-9))[1:4])) < 1e-4
    assert np.max(np.abs(found.kappa - k * found.kappa[-1] / k[-1])) < 1e-7  # steered rear axles need less than the road's
    assert np.max(np.abs(found.half_width - 0.5 * vehicle.width)) < 1e-2


def test_the_sign_of_the_curvature_does_not_matter_to_the_circle() -> None:
    left, right = (stationary(load_vehicle("tractor-trailer"), np.array([sign * 0.05])) for sign in (1.0, -1.0))
    assert left.e_y[0] == right.e_y[0]
    assert left.weight[0] == right.weight[0]


@pytest.mark.parametrize("name", preset_names())
def test_a_road_too_tight_for_any_circle_is_marked_and_the_tightest_circle_held(name: str) -> None:
    vehicle = load_vehicle(name)
    found = stationary(vehicle, np.linspace(0.0, 0.5, 101))
    first = int(np.argmax(found.saturated))
    assert first > 0
    assert np.all(found.saturated[first:])
    assert np.all(found.kappa[:first] < tightest_kappa(vehicle))
    assert np.allclose(found.kappa[first:], tightest_kappa(vehicle), rtol=1e-8)
    for values in (found.kappa, found.e_y, found.e_aux, found.beta, found.half_width, found.weight):
        assert np.all(np.isfinite(values))
        assert np.all(values[first:] == values[first])


def test_the_tightest_circle_puts_an_inner_edge_on_the_centre() -> None:
    assert 1.0 / tightest_kappa(load_vehicle("bus")) == pytest.approx(1.27, abs=1e-12)
    lead = 1.0 / tightest_kappa(load_vehicle("tractor-trailer"))
    assert np.sqrt(lead**2 + 0.30**2 - 9.40**2) == pytest.approx(1.27, abs=1e-9)


@pytest.mark.parametrize("name", preset_names())
def test_the_tightest_road_is_where_saturation_begins(name: str) -> None:
    vehicle = load_vehicle(name)
    tightest = tightest_road(vehicle)
    assert CentringTable.of(vehicle).tightest_road == tightest
    found = stationary(vehicle, tightest * np.array([1.0 - 1e-6, 1.0 + 1e-6]))
    assert found.saturated.tolist() == [False, True]
    at = CentringTable.of(vehicle).at(tightest * np.array([-1.0 - 1e-6, -1.0 + 1e-6, 1.0 - 1e-6, 1.0 + 1e-6]))
    assert at.saturated.tolist() == [True, False, False, True]


@pytest.mark.parametrize("name", preset_names())
def test_the_table_agrees_with_the_circle_itself_on_roads_that_can_be_driven(name: str) -> None:
    vehicle = load_vehicle(name)
    k = np.random.default_rng(1).uniform(-0.1, 0.1, 200)
    found, exact = CentringTable.of(vehicle).at(k), stationary(vehicle, k)
    # linear between curvatures 2.5e-4 1/m apart: K'' h^2 / 8; the same for the offsets, whose curvature is some 100 m^3. Where
    # another body's corner becomes the outermost, or a coefficient comes to its largest value, slopes jump by up to 2 m per 1/m, and
    # h times that is lost
    sharp = name in {"a-double", "tractor-semitrailer", "WB-40"}
    assert np.max(np.abs(found.lead - exact.lead)) < (2e-4 if sharp else 5e-6)
    assert np.max(np.abs(found.aux - exact.aux)) < (2e-4 if sharp else 1e-6)
    for values, circle in ((found.e_y, exact.e_y), (found.e_aux, exact.e_aux), (found.kappa, exact.kappa), (found.e_psi, exact.e_psi)):
        assert np.max(np.abs(values - np.sign(k) * circle)) < 2e-5
    assert np.max(np.abs(found.half_width - exact.half_width)) < 2e-5
    assert found.beta.shape == (200, len(vehicle.units) - 1)


def test_the_table_holds_and_marks_what_lies_beyond_its_end() -> None:
    table = CentringTable.of(load_vehicle("bus"))
    found = table.at(np.array([0.0, 0.1, 0.4, 3.0, -3.0]))
    assert found.saturated.tolist() == [False, False, True, True, True]
    assert found.weight[2] == found.weight[3] == found.weight[4]
    assert found.e_y[4] == -found.e_y[3]


def test_the_weight_is_finite_for_a_truck_whose_trailer_is_as_long_as_its_front() -> None:
    drawbar = Vehicle("drawbar", (Unit(5.0, 1.5, 2.5, 2.55, 0.0), Unit(6.5, 0.0, 2.0, 2.55)))
    assert np.all(np.isfinite(CentringTable.of(drawbar).at(np.linspace(0.0, 0.1, 101)).weight))


@given(angle=st.floats(-3.14, 3.14), size=st.floats(1e-6, 3.0))
@few
def test_the_residual_of_any_two_offsets_vanishes_on_the_circle_and_feels_a_shift(angle: float, size: float) -> None:
    e_y, e_aux = np.array([size * np.cos(angle)]), np.array([size * np.sin(angle)])
    lead, aux, target = coefficients(e_y, e_aux)
    assert abs(lead * e_y + aux * e_aux - target)[0] < 1e-12
    assert 0.0 < max(lead[0], aux[0]) <= 2.0 + 1e-12
    assert lead[0] + aux[0] >= 0.5 * max(lead[0], aux[0]) - 1e-12  # what a lateral shift of 1 m changes the residual by
    weight = -e_aux[0] / e_y[0]
    if -0.5 < weight < 2.0:  # the papers' own
        assert (aux[0], target[0]) == (pytest.approx(1.0, abs=1e-12), 0.0)
        assert lead[0] == pytest.approx(weight, abs=1e-12)


def test_the_coefficients_pass_smoothly_where_the_lead_axle_runs_on_the_centre() -> None:
    e_y = np.linspace(-0.1, 0.1, 2001)
    lead, aux, target = coefficients(e_y, np.full_like(e_y, 0.5))
    assert np.max(np.abs(lead - 2.0)) < 1e-12  # rounding
    assert np.max(np.abs(np.diff(aux))) < 1e-3  # 2 / 0.5 times the step of e_y
    assert np.all(target == 0.0)
    assert abs(aux[1000]) < 1e-12


@pytest.mark.parametrize(
    ("name", "axle"),
    [("bus", 0), ("articulated-bus", 0), ("double-articulated-bus", 0), ("tractor-trailer", 1), ("b-double", 1), ("a-double", 1),
     ("truck-dolly-semitrailer", 2)],
)  # fmt: skip
def test_the_two_axles_of_a_chain_lie_on_either_side_of_the_centre(name: str, axle: int) -> None:
    found = stationary(load_vehicle(name), np.linspace(0.01, 0.08, 8))
    assert found.axle == axle
    if len(load_vehicle(name).units) > 1:
        assert np.all(found.e_y * found.e_aux < 0.0)
        assert np.all(found.weight > 0.0)
    assert np.all(found.target == 0.0)
