"""``hdvplan judge``: a path of one's own, judged as plans are."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

import hdvplan
from hdvplan.answers import YES
from hdvplan.api import follow
from hdvplan.arrays import FloatArray
from hdvplan.driving.given import GivenPath
from hdvplan.errors import OptionError, PlanError, RoadError
from tests.cli.conftest import Cli

_ROUNDING_M = 1e-3  # of path.csv's numbers, and of arcs of 0.25 m for a curvature that changes


@pytest.fixture
def planned(cli: Cli, short_road: str) -> Path:
    """Return the folder of a plan of a tractor-trailer on a short road."""
    assert cli("plan", short_road, "--vehicle", "tractor-trailer", "--half-width", "2", "--no-plot", "--out", "plan").code == 0
    return Path("plan")


def summary(folder: str | Path) -> dict[str, object]:
    found: dict[str, object] = json.loads((Path(folder) / "summary.json").read_text(encoding="utf-8"))
    return found


@pytest.mark.parametrize("columns", [[], ["x", "y", "heading", "beta1", "kappa"], ["x", "y", "heading"], ["x", "y"]])
def test_a_plan_s_own_path_is_judged_as_the_plan_was(cli: Cli, planned: Path, short_road: str, columns: list[str]) -> None:
    own = pd.read_csv(planned / "path.csv")
    (own[columns] if columns else own).to_csv("own.csv", index=False)
    outcome = cli("judge", "own.csv", short_road, "--vehicle", "tractor-trailer", "--half-width", "2", "--out", "judged", "--no-plot")
    assert outcome.code == 0
    assert outcome.out.startswith(YES)
    assert "driven along a given path" in outcome.out
    assert ("articulations come within 0.000" in outcome.err) == (not columns or "beta1" in columns)
    assert re.findall(r"own.csv: .*", outcome.err) == ["own.csv: column kappa not read"] * ("kappa" in columns)
    before, after = summary(planned), summary("judged")
    for name in ("max_left_m", "max_right_m", "min_clearance_m"):  # means differ: a plan goes on until its last body has left the road
        assert after[name] == pytest.approx(before[name], abs=_ROUNDING_M)
    assert (after["plans"], after["solver"], after["time_ms"]["mean"]) == (0, "none", None)  # type: ignore[index] # a dictionary
    assert cli("report", "plan", "judged", "--out", "both.html").code == 0


@pytest.mark.slow
def test_a_path_in_degrees_is_judged_as_the_same_in_metres(cli: Cli) -> None:
    arguments = ("monaco_fairmont_hairpin", "--vehicle", "bus", "--half-width", "3.5", "--no-plot")
    assert cli("plan", *arguments, "--out", "plan").code in {0, 1}
    path = pd.read_csv("plan/path.csv")
    to_lonlat = hdvplan.load_road("monaco_fairmont_hairpin").to_lonlat
    assert to_lonlat is not None
    lon, lat = to_lonlat(path["x"].to_numpy(), path["y"].to_numpy())
    path.assign(longitude=lon, Latitude=lat)[["longitude", "Latitude", "heading"]].to_csv("degrees.csv", index=False)
    (1e3 * path[["x", "y"]]).set_axis(["Easting [mm]", "Northing [mm]"], axis=1).join(path["heading"]).to_csv(
        "millimetres.csv", index=False
    )
    for name in ("plan/path.csv", "degrees.csv", "millimetres.csv"):
        assert cli("judge", name, *arguments, "--out", Path(name).stem).code in {0, 1}
    for name in ("degrees", "millimetres"):
        assert summary(name)["min_clearance_m"] == pytest.approx(summary("path")["min_clearance_m"], abs=_ROUNDING_M)


def test_a_track_of_a_receiver_is_judged_along_a_road_in_degrees_and_its_gaps_are_named(cli: Cli) -> None:
    lon = 11.95 + np.arange(0.0, 0.0014, 5e-5)
    road = {"type": "Feature", "properties": {}, "geometry": {"type": "LineString", "coordinates": [[x, 57.7] for x in lon]}}
    Path("road.geojson").write_text(json.dumps(road), encoding="utf-8")
    gpx = '<gpx version="1.1" creator="g" xmlns="http://www.topografix.com/GPX/1/1">{}</gpx>'
    track = "<trk><trkseg>{}</trkseg></trk>".format("".join(f'<trkpt lat="57.7" lon="{x}"/>' for x in lon))
    Path("track.gpx").write_text(gpx.format(track), encoding="utf-8")
    arguments = ("road.geojson", "--vehicle", "bus", "--half-width", "1.5", "--no-plot", "--out", "judged")
    assert cli("judge", "track.gpx", *arguments).out.startswith(f"{YES}: 0.2")
    Path("two.gpx").write_text(gpx.format(2 * track), encoding="utf-8")
    assert "keep in the file the one line" in cli("judge", "two.gpx", *arguments).err
    after_gap = [f"{x},{57.7 + 1e-5 * (number % 2)}" for number, x in enumerate(lon[lon > 11.9507])]
    Path("gap.csv").write_text("\n".join(["# a track", "lon,lat", "11.95,57.7", *after_gap]), encoding="utf-8")
    told = cli("judge", "gap.csv", *arguments).err
    assert "at line 3 of gap.csv (lon 11.95, lat 57.7) the path turns too sharply" in told
    assert "put its points evenly: most are 3.2 m from the next one, line 3 of gap.csv (lon 11.95, lat 57.7) 44.7 m" in told


def test_a_plan_s_path_is_judged_in_the_plane_of_a_road_that_was_edited_since(cli: Cli, tmp_path: Path) -> None:
    """The plane of a road in degrees has its origin in the road's middle: with one point more it is another one, 60 m further on."""
    lon = 11.95 + 5e-5 * np.arange(34)
    places = np.column_stack([lon, 57.7 + 1e-4 * np.cos(np.linspace(0.0, 3.0, len(lon)))]).tolist()
    longer = [*places, [places[-1][0] + 2e-3, places[-1][1]]]
    for name, points in (("road", places), ("longer", longer)):
        road = {"type": "Feature", "properties": {"width_m": 8.0}, "geometry": {"type": "LineString", "coordinates": points}}
        (tmp_path / f"{name}.geojson").write_text(json.dumps(road), encoding="utf-8")
    own = ("--vehicle", "tractor-trailer", "--no-plot", "--no-proof", "--json")
    spare = json.loads(cli("plan", "road.geojson", *own, "--no-refine", "--out", "planned").out)["verdict"]["spare_m"]
    outcome = cli("judge", "planned/path.csv", "longer.geojson", *own, "--out", "judged")
    assert json.loads(outcome.out)["verdict"]["spare_m"] == pytest.approx(spare, abs=0.005)  # files round to 1 mm, planes are scaled apart
    assert "planned in another plane than the road's" in outcome.err
    beside = tmp_path / "planned" / "summary.json"
    beside.write_text(json.dumps({**json.loads(beside.read_text(encoding="utf-8")), "plane": "EPSG:1234567"}), encoding="utf-8")
    outcome = cli("judge", "planned/path.csv", "longer.geojson", *own, "--out", "judged")
    assert outcome.code == 2
    assert "summary.json beside path.csv names a plane of no use: unknown coordinate reference system 'EPSG:1234567'" in outcome.err


def test_angles_have_names_and_units_and_what_is_unread_or_wrong_is_told(cli: Cli, planned: Path, short_road: str) -> None:
    path = pd.read_csv(planned / "path.csv")
    named = pd.DataFrame({"x": path["x"], "y": path["y"], "Yaw [deg]": np.degrees(path["heading"]), "v": 5.0, "theta_trailer": 0.0})
    arguments = (short_road, "--vehicle", "tractor-trailer", "--half-width", "2", "--no-plot")
    for sign, warned in ((1.0, False), (-1.0, True)):
        named.assign(beta1_deg=np.degrees(sign * path["beta1"])).to_csv("own.csv", index=False)
        outcome = cli("judge", "own.csv", *arguments)
        assert outcome.code == 0
        assert "own.csv: columns v, theta_trailer not read\n" in outcome.err
        assert ("warning: that is far: is their unit or sign another?" in outcome.err) == warned


def test_a_path_round_a_closed_road_begins_where_the_road_does(cli: Cli) -> None:
    arguments = ("neubrandenburg_ring", "--vehicle", "bus", "--half-width", "2.8", "--no-plot")  # its ends are one place
    assert cli("plan", *arguments, "--out", "plan").code == 0
    assert cli("judge", "plan/path.csv", *arguments, "--out", "judged").code == 0
    before, after = summary("plan"), summary("judged")
    assert after["min_clearance_m"] == pytest.approx(before["min_clearance_m"], abs=_ROUNDING_M)


def test_a_path_that_leaves_the_street_is_a_no_that_speaks_of_the_path_alone(cli: Cli, planned: Path, short_road: str) -> None:
    path = pd.read_csv(planned / "path.csv")
    path.assign(y=path["y"] + 1.0).to_csv("beside.csv", index=False)  # the road runs eastwards
    arguments = ("beside.csv", short_road, "--vehicle", "tractor-trailer", "--half-width", "2", "--no-proof", "--no-plot")
    outcome = cli("judge", *arguments)
    assert outcome.code == 1
    assert outcome.out.splitlines()[1].endswith("; another path may fit: `hdvplan plan` looks for one")
    assert "limit by 0." in outcome.err
    assert (Path("beside.short.tractor-trailer") / "swept.geojson").is_file()


def test_the_room_that_a_plan_would_need_counts_from_the_line_as_given(cli: Cli) -> None:
    Path("corner.csv").write_text("x,y\n0,0\n30,0\n45,30\n45,60", encoding="utf-8")
    told = cli("plan", "corner.csv", "--vehicle", "bus", "--half-width", "1.5", "--no-refine", "--no-proof", "--no-plot")
    lacking, half = (float(re.findall(rf"{words} ?([\d.]+) m", told.out + told.err)[0]) for words in ("NO:", "a half width of"))
    assert half == pytest.approx(1.5 + lacking, abs=0.011)  # two roundings


def test_a_part_of_a_road_is_judged_by_itself_and_said(cli: Cli, planned: Path, short_road: str) -> None:
    path = pd.read_csv(planned / "path.csv")
    path[(path["s"] > 9.9) & (path["s"] < 52.0)].to_csv("part.csv", index=False)
    outcome = cli("judge", "part.csv", short_road, "--vehicle", "tractor-trailer", "--half-width", "2", "--no-plot")
    assert outcome.code == 0
    assert "the path covers s = 10.0 to 51.5 m of 60.0 m; arclengths count from its beginning" in outcome.err


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (lambda path: path.iloc[::-1], "180 degrees off its heading"),
        (lambda path: path.iloc[::-1].drop(columns="heading"), "against its direction"),
        (lambda path: path.assign(x=path["x"] + 1e4), "m away from the road"),
        (lambda path: path.assign(x=1e3 * path["x"], y=1e3 * path["y"]), "hint: it extends over "),
        (lambda path: path.assign(x=1e3 * path["x"], y=1e3 * path["y"]), "m: are its coordinates mm? Give metres"),
        (lambda path: path.assign(x=1e2 * path["x"], y=1e2 * path["y"]), "are its coordinates cm? Give metres"),
        (lambda path: path.assign(y=path["y"] + 16.0), "begins 16 m away from the road's line\nhint: its x and y are in the plane"),
        (lambda path: path.assign(x=path["x"] + 1e4, heading=path["heading"] + 2.0), "m away from the road"),
        (lambda path: path[["x", "y"]].set_axis(["lon", "lat"], axis=1), "is in degrees, and the road is not"),
        (
            lambda path: path[["x", "y"]] + np.random.default_rng(1).normal(0.0, 0.3, (len(path), 2)),
            "of a track that was recorded keep one every",
        ),
        (lambda path: path.drop(columns="x"), "has no column 'x'"),
        (lambda path: path.iloc[:1], "fewer than two different points"),
        (lambda path: path.iloc[:0], "fewer than two different points"),
        (lambda path: path.iloc[:6], "less than the tractor-trailer is long"),
        (lambda path: path.assign(heading=np.degrees(path["heading"]) + 20.0), "degrees off its heading"),
        (lambda path: path.drop(columns="heading").assign(yaw=np.degrees(path["heading"]) + 20.0), "degrees off its heading"),
        (lambda path: path.assign(psi=path["heading"]), "column heading occurs twice"),
        (lambda path: path.assign(beta1=np.degrees(path["beta1"]) + 4.0), "more than half a turn\nhint: is their unit degrees?"),
        (lambda path: path.assign(y=path["y"].astype(object).where(path["s"] != 5.0, "far")), "not a number"),
    ],
)
def test_what_is_no_path_along_the_road_is_refused(cli: Cli, planned: Path, short_road: str, spoil: object, words: str) -> None:
    spoil(pd.read_csv(planned / "path.csv")).to_csv("own.csv", index=False)  # type: ignore[operator] # a function
    outcome = cli("judge", "own.csv", short_road, "--vehicle", "tractor-trailer")
    assert (outcome.code, outcome.out) == (2, "")
    assert words in outcome.err
    assert not Path("own.short.tractor-trailer").exists()


def test_trailers_follow_as_an_integration_of_their_own_says(tmp_path: Path) -> None:
    file = tmp_path / "straight.csv"
    file.write_text("s,kappa\n0,0\n200,0\n", encoding="utf-8")
    road, vehicle = hdvplan.load_road(file), hdvplan.load_vehicle("tractor-trailer")
    amplitude, k = 1.0, 2.0 * np.pi / 50.0
    x = np.arange(0.0, 200.5, 0.5)
    path = GivenPath(np.column_stack([x, amplitude * np.sin(k * x)]), np.arctan(amplitude * k * np.cos(k * x)))
    found = follow(hdvplan.Case(road, vehicle), path).drive
    hitch, length = vehicle.lead.hitch_offset, vehicle.units[1].wheelbase

    def turning(x: float, heading: FloatArray) -> list[float]:  # of the trailer, over x instead of the path's length
        slope, bend = amplitude * k * np.cos(k * x), -amplitude * k**2 * np.sin(k * x)
        ahead = np.arctan(slope)
        beta, kappa = ahead - heading[0], bend / (1.0 + slope**2) ** 1.5
        return [np.sqrt(1.0 + slope**2) * (np.sin(beta) - hitch * kappa * np.cos(beta)) / length]

    start = float(np.arctan(amplitude * k)) - found.poses_z[0, 2]
    s = found.poses_s[found.poses_s <= 200.0]
    own = solve_ivp(turning, (0.0, 200.0), [start], t_eval=s, rtol=1e-10, atol=1e-12).y[0]
    lead = found.poses_z[:, 1]  # the road runs along x
    beta = np.arctan(amplitude * k * np.cos(k * s)) - own
    assert found.poses_z[: len(s), 0] == pytest.approx(amplitude * np.sin(k * s), abs=1e-6)  # cubics of 0.5 m
    assert lead[: len(s)] == pytest.approx(np.arctan(amplitude * k * np.cos(k * s)), abs=1e-5)
    assert found.poses_z[: len(s), 2] == pytest.approx(beta, abs=2e-5)  # an arc of 0.25 m for a changing curvature


def test_a_path_too_tight_for_the_vehicle_is_refused_with_its_place(tmp_path: Path) -> None:
    file = tmp_path / "straight.csv"
    file.write_text("s,kappa\n0,0\n200,0\n", encoding="utf-8")
    x = np.arange(0.0, 200.5, 0.5)
    path = GivenPath(np.column_stack([x, 4.0 * np.exp(-(((x - 100.0) / 6.0) ** 2))]))
    with pytest.raises(PlanError, match=r"too tight: it turns with up to 0\.2") as raised:
        hdvplan.judge(hdvplan.Case(hdvplan.load_road(file), hdvplan.load_vehicle("bus")), path)
    assert raised.value.s_m == pytest.approx(97.0, abs=3.0)


def test_wheels_that_the_vehicle_steers_by_itself_must_be_told(tmp_path: Path) -> None:
    file = tmp_path / "straight.csv"
    file.write_text("s,kappa\n0,0\n200,0\n", encoding="utf-8")
    case = hdvplan.Case(hdvplan.load_road(file), hdvplan.load_vehicle("semitrailer-active"))
    points = np.column_stack([np.linspace(0.0, 200.0, 41), np.zeros(41)])
    with pytest.raises(RoadError, match="no column steering1"):
        hdvplan.judge(case, GivenPath(points))
    held = GivenPath(points, steering=np.zeros((41, len(case.vehicle.active))))
    assert hdvplan.judge(case, held).balance.max_left == pytest.approx(0.5 * case.vehicle.width, abs=1e-6)


POINTS = np.zeros((3, 2))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"points": np.zeros((3, 3))}, r"points must have shape \(n, 2\), not \(3, 3\)"),
        ({"points": [[0.0, "far"]]}, "points is no array of numbers"),
        ({"points": np.zeros(4)}, r"points must have shape \(n, 2\), not \(4,\)"),
        ({"points": POINTS, "heading": np.zeros(2)}, r"heading must have shape \(n,\), not \(2,\)\nhint: n is 3"),
        ({"points": POINTS, "betas": np.zeros(3)}, r"betas must have shape \(n, couplings\), not \(3,\)"),
        ({"points": POINTS, "heading": np.full(3, np.nan)}, "heading holds what is not a finite number"),
        ({"points": POINTS, "betas": np.full((3, 1), 20.0)}, "betas reach 20 rad, more than half a turn"),
    ],
)
def test_arrays_that_are_no_path_are_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(OptionError) as raised:
        GivenPath(**given)
    assert re.match(words, "\n".join([str(raised.value), *getattr(raised.value, "__notes__", [])]))


def test_articulations_of_other_couplings_are_refused() -> None:
    path = GivenPath(np.column_stack([np.linspace(0.0, 200.0, 41), np.zeros(41)]), betas=np.zeros((41, 2)))
    with pytest.raises(OptionError, match=r"betas have 2 columns, the tractor-trailer 1"):
        hdvplan.judge(hdvplan.Case(hdvplan.load_road("uturn"), hdvplan.load_vehicle("tractor-trailer")), path)
