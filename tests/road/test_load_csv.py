"""CSV roads: every layout by its header, every mistake by its line and column, encodings, and points impossibly far apart."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path

import numpy as np
import pytest

from hdvplan.errors import RoadError
from hdvplan.road.checks import pointed_at, refuse_outliers, text_of
from hdvplan.road.load import load_road
from hdvplan.road.load_csv import read_csv
from hdvplan.road.options import RoadOptions
from hdvplan.road.parts import odd_points


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


ROWS = "".join(f"{11.95 + 1e-4 * number:.6f};57,7;Hafenstraße\n".replace(".", ",") for number in range(5))


def refused(path: Path, message: str, hint: str) -> None:
    with pytest.raises(RoadError, match=message) as caught:
        load_road(path)
    assert hint in str(caught.value.hint)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["big.csv", "big.geojson", "big.gpkg", "big.xodr"])
def test_a_file_of_200_mb_is_refused_before_it_is_read(tmp_path: Path, name: str) -> None:
    with (tmp_path / name).open("wb") as file:
        file.truncate(200_000_000)  # takes no space
    refused(tmp_path / name, "has 200 MB", f"road.gpkg {name}")


@pytest.mark.parametrize("name", ["road.zip", "road.csv", "road.gpkg", "road.geojson"])
def test_an_archive_is_refused_with_what_it_holds(tmp_path: Path, name: str) -> None:
    with zipfile.ZipFile(tmp_path / name, "w") as archive:
        archive.writestr("street.shp", b"")
        archive.writestr("street.dbf", b"")
    refused(tmp_path / name, "is a zip archive", "give the file in it: street.shp, street.dbf")


def test_packed_formats_are_refused_when_they_unpack_to_too_much_or_are_damaged(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.kmz", "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("doc.kml", bytes(70_000_000))
    refused(tmp_path / "a.kmz", "unpacks to 70 MB", "take out the road")
    content = (tmp_path / "a.kmz").read_bytes()
    (tmp_path / "b.kmz").write_bytes(content[: len(content) // 2])
    refused(tmp_path / "b.kmz", "damaged or cut-off", "fetch the file again")


def test_encrypted_files_are_refused(tmp_path: Path) -> None:
    with zipfile.ZipFile(tmp_path / "a.kmz", "w") as archive:
        archive.writestr("doc.kml", b"<kml/>")
    content = bytearray((tmp_path / "a.kmz").read_bytes())
    content[content.find(b"PK\x01\x02") + 8] |= 1  # the flag in the directory; Python cannot write encrypted archives
    (tmp_path / "a.kmz").write_bytes(content)
    refused(tmp_path / "a.kmz", "is encrypted", "without a password")
    (tmp_path / "a.xlsx").write_bytes(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1" + bytes(600))
    refused(tmp_path / "a.xlsx", "old or an encrypted Office file", ".xlsx or .csv")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "cp1252", "utf-16"])
def test_texts_are_read_in_the_encodings_of_spreadsheets(tmp_path: Path, encoding: str) -> None:
    (tmp_path / "a.csv").write_bytes(("Längengrad;Breitengrad;Straße\n" + ROWS).encode(encoding))
    assert text_of(tmp_path / "a.csv").startswith("Längengrad")
    road = load_road(tmp_path / "a.csv")
    assert road.path.length == pytest.approx(23.851, abs=1e-3)  # 4e-4 degrees of longitude at 57.7 degrees north on WGS84
    assert road.notes == ("a.csv: column Straße not read",)


DENSE = np.stack([np.arange(0.0, 100.0, 5.0), np.zeros(20)], axis=1)


@pytest.mark.parametrize(("row", "first"), [(0, 1), (1, 1), (10, 10), (18, 18), (19, 19)])
def test_an_outlier_is_refused_with_its_place(row: int, first: int) -> None:
    points = DENSE.copy()
    points[row, 1] = 20e3
    with pytest.raises(RoadError, match=f"f: points {first} and {first + 1} are 20 km apart, 4000 times"):
        refuse_outliers(points, None, "f")


@pytest.mark.parametrize(("first", "second", "where"), [(7, 8, "2 points, first at line 8"), (1, 2, "2 points, first at line 2")])
def test_points_in_the_wrong_order_are_told(first: int, second: int, where: str) -> None:
    points = DENSE.copy()
    assert odd_points(points, tuple(range(1, 21)), "f") == ()
    points[[first, second]] = points[[second, first]]
    (note,) = odd_points(points, tuple(range(1, 21)), "f")
    assert note == f"f: the line goes back on itself at {where} of the file: are its points in the right order?"
    jitter = np.repeat(DENSE, 2, axis=0) + np.tile([[0.1, 0.0], [-0.1, 0.0]], (20, 1))
    assert odd_points(jitter, None, "f") == ()


def test_a_point_that_alone_lies_aside_of_a_straight_is_told_and_a_chicane_is_not() -> None:
    straight = np.column_stack([np.arange(0.0, 200.0, 10.0), np.zeros(20)])
    straight[8, 1] = 12.0
    (note,) = odd_points(straight, None, "f")
    assert note == "f: point 9 lies 12.0 m off the straight of those before and behind it: is it a mistake?"
    for shape in ([3.0, 12.0, 3.0], [12.0, 12.0, 12.0], [2.5, 0.0, -2.5], [1.9, 0.0, 0.0]):
        straight[8:11, 1] = shape
        assert odd_points(straight, None, "f") == ()


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
