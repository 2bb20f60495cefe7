"""Projection: lengths are true, the way back is exact, and unsuitable systems are refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pyproj import Geod, Transformer

from hdvplan.errors import RoadError
from hdvplan.road.crs import parse_crs, to_plane


@given(lon=st.floats(-180.0, 180.0), lat=st.floats(-80.0, 80.0), bearing=st.floats(0.0, 360.0))
def test_lengths_agree_with_the_geodesic_and_points_return(lon: float, lat: float, bearing: float) -> None:
    geod = Geod(ellps="WGS84")
    lon_end, lat_end, _ = geod.fwd(lon, lat, bearing, 5000.0)
    points = np.array([[lon, lat], [lon_end, lat_end]])  # may cross the antimeridian
    plane = to_plane(points)
    length = float(np.hypot(*(plane.points[1] - plane.points[0])))
    assert abs(length / 5000.0 - 1.0) < 1e-6  # scale error (x/R)^2/2 at 2.5 km: 8e-8
    back = np.stack(plane.to_lonlat(plane.points[:, 0], plane.points[:, 1]), axis=1)
    turn = np.abs(back - points) % 360.0
    assert np.all(np.minimum(turn, 360.0 - turn) < 1e-8)  # 1 mm


def test_degrees_in_a_system_of_metres_are_refused() -> None:
    with pytest.raises(RoadError, match="look like degrees, but EPSG:32632 is not in degrees") as raised:
        to_plane(np.array([[7.43, 43.74], [7.4301, 43.7401], [7.4302, 43.7402]]), "EPSG:32632")
    assert str(raised.value.hint).endswith("leave it out")


@pytest.mark.parametrize("name", ["nonsense", "EPSG:\udcff"])
def test_what_is_no_system_is_refused(name: str) -> None:
    with pytest.raises(RoadError, match="unknown coordinate reference system"):
        parse_crs(name)


def test_another_geographic_system_is_projected_too() -> None:
    plane = to_plane(np.array([[11.97, 57.70], [11.97, 57.71]]), "EPSG:4258")
    assert float(np.hypot(*(plane.points[1] - plane.points[0]))) == pytest.approx(1113.7, abs=0.5)  # meridian arc at 57.7 degrees


@pytest.mark.parametrize("off", [0.0, 0.56e-9, 1.2e-9, -1e-9, 3e-9, 0.0123456789])
def test_a_plane_of_ours_is_reached_as_proj_itself_finds_the_way(off: float) -> None:
    points = np.array([[13.26, 53.55], [13.34, 53.65]]) + off
    plane = to_plane(points)
    there = Transformer.from_crs("OGC:CRS84", plane.to_lonlat.plane, always_xy=True)
    np.testing.assert_array_equal(plane.points, np.stack(there.transform(*points.T), axis=1))
    back = there.transform(plane.points[:, 0], plane.points[:, 1], direction="INVERSE")
    np.testing.assert_allclose(plane.to_lonlat(*plane.points.T), back, rtol=0.0, atol=1e-13)  # rounding of degrees


@pytest.mark.parametrize("lon", [179.999, -179.999])
def test_longitudes_go_on_across_the_antimeridian_so_that_areas_do_not_wrap(lon: float) -> None:
    points = np.array([[lon, -17.0], [-lon, -17.0]])
    plane = to_plane(points)
    east, _ = plane.to_lonlat(plane.points[:, 0], plane.points[:, 1])
    assert np.diff(east)[0] == pytest.approx(0.002 * np.sign(lon), abs=1e-9)  # not 359.998
    utm = to_plane(np.array([[816400.0, 8118000.0], [816700.0, 8118000.0]]), "EPSG:32760")  # zone 60, to either side of 180 degrees
    east, _ = utm.to_lonlat(utm.points[:, 0], utm.points[:, 1])
    assert 179.9 < east[0] < 180.1
    assert 0.0 < east[1] - east[0] < 0.01


@pytest.mark.parametrize("name", ["OGC:CRS84", "EPSG:4258", "EPSG:3006"])
def test_the_ways_into_the_plane_and_back_pickle(name: str) -> None:
    points = np.array([[674000.0, 6580000.0], [674100.0, 6580200.0]] if name == "EPSG:3006" else [[11.97, 57.70], [11.98, 57.71]])
    plane = to_plane(points, name)
    again = pickle.loads(pickle.dumps(plane))  # noqa: S301 - our own bytes
    assert (again.to_lonlat, again.into) == (plane.to_lonlat, plane.into)
    x, y = plane.points.T
    np.testing.assert_array_equal(again.to_lonlat(x, y), plane.to_lonlat(x, y))
    np.testing.assert_array_equal(again.into(points), plane.points)


@pytest.mark.parametrize(
    "name",
    [
        "EPSG:3395",  # Mercator on the ellipsoid
        "EPSG:3857+5773",  # with heights
        "+proj=eqc +ellps=WGS84 +units=m",  # degrees drawn as squares
        "EPSG:32631",  # UTM, four zones away
    ],
)
def test_systems_in_which_lengths_are_wrong_are_refused_by_how_much(name: str) -> None:
    x, y = Transformer.from_crs("OGC:CRS84", name, always_xy=True).transform(np.array([27.90, 27.91]), np.array([57.70, 57.70]))
    with pytest.raises(RoadError, match=r"lengths .*are wrong by \+?\d"):
        to_plane(np.stack([x, y], axis=1), name)


def test_eastings_and_northings_in_each_other_s_place_are_asked_for() -> None:
    with pytest.raises(RoadError, match=r"lengths in EPSG:3006 are wrong by") as caught:
        to_plane(np.array([[6398000.0, 319000.0], [6398040.0, 319000.0]]), "EPSG:3006")
    assert str(caught.value.hint).startswith("are x east and y north?")


@pytest.mark.parametrize("name", ["EPSG:32632", "EPSG:32633", "EPSG:3006", "EPSG:3035"])
def test_systems_of_a_neighbouring_zone_and_of_all_europe_are_good_enough(name: str) -> None:
    x, y = Transformer.from_crs("OGC:CRS84", name, always_xy=True).transform(np.array([11.97, 11.98]), np.array([57.70, 57.70]))
    assert to_plane(np.stack([x, y], axis=1), name).points.shape == (2, 2)
