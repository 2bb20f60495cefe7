from __future__ import annotations

import base64
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import shapely
from shapely.affinity import translate

from hdvplan.arrays import FloatArray
from hdvplan.errors import OptionError
from hdvplan.judging.balance import balance_of
from hdvplan.judging.result import Result, result_of
from hdvplan.report.files import write_plan
from hdvplan.report.html import report_html, short_labels, write_report
from hdvplan.report.layers import conflict_features, kerb_features
from hdvplan.report.planfiles import PlanFiles, packed, payload_of, read_plan, road_frame, tight_places
from hdvplan.road.pieces import Kerb
from hdvplan.road.regions import Kind, Region


@pytest.fixture(scope="module")
def plan(kerbed: Result, tmp_path_factory: pytest.TempPathFactory) -> PlanFiles:
    folder = tmp_path_factory.mktemp("kerbed")
    write_plan(kerbed, folder)
    return read_plan(folder)


@pytest.fixture
def copied(plan: PlanFiles, tmp_path: Path) -> Path:
    """Return a folder of the test's own with the files of the plan."""
    shutil.copytree(plan.directory, tmp_path, dirs_exist_ok=True)
    return tmp_path


def unpacked(column: dict[str, object]) -> FloatArray:
    """Return what the page makes of a packed column."""
    whole = np.frombuffer(base64.b64decode(str(column["data"])), "<i2").astype(float)
    whole[whole == -32768] = np.nan
    return whole * float(str(column["scale"]))


def test_the_page_says_how_far_the_driver_may_stray(plan: PlanFiles) -> None:
    assert "0.123" not in report_html([plan], "One")
    page = report_html([replace(plan, summary=plan.summary | {"tracking_error_m": 0.123})], "One")
    assert re.search(r"tracking error.{,100}0\.123", page, re.DOTALL)


def test_numbers_survive_packing_to_a_part_in_65000() -> None:
    values = np.array([0.0, 4.0, -3.999, np.nan, 1e-3])
    np.testing.assert_allclose(unpacked(packed(values)), values, atol=4.0 / 65534.0)  # half a scale
    np.testing.assert_array_equal(unpacked(packed(np.zeros(3))), np.zeros(3))


def test_the_road_is_found_again_beside_the_driven_path(plan: PlanFiles, kerbed: Result) -> None:
    s = np.arange(0.0, kerbed.drive.road.path.length, 0.5)
    x, y, heading = road_frame(plan, s)
    road = kerbed.drive.road.path.at(s)
    np.testing.assert_allclose(np.column_stack([x, y]), np.column_stack([road.x, road.y]), atol=2e-6)  # two numbers of six decimals
    np.testing.assert_allclose(np.cos(heading), np.cos(road.heading), atol=2e-9)  # of nine


def test_the_tightest_places_begin_with_the_deepest_breach(plan: PlanFiles, kerbed: Result) -> None:
    first, *others = tight_places(plan)
    assert first["kind"] == "clearance"
    assert first["value"] == pytest.approx(kerbed.balance.min_clearance, abs=1e-4)  # rounded in the file
    assert all(first["value"] <= other["value"] for other in others)


def test_the_page_asks_for_nothing_from_outside(plan: PlanFiles) -> None:
    page = report_html([plan], "A report")
    assert "default-src 'none'" in page
    assert not re.search(r"(src|href)=[\"'](?!data:)", page)
    assert not re.search(r"https?://|@import|url\(", page)


def test_the_legend_names_what_is_drawn_and_no_more(plan: PlanFiles) -> None:
    open_road = replace(plan, limits=[], summary=plan.summary | {"breaches": []})
    for one, shown in ((plan, True), (open_road, False)):
        legend = re.findall(r'<span class="key">.*?</span>([^<]*)</span>', report_html([one], "A report"))
        assert "balanced circle, as tight as the road" in legend  # as the picture calls it
        assert all((name in legend) is shown for name in ("limits", "beyond a limit"))


def test_names_from_files_cannot_become_markup(plan: PlanFiles) -> None:
    hostile = "</script><script>alert(1)</script>"
    summary = plan.summary | {"road": hostile, "notice": hostile}
    page = report_html([replace(plan, summary=summary)], hostile)
    assert "<script>alert" not in page
    data = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)
    assert data is not None
    assert json.loads(data[1])[0]["road"] == hostile  # and are still what they were


def test_plans_are_told_apart_by_what_differs(plan: PlanFiles) -> None:
    other = replace(plan, summary=plan.summary | {"solver": "osqp"})
    assert short_labels([plan, other]) == ["riccati", "osqp"]
    assert short_labels([plan]) == ["bus"]
    twin = replace(plan, directory=Path("again"))
    assert short_labels([plan, twin]) == [f"bus ({plan.directory.name})", "bus (again)"]
    none = dict.fromkeys(("scheme", "solver", "objective"), "none")
    given = [
        replace(plan, directory=Path(folder), summary=plan.summary | none | {"plans": 0, "path": path})
        for folder, path in (("a", "mine.csv"), ("b", "mine.csv"), ("c", ""))
    ]
    page = report_html([plan, *given], "A report")
    assert "none, none" not in page
    for name in ("given path mine.csv (a)", "given path mine.csv (b)", "given path c"):
        assert re.search(rf"<h2[^>]*>[^<]*, {re.escape(name)}</h2>", page), name


def test_the_page_shows_the_summary_s_numbers(plan: PlanFiles, kerbed: Result) -> None:
    page = report_html([plan], "A report")
    assert f"<td>{kerbed.balance.max_left:.3f}</td>" in page
    assert f'<td class="bad">{kerbed.balance.violation:.3f}</td>' in page
    counted = sum(int(count) for count in re.findall(r"ms: (\d+) steps", page))
    assert counted == len(kerbed.drive.plans)  # the histogram loses no step


def test_every_number_comes_with_its_meaning_and_the_width_that_was_asked_for(plan: PlanFiles, kerbed: Result) -> None:
    page = report_html([plan], "For the council")
    limits = kerbed.drive.road.limits
    assert limits is not None
    width = float(np.min(limits.left - limits.right))
    assert f'<th scope="row">width between limits</th><td class="unit">m</td><td>{width:.2f}</td>' in page
    open_road = replace(plan, envelope=plan.envelope.assign(left_limit=np.nan, right_limit=np.nan))
    assert '<th scope="row">width between limits</th><td class="unit">m</td><td>-</td>' in report_html([open_road], "No limits")
    for name in ("needed half width", "min clearance", "imbalance"):
        assert re.search(rf'<th scope="row">{name}</th>.*<td class="meaning">\w', page)


def test_how_it_was_planned_is_folded_away_and_named_only_where_it_tells_plans_apart(plan: PlanFiles) -> None:
    page = report_html([plan], "For the council")
    assert "<h2>bus on uturn</h2>" in page
    shown, _, folded = page.partition("<details>")
    assert "SQP iterations" in folded
    assert not any(word in shown for word in ("SQP iterations", "Time of a planning step", "riccati on "))
    assert "riccati" in report_html([plan, replace(plan, summary=plan.summary | {"solver": "osqp"})], "Two").partition("<details>")[0]


@pytest.mark.parametrize("entry", ["road", "bodies", "breaches", "time_ms"])
def test_a_summary_without_what_the_page_needs_is_refused(copied: Path, entry: str) -> None:
    summary = json.loads((copied / "summary.json").read_text(encoding="utf-8"))
    del summary[entry]
    (copied / "summary.json").write_text(json.dumps(summary), encoding="utf-8")
    with pytest.raises(OptionError, match=entry):
        write_report([copied], copied / "report.html")


def test_a_summary_with_words_for_numbers_is_refused(copied: Path) -> None:
    summary = json.loads((copied / "summary.json").read_text(encoding="utf-8"))
    (copied / "summary.json").write_text(json.dumps(summary | {"max_left_m": "x"}), encoding="utf-8")
    with pytest.raises(OptionError, match=r"max_left_m of .* must be a number"):
        write_report([copied], copied / "report.html")


def test_obstacles_and_kerbs_come_with_their_distances_and_where_they_lie(straight: Result, tmp_path: Path) -> None:
    van, kerb = shapely.box(40.0, 2.0, 42.0, 3.0), shapely.box(60.0, -4.0, 70.0, -2.0)
    road = replace(straight.drive.road, regions=(Region(Kind.OBSTACLE, van, "van"), Region(Kind.SWEEPABLE, kerb)))
    drive = replace(straight.drive, road=road)
    write_plan(replace(straight, drive=drive, balance=balance_of(drive)), tmp_path)
    plan = read_plan(tmp_path)
    shown = payload_of(replace(plan, path=plan.path.assign(x=plan.path["x"] + 100.0)))["regions"]
    assert [region["region"] for region in shown] == ["obstacle", "sweepable"]
    assert shapely.Polygon(shown[0]["rings"][0]).equals(shapely.box(-60.0, 2.0, -58.0, 3.0))  # from the road's start
    page = report_html([plan], "obstacles")
    assert re.search(r'<td class="text">van</td><td>0\.730</td><td class="text">bus</td>', page)  # 2 m less half of 2.54 m
    assert 'class="swatch sweepable"' in page
    (near,) = plan.summary["obstacles"]
    for distance, entered in ((-0.008, False), (-0.012, True)):  # as far as a limit counts as kept, and further
        told = replace(plan, summary=plan.summary | {"obstacles": [near | {"distance_m": distance}]})
        assert (f'class="bad">{distance:.3f}</td>' in report_html([told], "obstacles")) is entered


def test_the_page_draws_the_kerbs_where_they_are_not_where_normals_of_the_line_meet_them(straight: Result, tmp_path: Path) -> None:
    notched = [(-20.0, 3.0), (40.0, 3.0), (41.0, 9.0), (39.0, 9.0), (38.0, 1.0), (110.0, 1.0)]
    points = [np.array(line) for line in (notched, [(-20.0, -3.0), (110.0, -3.0)])]
    kerbs = tuple(Kerb(line, line[:, 0], left) for line, left in zip(points, (True, False), strict=True))
    road = replace(straight.drive.road.with_kerbs(kerbs), bridges=(np.array([(41.0, 9.0), (39.0, 9.0)]),))
    result = result_of(replace(straight.drive, road=road), solver="riccati", objective="geometric")
    write_plan(result, tmp_path)
    plan = read_plan(tmp_path)
    moved = payload_of(replace(plan, path=plan.path.assign(x=plan.path["x"] + 100.0)))
    drawn, wanted = moved["limits"], [*kerb_features(result), *conflict_features(result)]
    assert [limit["layer"] for limit in drawn] == [*["limits"] * (len(wanted) - len(result.balance.breaches)), "conflicts"]
    for limit, feature in zip(drawn, wanted, strict=True):
        shown = translate(shapely.LineString(limit["lines"][0]), 100.0)
        there = feature.geometry if limit["layer"] == "limits" else shapely.boundary(feature.geometry)
        assert shapely.hausdorff_distance(shown, there) < 0.02  # to 1 cm, and what simplifying leaves out
    page = report_html([plan], "notched")
    assert page.count("assumed, not drawn") == 1
    assert "limits of overhangs" not in page.partition("<script")[0]


def test_a_breach_names_the_obstacle_that_is_entered_not_the_region_of_a_limit(plan: PlanFiles) -> None:
    edge = plan.summary["breaches"][0] | {"region": "drivable"}
    for obstacle, said in (("hoarding", "the obstacle &#39;hoarding&#39;"), ("", "an obstacle"), (None, "edge of the road")):
        page = report_html([replace(plan, summary=plan.summary | {"breaches": [edge | {"obstacle": obstacle}]})], "one breach")
        assert f'<td class="text">{edge["unit"]}</td><td class="text">{said}</td></tr>' in page


@pytest.mark.parametrize("missing", ["summary.json", "profile.csv", "regions.json", "limits.json"])
def test_a_folder_without_a_whole_plan_is_refused(copied: Path, missing: str) -> None:
    (copied / missing).unlink()
    with pytest.raises(OptionError, match=missing):
        read_plan(copied)


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("summary.json", "{"),
        ("summary.json", '{"bodies": 3}'),
        ("regions.json", "[1]"),
        ("limits.json", "[1]"),
        ("steps.csv", "s,total_ms\n"),
        ("envelope.csv", "s,left,right,left_limit,right_limit,expected_left,expected_right\n0,1,-1,2,-2,1,-1\n"),
        ("path.csv", "s,x\n0,1\n"),
    ],
)
def test_a_damaged_plan_is_refused(copied: Path, name: str, text: str) -> None:
    (copied / name).write_text(text, encoding="utf-8")
    with pytest.raises(OptionError, match="cannot be read"):
        write_report([copied], copied / "report.html")
    assert not (copied / "report.html").exists()


@pytest.mark.parametrize(
    ("name", "column", "value"),
    [
        ("path", "x", "1e300"),  # beyond what the page's numbers hold
        ("steps", "total_ms", "1e308"),
        ("steps", "total_ms", "True"),
    ],
)
def test_a_plan_with_impossible_numbers_is_refused_without_a_warning(copied: Path, name: str, column: str, value: str) -> None:
    file = copied / f"{name}.csv"
    table = pd.read_csv(file, dtype=str)
    table.loc[:: 1 if value == "True" else 2, column] = value  # a column of truth values alone is one
    table.to_csv(file, index=False)
    with pytest.raises(OptionError, match=r"cannot be (read|shown)"):
        write_report([copied], copied / "report.html")
    assert not (copied / "report.html").exists()


def test_a_long_table_with_a_word_is_refused_without_a_warning(copied: Path) -> None:
    file = copied / "path.csv"
    table = pd.concat([pd.read_csv(file)] * 200, ignore_index=True)
    table["x"] = [*table["x"].astype(str)[1:], "word"]
    table.to_csv(file, index=False)
    with pytest.raises(OptionError, match="column x has values that are not numbers"):
        read_plan(copied)
