"""Points that lie impossibly far from their neighbours."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from hdvplan.errors import RoadError
from hdvplan.road.checks import pointed_at, refuse_outliers
from hdvplan.road.load import load_road

DENSE = np.stack([np.arange(0.0, 100.0, 5.0), np.zeros(20)], axis=1)


@pytest.mark.parametrize(("row", "first"), [(0, 1), (1, 1), (10, 10), (18, 18), (19, 19)])
def test_an_outlier_is_refused_with_its_place(row: int, first: int) -> None:
    points = DENSE.copy()
    points[row, 1] = 20e3
    with pytest.raises(RoadError, match=f"f: points {first} and {first + 1} are 20 km apart, 4000 times"):
        refuse_outliers(points, None, "f")


def test_long_straights_between_dense_bends_and_repeated_points_are_no_outliers() -> None:
    refuse_outliers(np.concatenate([DENSE, DENSE + np.array([3000.0, 0.0])]), None, "f")  # 600 times the steps around
    refuse_outliers(np.array([[0.0, 0.0], [0.0, 0.0], [50e3, 0.0], [50e3, 0.0]]), None, "f")
    refuse_outliers(np.array([[0.0, 0.0], [50e3, 0.0]]), None, "f")


@pytest.mark.parametrize(
    ("header", "unit", "where"),
    [("x,y", 1.0, "x 35.0, y 400.0"), ("lon,lat", 1e-5, "0.00400 N, 0.00035 E")],
)
def test_a_stray_point_that_lengthens_the_line_is_named(tmp_path: Path, header: str, unit: float, where: str) -> None:
    """By its arclength alone nobody finds it: the line is not 430 m long without it."""
    points = unit * np.insert(DENSE, 7, [35.0, 400.0], axis=0)
    np.savetxt(tmp_path / "a.csv", points, "%.7f", ",", header=header, comments="# measured\n")
    with pytest.raises(RoadError, match=r"turns back on itself near s = 4\d\d m \(sharpest at line 10 of the file, " + where):
        load_road(tmp_path / "a.csv")
    line = {"type": "LineString", "coordinates": (points if unit < 1.0 else 1e-5 * points).tolist()}
    (tmp_path / "a.geojson").write_text(json.dumps(line), encoding="utf-8")
    with pytest.raises(RoadError, match=r"\(sharpest at point 8, 0\.00400 N, 0\.00035 E\)"):
        load_road(tmp_path / "a.geojson")


def test_a_refusal_without_a_place_or_far_from_any_turn_names_no_point() -> None:
    for refusal in (RoadError("no"), RoadError("no", s_m=200.0)):
        assert pointed_at(refusal, np.array([[0.0, 0.0], [30.0, 0.0], [0.0, 0.1]]), None, None) is refusal


def test_the_line_of_the_file_is_named_and_a_latitude_without_its_digits_is_refused(tmp_path: Path) -> None:
    rows = [f"11.9{number:03d},57.000000" for number in range(10)]
    (tmp_path / "a.csv").write_text("lon,lat\n# a comment\n" + "\n".join([*rows[:5], "11.905,5.7000", *rows[5:]]), encoding="utf-8")
    with pytest.raises(RoadError, match=r"a\.csv: lines 7 and 8 are "):
        load_road(tmp_path / "a.csv")
    (tmp_path / "b.csv").write_text("lon,lat\n" + "\n".join([*rows, "11.910,57."]), encoding="utf-8")
    with pytest.raises(RoadError, match=r"b\.csv, line 12, column lat: '57\.' has lost digits"):
        load_road(tmp_path / "b.csv")
