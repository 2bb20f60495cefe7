from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.judging.envelope import steering_of, steering_texts
from hdvplan.judging.result import Result


def steered(result: Result, kappa: FloatArray) -> list[str]:
    drive = replace(result.drive, kappa=kappa)
    return steering_texts(drive, steering_of(drive))


def gentle(result: Result) -> FloatArray:
    return np.zeros(len(result.drive.kappa))


def test_shares_are_those_of_the_vehicles_limits(straight: Result) -> None:
    kappa, vehicle = gentle(straight), straight.drive.vehicle
    kappa[40:] = 0.5 * vehicle.max_curvature_rate * straight.drive.settings.step
    found = steering_of(replace(straight.drive, kappa=kappa))
    assert found.rate.share == pytest.approx(0.5)
    assert found.rate.s == 20.0  # of the 40th step of half a metre
    assert found.curvature.share == pytest.approx(kappa[-1] / vehicle.max_curvature)


def test_steering_that_is_used_up_is_told_with_its_place(straight: Result) -> None:
    kappa = gentle(straight)
    kappa[60:64] = 0.97 * straight.drive.vehicle.max_curvature
    texts = steered(straight, kappa)
    assert texts[0] == "the plan uses 97 % of the steering at s = 30.0 m, over 95 % along 2.0 m of road"
    assert "of the steering rate at s = " in texts[1]
    given = replace(straight.drive, kappa=kappa, plans=())  # a path of one's own
    assert steering_texts(given, steering_of(given))[0] == texts[0].replace("the plan", "the path")


@pytest.mark.parametrize(("apart", "told"), [(8.0, True), (30.0, False)])
def test_a_swing_from_lock_to_lock_counts_within_the_vehicles_length(straight: Result, *, apart: float, told: bool) -> None:
    kappa, most = gentle(straight), straight.drive.vehicle.max_curvature
    kappa[40:44], kappa[40 + int(2 * apart) :][:4] = 0.9 * most, -0.9 * most  # the bus is 12 m long
    texts = steered(straight, kappa)
    assert any("from lock to lock" in text for text in texts) is told
