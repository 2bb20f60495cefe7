"""[GEO] fig. 11: a varying weight against a fixed one."""

import numpy as np
import pytest

from hdvplan.reproduce.s_turns import compare, pair_of, s_turns
from hdvplan.vehicle.load import load_vehicle
from tests.reproduce.conftest import by_name, silent


@pytest.mark.parametrize("name", ["bus", "tractor-trailer"])
def test_a_varying_weight_improves_most_on_long_ramps_to_tight_bends(name: str) -> None:
    vehicle = load_vehicle(name)
    gentle, middle, hard = (compare(pair_of(vehicle, *case))["improvement"] for case in ((0.02, 0.02), (0.05, 0.01), (0.08, 0.004)))
    assert 0.0 < gentle < middle < hard


def test_the_signed_sum_cancels_where_the_absolute_one_does_not() -> None:
    found = compare(pair_of(load_vehicle("tractor-trailer"), 0.06, 0.01))
    assert abs(found["fixed_sum"]) < 0.1 * found["fixed_abs"]
    assert found["varying_abs"] < found["fixed_abs"]


def test_a_bend_that_the_vehicle_cannot_balance_is_left_out() -> None:
    assert all(np.isnan(value) for value in compare(pair_of(load_vehicle("bus"), 0.1, 0.01)).values())  # needs 0.12 1/m, steers 0.1
    assert np.isfinite(compare(pair_of(load_vehicle("tractor-trailer"), 0.1, 0.02))["improvement"])


def test_a_small_grid_makes_a_whole_study() -> None:
    shares: list[float] = []
    study = s_turns(shares.append, (0.04, 0.1), (0.008, 0.02))
    rows = by_name(study)
    assert len(study.data) == 8
    assert len(study.cases) == 2 * (8 - 2)
    assert rows["bus: roads left out"].ours == 2
    assert rows["tractor-trailer: roads left out"].ours == 0
    gains = study.data.groupby("vehicle")["improvement"].max()
    for name in ("bus", "tractor-trailer"):
        assert rows[f"{name}: gain in absolute D, most [%]".removesuffix(" [%]")].ours == gains[name]
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


@pytest.mark.slow
def test_a_varying_weight_is_never_worse_over_the_whole_grid() -> None:
    study = s_turns(silent)
    improvement = study.data["improvement"].dropna()
    assert improvement.min() > 0.0
    rows = by_name(study)
    # at least what is published; why ours is two to three times that is not known
    assert rows["bus: gain in absolute D, most"].ours >= 10.0
    assert rows["tractor-trailer: gain in absolute D, most"].ours >= 5.0
