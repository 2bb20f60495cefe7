"""Lines that are rounded where their pieces meet, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.arrays import FloatArray
from hdvplan.road.arcs import rounded, wrapped
from hdvplan.road.smooth import smoothing_of
from hdvplan.road.splines import path_through

U = np.linspace(0.0, 20.0, 81)


def pieces(turn: float, step: float, radius: float = np.inf) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return a straight of 20 m and one of 20 m, or an arc, that goes on beside its end, at an angle."""
    first = np.stack([U, np.zeros(81)], axis=1)
    angle = U / radius
    second = np.stack([U, np.zeros(81)], axis=1) if np.isinf(radius) else radius * np.stack([np.sin(angle), 1.0 - np.cos(angle)], axis=1)
    cos, sin = np.cos(turn), np.sin(turn)
    second = second @ np.array([[cos, sin], [-sin, cos]]) + np.array([20.0, step])
    heading = np.concatenate([np.zeros(81), turn + angle])
    return np.concatenate([first, second]), heading, np.concatenate([np.zeros(81), np.full(81, 1.0 / radius)])


def test_a_line_without_kinks_stays_as_it_is() -> None:
    points, heading, curvature = pieces(0.0, 0.0, 15.0)  # curvature may jump: the line itself does not
    assert rounded(points, heading, curvature) is points


@pytest.mark.parametrize(("turn", "step"), [(0.1, 0.0), (0.0, 0.1), (-0.05, 0.2), (0.02, 0.0)])
@pytest.mark.parametrize("radius", [np.inf, 20.0])
def test_kinks_and_gaps_are_rounded_near_them_alone(turn: float, step: float, radius: float) -> None:
    points, heading, curvature = pieces(turn, step, radius)
    line = rounded(points, heading, curvature)
    moved = np.hypot(*(line - points).T)
    far = np.abs(points[:, 0] - 20.0) > 5.0  # no rounding is longer
    assert np.max(moved[far]) == 0.0
    assert 0.0 < np.max(moved) < max(step, 10.0 * turn**2)  # a kink of 0.1 rad over 2 m to either side: some 5 cm
    dense = path_through(line, 0.125)
    assert dense is not None
    path, s = dense
    fine = path.at(np.linspace(0.0, path.length, 2000)).curvature
    assert np.max(np.abs(fine)) < 1.0 / radius + 0.13  # what a kink and a gap add at the most, together
    assert 0.5 * np.max(moved) < smoothing_of(path, points, s).max_deviation <= np.max(moved) + 1e-6  # along the normal, not to the point


def test_a_line_that_is_too_tight_is_left_to_smoothing() -> None:
    points, _, _ = pieces(0.0, 0.0, 5.0)
    assert path_through(points, 0.125) is None


def test_angles_are_wrapped_to_half_a_turn() -> None:
    np.testing.assert_allclose(wrapped(np.array([0.5, 4.0, -4.0])), [0.5, 4.0 - 2.0 * np.pi, 2.0 * np.pi - 4.0])
