"""One step between two normals: from a single pose, any steering in between ends in what the step reaches."""

from __future__ import annotations

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from hdvplan import core
from hdvplan.arrays import FloatArray
from hdvplan.proof.reach import CELLS, GRID, Grid
from hdvplan.proof.space import MOST, Frame, frame_record

KAPPA = 0.1  # [1/m]
SAMPLES = 4000  # of a drive: the crossing is interpolated between two, to a nanometre
OFFSET_M, HEADING = 1e-8, 1e-8

reach_next = core.function("hdv_reach_next", core.REAL, core.POINTER, core.POINTER, core.INT, *[core.POINTER] * 4, returns=core.INT)
shares = st.floats(0.0, 1.0)
curvatures = st.lists(st.one_of(st.sampled_from([-KAPPA, KAPPA]), st.floats(-KAPPA, KAPPA)), min_size=3, max_size=3)


def frames(step: float, curvature: float) -> Frame:
    """Return two normals ``step`` apart on a circle, or a straight line."""
    s = np.array([0.0, step])
    heading, chord = curvature * s, s * np.sinc(0.5 * curvature * s / np.pi)
    return Frame(s, chord * np.cos(0.5 * heading), chord * np.sin(0.5 * heading), heading)


def crossing(frame: Frame, e: float, heading: float, kappas: list[float], switches: list[float]) -> tuple[float, float] | None:
    """Return offset and heading at the second normal; the curvature switches at shares of the road's step. None where it is not met."""
    step = float(frame.s[1])
    length = 4.0 * (step + abs(e) * abs(float(frame.heading[1])))
    arc = length / SAMPLES
    at = arc * (np.arange(SAMPLES) + 0.5)
    kappa = np.array(kappas)[np.searchsorted(np.sort(switches) * step, at)]
    turned = heading + np.concatenate([[0.0], np.cumsum(kappa * arc)])
    middle = 0.5 * (turned[1:] + turned[:-1])
    x = np.concatenate([[0.0], np.cumsum(arc * np.cos(middle))]) - frame.x[1]
    y = np.concatenate([[0.0], np.cumsum(arc * np.sin(middle))]) + e - frame.y[1]
    cos, sin = np.cos(frame.heading[1]), np.sin(frame.heading[1])
    ahead: FloatArray = x * cos + y * sin
    over = np.flatnonzero(ahead >= 0.0)
    if not len(over) or over[0] == 0:
        return None
    j = int(over[0])
    share = ahead[j - 1] / (ahead[j - 1] - ahead[j])
    offset = y * cos - x * sin
    return float(offset[j - 1] + share * (offset[j] - offset[j - 1])), float(turned[j - 1] + share * (turned[j] - turned[j - 1]))


def reached(frame: Frame, e: float, j: int, grid: Grid) -> tuple[np.ndarray[tuple[int], np.dtype[np.int64]], FloatArray]:
    """Return what one step leads to from cell ``j`` with a single offset."""
    (before, former), (number, pieces) = ((np.zeros(grid.cells, np.int64), np.zeros((grid.cells, MOST, 2))) for _ in range(2))
    before[j], former[j, 0] = 1, e
    left, slopes, stations = np.array([j, j + 1, 0, grid.cells]), np.empty((2 * grid.cells, 2)), frame_record(frame)
    old, new = (np.array([tuple(map(core.address, one))], CELLS) for one in ((before, former), (number, pieces)))
    layout = np.array([grid], GRID)
    reach_next(KAPPA, core.address(stations), core.address(layout), 1, *map(core.address, (old, left, new, slopes)))
    return number, pieces


@settings(max_examples=150, deadline=None)
@given(
    st.sampled_from([0.05, 0.1, 0.2]),
    st.sampled_from([2e-4, 1e-3]),
    st.floats(-0.1, 0.1),
    st.floats(-4.0, 4.0),
    st.floats(-1.0, 1.0),
    shares,
    curvatures,
    st.lists(shares, min_size=2, max_size=2),
)
def test_any_steering_between_two_normals_ends_in_what_the_step_reaches(
    step: float, cell: float, curvature: float, e: float, off: float, share: float, kappas: list[float], switches: list[float]
) -> None:
    frame = frames(step, curvature)
    grid = Grid(-1.35, cell, int(2.7 / cell))
    j = int((off - grid.first) / cell)
    found = crossing(frame, e, grid.first + (j + share) * cell, kappas, switches)
    assume(found is not None)
    assert found is not None
    offset, heading = found
    number, pieces = reached(frame, e, j, grid)
    cells = {int((heading + by - grid.first) / cell) for by in (-HEADING, HEADING)}
    held = [(k, p) for k in cells for p in range(number[k]) if pieces[k, p, 0] - OFFSET_M <= offset <= pieces[k, p, 1] + OFFSET_M]
    assert held, f"{offset} is not held at {heading}: {[pieces[k, : number[k]] for k in cells]}"


def test_a_step_reaches_hardly_more_than_it_must() -> None:
    frame, grid = frames(0.2, 0.05), Grid(-1.35, 2e-4, 13500)
    j = 6750  # along the road
    number, pieces = reached(frame, 1.0, j, grid)
    filled = np.flatnonzero(number)
    turn = KAPPA * 0.2 / grid.size  # cells, at a radius of 20 m less the offset of 1 m somewhat fewer
    assert 0.95 * turn - 1.0 <= filled[-1] - j <= turn + 2.0
    wide = pieces[filled, 0, 1] - pieces[filled, 0, 0]
    assert np.max(wide) < 0.2 * (0.5 * KAPPA * 0.2 + 2.0 * grid.size)  # the mean heading varies by half of the turn at most
