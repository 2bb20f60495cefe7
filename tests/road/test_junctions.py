"""Junctions: the kerbs of all arms, drawn as they come, bound the street in which a vehicle turns from one arm into another."""

from __future__ import annotations

import numpy as np
import pytest
import shapely
from hypothesis import Phase, assume, example, given, settings
from hypothesis import strategies as st

from hdvplan import api
from hdvplan.answers import YES
from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.judging.bodies import outlines_of
from hdvplan.judging.result import Result
from hdvplan.judging.verdict import verdict_of
from hdvplan.road.assemble import road_of as raw_of
from hdvplan.road.features import Feature
from hdvplan.road.line import Line, smoothed
from hdvplan.road.options import RoadOptions
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import Vehicle

CITARO, ARTICULATED = load_vehicle("citaro"), load_vehicle("articulated-bus")
DRAWN_M, DRIVEN_M = 50.0, 35.0  # of every arm, and of two
LEAST_RAD = 0.7  # between two arms: less leaves no kerb between them
CHORD_M = 0.004  # of the corners' arcs
BESIDE_M = 0.012  # that a judged body may lie over a kerb: what counts as kept, and chords


def street_of(angles: FloatArray, half_widths: FloatArray, radius: float) -> shapely.Polygon:
    """Return the area of arms in these directions [rad], whose kerbs meet in arcs."""
    ends = 90.0 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    arms = shapely.buffer(shapely.linestrings([[(0.0, 0.0), end] for end in ends]), half_widths, cap_style="flat")
    whole = shapely.union_all([*arms, shapely.Point(0.0, 0.0).buffer(max(half_widths))])
    street = whole.buffer(radius, quad_segs=32).buffer(-radius, quad_segs=32).simplify(CHORD_M)
    assert isinstance(street, shapely.Polygon)
    return street


def turned(vehicle: Vehicle, line: FloatArray, kerbs: list[FloatArray]) -> Result:
    features = [Feature({"type": "LineString", "coordinates": line.tolist()}, {})]
    features += [Feature({"type": "LineString", "coordinates": kerb.tolist()}, {"edge": "left"}) for kerb in kerbs]
    road, _ = smoothed(Line("junction", raw_of(features, "junction", RoadOptions()), RoadOptions()))
    return api.plan(Case(road, vehicle))


def kerbs_of(street: shapely.Polygon, *, cut: bool) -> list[FloatArray]:
    """Return the kerbs as far as they are drawn; ``cut`` in two, one half against the other, and in another order."""
    drawn = shapely.line_merge(shapely.intersection(shapely.LineString(street.exterior.coords), shapely.Point(0.0, 0.0).buffer(DRAWN_M)))
    kerbs = [shapely.get_coordinates(kerb) for kerb in shapely.get_parts(drawn)]
    if not cut:
        return kerbs
    halves = [(kerb[: len(kerb) // 2 + 1], kerb[len(kerb) // 2 :][::-1]) for kerb in kerbs if len(kerb) > 2]
    return [half for pair in halves[::-1] for half in pair] + [kerb for kerb in kerbs if len(kerb) == 2]


@pytest.mark.slow
@given(
    gaps=st.lists(st.floats(1.0, 4.0), min_size=3, max_size=5), half_widths=st.lists(st.floats(2.6, 4.5), min_size=5, max_size=5),
    radius=st.sampled_from([0.0, 3.0, 6.0, 10.0]), to=st.integers(1, 4), vehicle=st.sampled_from([CITARO, ARTICULATED]),
)  # fmt: skip
@example(gaps=[0.866, 3.344, 2.073], half_widths=[3.99, 2.63, 2.88, 3.0, 3.0], radius=0.0, to=1, vehicle=CITARO)  # refused for a wall
@example(  # a kerb led across the street, from one side street into another: NO by 13 m
    gaps=[0.882, 1.137, 2.57, 0.89, 0.805], half_widths=[4.49, 2.79, 4.05, 3.22, 3.18], radius=6.0, to=4, vehicle=ARTICULATED
)
@settings(derandomize=True, phases=[Phase.explicit, Phase.generate])  # shrinking takes a minute
def test_any_junction_is_the_street_between_its_kerbs_however_they_are_drawn(
    gaps: list[float], half_widths: list[float], radius: float, to: int, vehicle: Vehicle
) -> None:
    angles = np.cumsum([0.0, *gaps[:-1]]) * 2.0 * np.pi / sum(gaps)
    assume(to < len(gaps) and min(gaps) * 2.0 * np.pi / sum(gaps) > LEAST_RAD)
    street = street_of(angles, np.array(half_widths[: len(gaps)]), radius)
    line = DRIVEN_M * np.array([[1.0, 0.0], [0.0, 0.0], [np.cos(angles[to]), np.sin(angles[to])]])
    results = [turned(vehicle, line, kerbs_of(street, cut=cut)) for cut in (False, True)]
    whole, pieces = (verdict_of(result) for result in results)
    assert pieces.word == whole.word
    assert pieces.spare == pytest.approx(whole.spare, abs=0.02 if whole.word == YES else 0.1)  # metres: other local optima
    for result in results if whole.word == YES else ():
        swept = outlines_of(result.drive).reshape(len(result.drive.poses_s), -1)[result.drive.poses_s <= result.drive.road.path.length]
        assert shapely.union_all(swept).difference(street.buffer(BESIDE_M)).area < 1e-4
