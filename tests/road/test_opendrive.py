"""OpenDRIVE: curves against closed forms, lanes against their widths, and routes over the lanes of real junctions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import fresnel

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError, RoadError
from hdvplan.road.load import load_road
from hdvplan.road.load_opendrive import read_opendrive
from hdvplan.road.opendrive import Geometry, OdrRoad, read_roads
from hdvplan.road.options import RoadOptions
from hdvplan.road.road import Road

FILES = Path(__file__).parent / "files"
U = np.linspace(0.0, 30.0, 61)

HEADER = '<OpenDRIVE><header revMajor="1" revMinor="4">{header}</header>{roads}</OpenDRIVE>'
ROAD = """<road id="{id}" length="{length}"{rule}><planView>{view}</planView><lanes>{offset}{sections}</lanes></road>"""
LINE = '<geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="{length}"><line/></geometry>'
SECTION = '<laneSection s="{s}"><left>{left}</left><right>{right}</right></laneSection>'
LANE = '<lane id="{id}" type="{kind}"><width sOffset="0" a="{a}" b="{b}" c="0" d="0"/></lane>'


def lane(number: int, a: float = 3.0, b: float = 0.0, kind: str = "driving") -> str:
    return LANE.format(id=number, kind=kind, a=a, b=b)


def straight(
    number: str,
    x: float = 0.0,
    *,
    y: float = 0.0,
    heading: float = 0.0,
    length: float = 40.0,
    sections: str = "",
    offset: str = "",
    rule: str = "",
) -> str:
    view = LINE.format(x=x, y=y, heading=heading, length=length)
    sections = sections or SECTION.format(s=0, left=lane(1, 3.5), right=lane(-1))
    return ROAD.format(id=number, length=length, view=view, offset=offset, sections=sections, rule=rule)


def written(tmp_path: Path, *roads: str, header: str = "") -> Path:
    path = tmp_path / "map.xodr"
    path.write_text(HEADER.format(header=header, roads="".join(roads)), encoding="utf-8")
    return path


def test_lines_arcs_and_spirals_are_where_closed_forms_have_them() -> None:
    line = Geometry(0.0, 1.0, 2.0, 0.5, 30.0, "line", (0.0, 0.0)).at(U)
    np.testing.assert_allclose(line.x, 1.0 + U * np.cos(0.5), atol=1e-12)
    arc = Geometry(0.0, 0.0, 0.0, 0.0, 30.0, "arc", (-0.2, -0.2)).at(U)  # turns by 6 rad
    np.testing.assert_allclose(np.stack([arc.x, arc.y]), [5.0 * np.sin(0.2 * U), 5.0 * np.cos(0.2 * U) - 5.0], atol=1e-12)
    spiral = Geometry(0.0, 0.0, 0.0, 0.0, 30.0, "spiral", (0.0, 0.15)).at(U)
    scale = np.sqrt(np.pi * 30.0 / 0.15)  # x + iy = scale times the Fresnel integrals of u / scale
    sine, cosine = fresnel(U / scale)
    np.testing.assert_allclose(np.stack([spiral.x, spiral.y]), scale * np.stack([cosine, sine]), atol=1e-10)
    np.testing.assert_allclose(spiral.sharpness, 0.005, atol=1e-9)


@pytest.mark.parametrize(
    ("kind", "values", "extent"),
    [("poly3", (0.0, 0.1, 0.01, -2e-4), 1.0), ("paramPoly3", (0.0, 29.0, 1.0, -0.5, 0.0, 1.0, 8.0, -3.0), 1.0)],
)
def test_headings_and_curvatures_of_cubics_are_derivatives_of_their_positions(kind: str, values: tuple[float, ...], extent: float) -> None:
    geometry = Geometry(0.0, 5.0, -2.0, 0.3, 30.0, kind, values, extent)
    here, ahead = geometry.at(U[1:-1]), geometry.at(U[1:-1] + 1e-4)
    moved = np.stack([ahead.x - here.x, ahead.y - here.y])
    step = np.hypot(*moved)
    middle = here.heading + 0.5e-4 * here.curvature
    np.testing.assert_allclose(np.arctan2(moved[1], moved[0]), middle, atol=1e-6)  # second order in the step
    np.testing.assert_allclose((ahead.heading - here.heading) / step, here.curvature, atol=1e-5)


def test_a_poly3_goes_by_its_arclength() -> None:
    b, c, d = 0.1, 0.01, -2e-4
    end = Geometry(0.0, 0.0, 0.0, 0.0, 30.0, "poly3", (0.0, b, c, d)).at(np.array([30.0]))
    length, _ = quad(lambda u: np.hypot(1.0, b + 2.0 * c * u + 3.0 * d * u**2), 0.0, float(end.x[0]))
    assert length == pytest.approx(30.0, abs=1e-7)


def integrated(road: OdrRoad, s: FloatArray) -> FloatArray:
    """Return x, y along a reference line by integrating its curvature records as an ordinary differential equation."""
    places = []
    for geometry in road.geometries:
        first, last = geometry.values
        rate = (last - first) / geometry.length

        def motion(u: float, z: FloatArray, first: float = first, rate: float = rate) -> list[float]:
            return [float(np.cos(z[2])), float(np.sin(z[2])), first + rate * u]

        mine = s[(s >= geometry.s) & (s < geometry.s + geometry.length)] - geometry.s
        start = [geometry.x, geometry.y, geometry.heading]
        places.append(solve_ivp(motion, (0.0, geometry.length), start, t_eval=mine, rtol=1e-10, atol=1e-10).y[:2].T)
    return np.concatenate(places)


@pytest.mark.parametrize(("file", "number"), [("bendplatz", "5"), ("bendplatz", "14"), ("neuweiler", "2"), ("neuweiler", "9")])
def test_a_reference_line_stays_within_a_millimetre_of_the_file_s_own_geometry(file: str, number: str) -> None:
    path = FILES / f"{file}.xodr"
    line = load_road(path, RoadOptions(road_ids=number, lane=0, max_curvature=0.2))
    assert line.smoothing is None
    road = read_roads(path)[0][number]
    s = np.linspace(0.0, road.length - 1e-6, 500)
    here = line.path.at(np.minimum(s, line.path.length))
    assert np.max(np.hypot(*(np.stack([here.x, here.y], axis=1) - integrated(road, s)).T)) < 1e-3  # promised; it is 1e-5 m


def table(road: Road, *s: float) -> FloatArray:
    assert road.limits is not None
    return road.limits.table(np.array(s))[:2]


def test_a_lane_runs_in_its_middle_between_its_own_edges(tmp_path: Path) -> None:
    sections = SECTION.format(s=0, left="", right=lane(-1, 1.0, kind="shoulder") + lane(-2, 3.0, 0.02))
    file = written(tmp_path, straight("7", sections=sections, offset='<laneOffset s="0" a="0.25" b="0" c="0" d="0"/>'))
    road = load_road(file)
    np.testing.assert_allclose(road.path.at(0.0).y, 0.25 - 1.0 - 1.5, atol=1e-6)
    half = np.array([1.5, 1.7]) * np.cos(np.arctan(0.01))  # the edges part by 0.02 m a metre: normals of the middle are oblique
    np.testing.assert_allclose(table(road, 0.0, 20.0), [half, -half], atol=1e-3)
    assert road.smoothing is None
    assert road.notes == ("map.xodr: over roads 7 lane -2",)


def test_left_lanes_are_driven_from_the_end_and_left_hand_traffic_the_other_way(tmp_path: Path) -> None:
    file = written(tmp_path, straight("7"))
    assert load_road(file, RoadOptions(lane=1)).path.at(0.0).x == pytest.approx(40.0, abs=1e-4)
    assert load_road(file, RoadOptions(road_ids="-7")).notes == ("map.xodr: over roads -7 lane 1",)
    assert load_road(file, RoadOptions(lane=-1)).path.at(0.0).x == pytest.approx(0.0, abs=1e-4)
    file = written(tmp_path, straight("7", rule=' rule="LHT"'))
    assert load_road(file, RoadOptions(lane=1)).path.at(0.0).x == pytest.approx(0.0, abs=1e-4)


def test_lane_0_is_the_reference_line_between_the_outermost_lanes(tmp_path: Path) -> None:
    sections = SECTION.format(s=0, left=lane(2, 2.0, kind="sidewalk") + lane(1, 3.5), right=lane(-1) + lane(-2, 3.25))
    road = load_road(written(tmp_path, straight("7", sections=sections)), RoadOptions(lane=0))
    np.testing.assert_allclose(table(road, 5.0, 35.0), [[3.5] * 2, [-6.25] * 2], atol=1e-9)


def test_a_route_goes_on_where_lanes_meet_and_gaps_between_roads_are_filled(tmp_path: Path) -> None:
    back = straight("c", 120.0, heading=np.pi, sections=SECTION.format(s=0, left=lane(1), right=lane(-1, 3.5)))
    file = written(tmp_path, straight("a"), straight("b", 40.1), back)
    for ids in ("a,c", "a,b,c", "a,-c"):
        road = load_road(file, RoadOptions(road_ids=ids))
        assert road.notes == ("map.xodr: over roads a lane -1, b lane -1, -c lane 1",)
        assert road.path.length == pytest.approx(120.0, abs=1e-3)
        np.testing.assert_allclose(road.path.at(np.array([1.0, 60.0, 119.0])).y, -1.5, atol=1e-3)
    assert load_road(file, RoadOptions(road_ids="c,a")).notes[0].endswith("c lane -1, -b lane 1, -a lane 1")
    with pytest.raises(RoadError, match="no lane leads over roads a, c, b in this order"):
        load_road(file, RoadOptions(road_ids="a,c,b"))


def test_linked_sections_go_on_over_a_step_that_the_file_has_itself(tmp_path: Path) -> None:
    first = SECTION.format(s=0, left="", right=lane(-1).replace("<width", '<link><successor id="-2"/></link><width'))
    second = SECTION.format(s=10, left="", right=lane(-1, 0.5, kind="none") + lane(-2))
    road = load_road(written(tmp_path, straight("7", sections=first + second)))
    assert road.path.length > 39.0
    assert road.smoothing is not None  # a step of half a metre cannot stay
    np.testing.assert_allclose(road.path.at(np.array([1.0, 39.0])).y, [-1.5, -2.0], atol=0.01)


def test_a_map_that_is_placed_has_longitude_and_latitude_and_one_that_is_not_has_none(tmp_path: Path) -> None:
    for projection, placed in (("+proj=utm +zone=32 +datum=WGS84", True), ("+proj=tmerc +lat_0=0 +lon_0=0 +k=1 +datum=WGS84", False)):
        file = written(tmp_path, straight("7", 500000.0, y=5e6), header=f"<geoReference><![CDATA[{projection}]]></geoReference>")
        assert (load_road(file).to_lonlat is not None) is placed


def test_the_header_s_offset_places_a_map_and_is_told(tmp_path: Path) -> None:
    """The map lay elsewhere on the globe, without a word."""
    projection, quarter = "<geoReference>+proj=utm +zone=32 +datum=WGS84</geoReference>", 0.5 * np.pi
    there = load_road(written(tmp_path, straight("7", 500000.0, y=5e6), header=projection))
    offset = f'{projection}<offset x="499000" y="4998000" z="7" hdg="{quarter}"/>'
    moved = load_road(written(tmp_path, straight("7", 2000.0, y=-1000.0), header=offset))  # turned: x 1000, y 2000, to the north
    assert there.to_lonlat is not None
    assert moved.to_lonlat is not None
    np.testing.assert_allclose(moved.path.at(np.zeros(1)).heading, there.path.at(np.zeros(1)).heading + quarter)
    starts = [road.path.to_plane(np.zeros(1), np.array([aside])) for road, aside in ((there, 1.5), (moved, 1.5))]  # of the reference lines
    np.testing.assert_allclose(np.ravel(starts[1]), np.ravel(starts[0]), atol=1e-6)
    np.testing.assert_allclose(moved.to_lonlat(*starts[1]), there.to_lonlat(*starts[0]), atol=1e-9)
    assert "coordinates are moved by the header's offset x 499000.0, y 4998000.0 m and turned by 90.0000 degrees" in moved.notes[1]
    with pytest.raises(RoadError, match="x of <offset> is 'far', not a number"):
        load_road(written(tmp_path, straight("7", 0.0), header=f'{projection}<offset x="far"/>'))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, r"16 roads, and none is chosen; the longest are \d+ \(\d+ m\), "),
        ({"road_ids": "0,77"}, "no road has the id '77'; there are 0, 1"),
        ({"road_ids": "0", "lane": -7}, "road 0 has no lane -7; there are 2, 1, -1"),
        ({"road_ids": "4,6"}, "no lane leads over roads 4, 6 in this order"),
    ],
)
def test_a_route_that_cannot_be_is_refused_with_what_there_is(options: dict[str, object], message: str) -> None:
    with pytest.raises(RoadError, match=message):
        load_road(FILES / "bendplatz.xodr", RoadOptions(**options))  # type: ignore[arg-type]


def test_a_turn_at_a_real_junction_keeps_to_the_lane_that_leads_there() -> None:
    road = load_road(FILES / "bendplatz.xodr", RoadOptions(road_ids="2,1"))
    assert road.notes == ("bendplatz.xodr: over roads -2 lane 1, 12 lane -1, 1 lane -1",)
    raw = read_opendrive(FILES / "bendplatz.xodr", road_ids="2,1", lane=None)
    assert road.smoothing is not None  # the file's roads meet with gaps of centimetres
    assert road.smoothing.max_deviation < 0.05
    _, moved = road.path.project(raw.points[:, 0], raw.points[:, 1], np.linspace(0.0, road.path.length, len(raw.points)))
    assert np.mean(np.abs(moved) < 1e-4) > 0.9  # elsewhere the middle is where the file has it
    assert raw.sides is not None
    assert road.kerbs is not None
    for side, kerb in zip(raw.sides, road.kerbs.kerbs, strict=True):  # the kerbs are the lane's edges, wherever smoothing moved the middle
        np.testing.assert_array_equal(kerb.points, side)


def test_a_roundabout_is_driven_over_nine_roads() -> None:
    road = load_road(FILES / "neuweiler.xodr", RoadOptions(road_ids="0,5"))
    assert len(road.notes[0].split(", ")) == 9
    assert road.path.length == pytest.approx(155.5, abs=1.0)


@pytest.mark.parametrize("ids", [("0", "5"), ["0", "5"], " 0, 5"])
def test_road_ids_may_be_given_one_by_one(ids: str | list[str]) -> None:
    road, wanted = (load_road(FILES / "neuweiler.xodr", RoadOptions(road_ids=given)) for given in (ids, "0,5"))
    np.testing.assert_array_equal(road.path.coefficients, wanted.path.coefficients)


@pytest.mark.parametrize("ids", [5, (0, 5), (), [None]])
def test_road_ids_that_are_no_text_are_refused(ids: object) -> None:
    with pytest.raises(OptionError, match="road_ids must be ids of roads as text, not"):
        RoadOptions(road_ids=ids)  # type: ignore[arg-type] # that is the point
