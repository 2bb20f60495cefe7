"""Road sources: files win over names, options are checked; shipped roads, the papers' and made-up ones are what they promise."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import shapely

from hdvplan.errors import OptionError, RoadError
from hdvplan.judging.fit import fit_of
from hdvplan.legs import load_legs
from hdvplan.road.line import is_closed
from hdvplan.road.load import load_road
from hdvplan.road.options import RoadOptions
from hdvplan.road.scenarios import Profile, roundabout, shipped, sturn_profile, turn_profile, uturn, uturn_articulated, uturn_profile
from hdvplan.vehicle.load import load_vehicle
from hdvplan.vehicle.model import MOST_CURVATURE

STRAIGHT = "x,y\n0,0\n50,0\n100,0\n"


def test_the_25_shipped_roads_are_found_with_their_licence() -> None:
    assert len(shipped()) == 25
    assert (shipped()["goteborg_nya_allen"].parent / "ODbL-1.0.txt").is_file()


@pytest.mark.parametrize("options", [RoadOptions(), RoadOptions(road_ids="1")])
def test_commonroad_is_refused_with_the_way_to_what_is_read(tmp_path: Path, options: RoadOptions) -> None:
    head = "<?xml version='1.0' encoding='UTF-8'?>\n<!-- a map -->\n"
    (tmp_path / "cr.xml").write_text(f"{head}<commonRoad commonRoadVersion='2020a'></commonRoad>", encoding="utf-8")
    with pytest.raises(RoadError, match=r"^cr\.xml is a CommonRoad file, which is not read") as caught:
        load_road(tmp_path / "cr.xml", options)
    assert "crdesigner" in str(caught.value.hint)


def test_a_shipped_map_is_found_by_its_name() -> None:
    by_name, by_file = (load_road(one, RoadOptions(road_ids="0,5")) for one in ("neuweiler", shipped("opendrive")["neuweiler"]))
    assert by_name.name == "neuweiler"
    assert by_name.path.length == by_file.path.length


@pytest.mark.slow
def test_every_shipped_road_loads_within_the_default_bounds() -> None:
    for name in shipped():
        smoothing = load_road(name).smoothing
        assert smoothing is not None
        assert smoothing.max_deviation <= 5.001  # 1 mm promised
        assert smoothing.max_curvature <= 1.01 * 0.125  # 1 % promised


def test_a_file_wins_over_a_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("uturn").write_text(STRAIGHT, encoding="utf-8")
    assert load_road("uturn").path.length == pytest.approx(100.0, abs=1e-9)


def test_an_unknown_name_suggests_the_nearest() -> None:
    with pytest.raises(RoadError, match="no road file, shipped road or scenario is called 'goteborg_nya_alen'") as caught:
        load_road("goteborg_nya_alen")
    assert "goteborg_nya_allen" in str(caught.value.hint)


def test_a_missing_file_and_a_folder_are_named(tmp_path: Path) -> None:
    with pytest.raises(RoadError, match="does not exist"):
        load_road(tmp_path / "none.csv")
    with pytest.raises(RoadError, match="is a folder"):
        load_road(tmp_path)


@pytest.mark.parametrize(
    ("source", "content", "options", "said"),
    [
        ("uturn", None, RoadOptions(crs="EPSG:3006"), "the scenario uturn has no use for --crs"),
        ("uturn", None, RoadOptions(lane=0), "the scenario uturn has no use for --lane"),
        ("road.csv", STRAIGHT, RoadOptions(layer="streets"), "road.csv: a CSV file has no use for --layer"),
        ("road.csv", STRAIGHT, RoadOptions(roles=("van=obstacle",)), "road.csv: a CSV file has no use for --role"),
        ("road.xodr", "<OpenDRIVE/>", RoadOptions(feature="A"), "road.xodr: an OpenDRIVE file has no use for --name"),
        ("road.json", '{"elements": []}', RoadOptions(crs="EPSG:3006"), "road.json: a file of OpenStreetMap has no use for --crs"),
    ],
)
def test_options_that_a_road_cannot_heed_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, source: str, content: str | None, options: RoadOptions, said: str
) -> None:
    monkeypatch.chdir(tmp_path)
    if content is not None:
        Path(source).write_text(content, encoding="utf-8")
    with pytest.raises(RoadError, match=said):
        load_road(source, options)


@pytest.mark.parametrize("options", [{"smooth": 0.0}, {"smooth": float("nan")}, {"max_curvature": 0.0}, {"max_curvature": 0.6}])
def test_impossible_options_are_refused(options: dict[str, float]) -> None:
    with pytest.raises(OptionError):
        RoadOptions(**options)  # type: ignore[arg-type]


def test_a_road_is_read_for_every_vehicle() -> None:
    assert RoadOptions().followed_by(MOST_CURVATURE).max_curvature < MOST_CURVATURE


def test_widths_travel_to_the_smoothed_line(tmp_path: Path) -> None:
    file = tmp_path / "road.csv"
    file.write_text("# x_m,y_m,w_tr_right_m,w_tr_left_m\n0,0,2,3\n0,0,2,3\n50,0,2,3\n100,0,4,5\n", encoding="utf-8")
    road = load_road(file)
    assert road.smoothing is not None
    assert road.smoothing.duplicates == 1
    assert road.limits is not None
    # half way between the last two points the widths are half way too; linear in s, so exact on a straight
    np.testing.assert_allclose(road.limits.table(np.array([0.0, 75.0])), [[3.0, 4.0], [-2.0, -3.0]] * 2, atol=1e-6)


def test_a_profile_is_not_smoothed(tmp_path: Path) -> None:
    file = tmp_path / "road.csv"
    file.write_text("s,kappa,left,right\n10,0,3,3\n30,0,3,3\n40,0.1,2,3\n60,0.1,2,3\n", encoding="utf-8")
    road = load_road(file)
    assert road.smoothing is None
    assert road.path.length == pytest.approx(50.0)
    assert float(road.path.at(40.0).curvature) == pytest.approx(0.1, abs=1e-6)  # a knot of the table
    assert road.limits is not None
    np.testing.assert_allclose(road.limits.s, [0.0, 20.0, 30.0, 50.0])


def test_a_road_is_closed_only_if_it_goes_on_where_it_began() -> None:
    square = np.array([[0.0, 0.0], [50.0, 0.0], [50.0, 50.0], [0.0, 50.0], [0.0, 0.0]])
    assert is_closed(square)
    assert not is_closed(square[:-1])
    assert not is_closed(square + np.array([[0.0, 0.0]] * 4 + [[0.02, 0.0]]))  # 2 cm apart: more than the snap of 1 cm
    there_and_back = np.array([[0.0, 0.0], [50.0, 0.0], [80.0, 20.0], [50.0, 5.0], [0.0, 0.0]])
    assert not is_closed(there_and_back)


@pytest.mark.parametrize("jump", ["60,3.0\n60,2.0", "60,3.0\n60.01,2.0"])
def test_a_jump_of_the_width_is_a_step_of_the_kerb_where_the_file_has_it(tmp_path: Path, jump: str) -> None:
    rows = [row.split(",") for row in ("0,3.0", *jump.split("\n"), "100,2.0")]
    text = "x,y,left,right\n" + "".join(f"{x},0,{width},{width}\n" for x, width in rows)
    (tmp_path / "jump.csv").write_text(text, encoding="utf-8")
    street = load_road(tmp_path / "jump.csv").kerbs
    assert street is not None
    for kerb in street.kerbs:
        line, side = shapely.LineString(kerb.points), 1.0 if kerb.left else -1.0
        for x, y in ((30.0, 3.0), (60.0, 3.0), (60.01, 2.0), (80.0, 2.0)):
            assert line.distance(shapely.Point(x, side * y)) < 1e-6  # of points in a plane of 100 m
        beside = line.intersection(shapely.LineString([(0.0, side * 2.5), (100.0, side * 2.5)]))
        assert 60.0 - 1e-6 <= shapely.get_x(beside) <= 60.01 + 1e-6  # as above


def turned(profile: Profile) -> float:
    s, kappa = map(np.array, profile)
    return float(np.sum(0.5 * (kappa[1:] + kappa[:-1]) * np.diff(s)))


def test_the_bus_uturn_is_the_one_of_the_paper() -> None:
    s, kappa = uturn_profile()
    lengths = np.diff(s)
    assert turned((s, kappa)) == pytest.approx(np.pi, abs=1e-12)
    assert lengths[2] == pytest.approx(31.5, abs=0.1)  # read off the figure to a decimetre
    limits = uturn().limits
    assert limits is not None
    assert (limits.left[0], limits.right[0]) == (3.0, -3.0)


def test_the_articulated_uturn_fills_the_published_horizon() -> None:
    road = uturn_articulated()
    assert road.path.length == pytest.approx(134.2, abs=1e-9)
    assert road.limits is None
    assert float(road.path.at(65.0).curvature) == pytest.approx(0.065, abs=1e-9)


def test_the_roundabout_has_the_published_pieces() -> None:
    road = roundabout()
    assert road.path.length == pytest.approx(50 + 5.5 + 135 + 5.5 + 50, abs=1e-9)
    assert float(road.path.at(120.0).curvature) == pytest.approx(1.0 / 17.88, abs=1e-9)
    assert road.limits is not None
    assert road.limits.left[0] == 3.56


@pytest.mark.parametrize("curvature", [0.02, 0.1, -0.06])
@pytest.mark.parametrize("sharpness", [0.002, 0.02])
def test_an_sturn_ends_in_its_first_direction(curvature: float, sharpness: float) -> None:
    s, kappa = sturn_profile(curvature, sharpness)
    assert turned((s, kappa)) == pytest.approx(0.0, abs=1e-12)
    assert np.max(np.abs(np.diff(kappa) / np.diff(s))) == pytest.approx(sharpness)
    assert np.max(np.abs(kappa)) == pytest.approx(abs(curvature))


def test_pieces_of_no_length_are_left_out() -> None:
    s, _ = turn_profile(0.05, 10.0, 0.0, lead_in=0.0, lead_out=0.0)
    np.testing.assert_allclose(s, [0.0, 10.0, 20.0])


def test_impossible_profiles_are_refused() -> None:
    with pytest.raises(OptionError, match="cannot be made of pieces"):
        uturn_profile(0.060, 60.0)
    with pytest.raises(OptionError, match="pieces of 50, 0, 10, 0, 50 m"):
        turn_profile(0.05, 0.0, 10.0)
    with pytest.raises(OptionError, match="sharpness"):
        sturn_profile(0.05, 0.0)


BUS = load_vehicle("bus")
LEGS = ("side_street", "three_point_turn")


def test_every_example_loads_with_its_regions_and_says_that_it_is_none_of_osm() -> None:
    assert list(shipped("examples")) == [
        "kerb_bend", "kerb_bend_wall", "parked_van", "parked_van_tight", "side_street", "street_corner", "three_point_turn",
    ]  # fmt: skip
    for name in shipped("examples"):
        road = load_legs(name).legs[0].road if name in LEGS else load_road(name)
        assert road.regions
        assert road.notice is None
        assert road.to_lonlat is not None


@pytest.mark.parametrize(("name", "spare"), [("parked_van", 0.15), ("parked_van_tight", -0.15)])
def test_the_van_reaches_half_a_metre_over_the_lane_s_centre_and_leaves_the_passage(name: str, spare: float) -> None:
    limits = load_road(name).passable
    assert limits is not None
    left, right, _, _ = limits.table(np.array([80.0]))
    assert float(right[0]) == pytest.approx(0.5, abs=1e-3)  # nine decimals of a degree are 0.1 mm
    assert float(left[0] - right[0]) == pytest.approx(BUS.width + spare, abs=1e-3)


def test_the_bend_fits_only_with_the_overhang_over_the_kerb() -> None:
    assert fit_of(load_road("kerb_bend"), BUS).fits is True
    (finding,) = fit_of(load_road("kerb_bend_wall"), BUS).findings
    assert finding.needed == pytest.approx(5.09, abs=0.01)  # twice the balanced half width of R = 16 m, smoothed to 15.8 m
    assert finding.available == pytest.approx(4.25, abs=0.01)  # 2.75 m inside and 1.5 m outside


def test_the_corner_is_rounded_within_the_stated_deviation_and_houses_stay() -> None:
    road = load_road("street_corner")
    assert road.smoothing is not None
    assert road.smoothing.max_deviation < 5.0
    assert road.smoothing.max_curvature <= 1.01 * 0.125
    assert road.passable is not None
    left, right, left_sweep, _ = road.passable.table(np.array([30.0]))
    np.testing.assert_allclose([left[0], right[0], left_sweep[0]], [4.0, -3.5, 4.5], atol=0.03)  # drawn; the line moves by 3 cm here


@pytest.mark.parametrize("name", LEGS)
def test_the_drives_of_several_legs_are_drawn_so_that_nothing_is_moved(name: str) -> None:
    legs = load_legs(name)
    assert [leg.direction for leg in legs.legs] == ["forward", "backward", "forward"]
    assert legs.notes == ()
    first, last = legs.legs[0].road.path.at(0.0), legs.legs[-1].road.path.at(legs.legs[-1].road.path.length)
    assert abs(np.cos(float(last.heading) - float(first.heading)) + 1.0) < 1e-3  # they turn the vehicle round
