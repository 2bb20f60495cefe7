"""CSV roads: every layout by its header, every mistake by its line and column."""

from __future__ import annotations

import numpy as np
import pytest

from hdvplan.errors import RoadError
from hdvplan.road.load_csv import read_csv
from hdvplan.road.options import RoadOptions


@pytest.mark.parametrize(
    "text",
    [
        "x_m,y_m\n0,0\n10,1\n",
        "x,y\n0,0\n10,1\n",
        "# x_m,y_m\n0,0\n10,1\n",
        "# a comment, with commas\n\n#x_m;y_m\n0;0\n# another\n10;1\n",
        '"y" , "x"\n0,0\n1,10\n',
    ],
)
def test_positions_are_found_by_name(text: str) -> None:
    np.testing.assert_array_equal(read_csv(text, "f").points, [[0.0, 0.0], [10.0, 1.0]])


def test_tum_widths_have_the_right_side_first() -> None:
    raw = read_csv("# x_m,y_m,w_tr_right_m,w_tr_left_m\n0,0,2,3\n10,0,2,3\n", "f")
    assert raw.reaches is not None
    np.testing.assert_array_equal(raw.reaches[:, 0], [3.0, 2.0, 3.0, 2.0])


def test_sweep_limits_are_read_beside_the_widths() -> None:
    raw = read_csv("x,y,left,right,left_sweep,right_sweep\n0,0,3,2,4,2\n10,0,3,2,4,2\n", "f")
    assert raw.reaches is not None
    np.testing.assert_array_equal(raw.reaches[:, 0], [3.0, 2.0, 4.0, 2.0])


def test_longitude_and_latitude_are_projected_with_true_lengths() -> None:
    raw = read_csv("lon,lat\n-70.0,45.0\n-70.0,45.01\n", "f")
    # a hundredth of a degree of latitude at 45 degrees on WGS84 is 1111.3 m (meridian arc)
    assert np.hypot(*np.diff(raw.points, axis=0)[0]) == pytest.approx(1111.32, abs=0.05)
    assert raw.to_lonlat is not None


def test_swapped_longitude_and_latitude_are_said_to_be() -> None:
    with pytest.raises(RoadError) as caught:
        read_csv("lon,lat\n43.7,107.4\n43.8,107.5\n", "f")
    assert "swapped" in str(caught.value.hint)


def test_a_system_gives_map_coordinates_their_longitude_and_latitude() -> None:
    raw = read_csv("x,y\n500000,6400000\n500100,6400000\n", "f", RoadOptions(crs="EPSG:3006"))
    np.testing.assert_array_equal(raw.points[0], [500000.0, 6400000.0])
    assert raw.to_lonlat is not None
    lon, _ = raw.to_lonlat(raw.points[:, 0], raw.points[:, 1])
    assert lon[0] == pytest.approx(15.0, abs=1e-9)  # SWEREF 99 TM's central meridian
    with pytest.raises(RoadError, match="degrees, but EPSG:3006 is projected"):
        read_csv("lon,lat\n11,57\n11,58\n", "f", RoadOptions(crs="EPSG:3006"))


@pytest.mark.parametrize(
    "text",
    [
        "X,Y\n0.5,0\n10,1\n",
        "easting;northing\n0,5;0\n10;1\n",
        "Rechtswert [m]\tHochwert [m]\n0,5\t0\n10\t1\n",
        "N|E\n0|0.5\n1|10\n",
        "sep=;\nX;Y;\n0,5;0;\n10;1;\n;;\n",
        '"X" , "Y"\r\n"0,5","0"\r\n"10","1"\r\n',
        "point_x,point_y\n0.5,0\n10,1",
    ],
)
def test_tables_are_read_as_spreadsheets_write_them(text: str) -> None:
    raw = read_csv(text, "f")
    np.testing.assert_array_equal(raw.points, [[0.5, 0.0], [10.0, 1.0]])
    assert not raw.notes


@pytest.mark.parametrize(
    "header",
    ["Längengrad;Breitengrad", "Longitude;Latitude", "LON;LAT", "lng;lat", "Länge;Breite", "Longitud;Latitud", "Longitudine;Latitudine"],
)
def test_longitude_and_latitude_have_many_names(header: str) -> None:
    raw = read_csv(f"{header}\n11,95;57,7\n11,951;57,7\n", "f")
    assert np.hypot(*np.diff(raw.points, axis=0)[0]) == pytest.approx(59.6, abs=0.1)  # a thousandth of a degree there


@pytest.mark.parametrize(
    ("header", "cells", "sides"),
    [
        ("left_m,right_m", "3,2", (3.0, 2.0)),
        ("Breite rechts,Breite links", "2,3", (3.0, 2.0)),
        ("Vänster,Höger", "3,2", (3.0, 2.0)),
        ("width_m", "7", (3.5, 3.5)),
        ("Bredd", "7", (3.5, 3.5)),
        ("Breite", "7", (3.5, 3.5)),
        ("largeur (m)", "7", (3.5, 3.5)),
    ],
)
def test_widths_have_many_names(header: str, cells: str, sides: tuple[float, float]) -> None:
    raw = read_csv(f"lon,lat,{header}\n11.95,57.7,{cells}\n11.951,57.7,{cells}\n", "f")
    assert raw.reaches is not None
    np.testing.assert_allclose(raw.reaches[:, 1], [*sides, *sides])
    assert not raw.notes


def test_other_columns_are_not_read_but_noted_with_what_may_have_been_meant() -> None:
    raw = read_csv("x,y,name,left_swep\n0,0,A,\n10,0,B,x\n", "f")
    assert raw.notes == ("f: columns name, left_swep not read; did you mean left_sweep by left_swep?",)


def test_coordinates_that_can_only_be_degrees_are_read_as_such_with_a_note() -> None:
    raw = read_csv("X,Y\n11.97,57.70\n11.971,57.701\n11.972,57.702\n", "f")
    assert raw.to_lonlat is not None
    assert raw.notes == ("f: columns X, Y are read as longitude and latitude, for metres they are too close together",)
    told = read_csv("X,Y\n11.97,57.70\n11.971,57.701\n11.972,57.702\n", "f", RoadOptions(crs="EPSG:4326"))
    np.testing.assert_allclose(told.points, raw.points)
