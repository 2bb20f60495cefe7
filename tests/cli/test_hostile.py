"""Names, titles and places of output that mean harm: nothing runs, nothing is replaced, and each is answered or refused in a line."""

from __future__ import annotations

import json
import os
import re
import sqlite3
import stat
import subprocess
from contextlib import closing
from html import unescape
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import ezdxf
import numpy as np
import pandas as pd
import pytest

from hdvplan.fileio import csv_bytes
from hdvplan.report.cad import _literal
from hdvplan.texts import printable
from tests.cli.conftest import Cli, Outcome

ROAD = "s,kappa,left,right\n0,0,3,3\n20,0,3,3\n30,0.03,3,3\n40,0,3,3\n60,0,3,3\n"
NAMES = [
    "=cmd|' -C calc'!A0",
    "+1+1",
    "@SUM(A1)",
    "-rf",
    "--help",
    "[red]x[-red]",
    "\x1b[31mred\x1b[0m",
    "a\nerror: b",
    "a\tb",
    "a|b",
    "$x$",
    "$\\frac{$",
    "<img src=x onerror=alert(1)>",
    "<!--",
    "&lt;",
    "%%d^J%%%",
    "{0}{x}%s%n",
    "$(touch pwned)",
    "`touch pwned`",
    "; touch pwned",
    "| touch pwned",
    "' \" \\",
    "\u202egnp",
    "\udcff\udcfe",
    "\x07\x08\x7f\x9b31m",
    "ä" * 100,
    "x" * 200,
    "\\P{\\H3x;A}",
]  # each is the name of a road file, a title and a folder for output


def harmless(outcome: Outcome, folder: Path) -> None:
    """Assert that a command did nothing but answer, or refuse in a line."""
    assert outcome.code in {0, 2}, outcome.err
    assert not list(folder.rglob("pwned"))
    assert all(sign.isprintable() or sign == "\n" for sign in outcome.out + outcome.err)
    errors = [line for line in outcome.err.splitlines() if line.startswith("error:")]
    assert len(errors) == (outcome.code == 2)


@pytest.mark.parametrize("name", NAMES)
def test_a_road_a_folder_and_a_page_of_any_name_are_only_named_so(cli: Cli, tmp_path: Path, name: str) -> None:
    (tmp_path / f"{name}.csv").write_text(ROAD, encoding="utf-8")
    outcome = cli("plan", "--vehicle", "bus", "--no-plot", "--out", "out", "--", f"{name}.csv")
    harmless(outcome, tmp_path)
    assert outcome.code == 0
    summary = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert summary["road"] == printable(name)
    harmless(cli("report", "out", "--title", name), tmp_path)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    title = re.search(r"<title>(.*?)</title>", page, re.DOTALL)
    assert title is not None
    assert unescape(title[1]) == name.encode("utf-8", "replace").decode()
    assert "<img" not in page
    outcome = cli("plan", "--vehicle", "bus", "--no-plot", f"--out={name}", "--", f"{name}.csv")
    harmless(outcome, tmp_path)
    assert (tmp_path / name / "summary.json").is_file() is (outcome.code == 0)


@pytest.mark.slow
def test_obstacles_of_any_name_are_drawn_and_told(cli: Cli, tmp_path: Path) -> None:
    features: list[dict[str, Any]] = [
        {"type": "Feature", "properties": {"width_m": 9}, "geometry": {"type": "LineString", "coordinates": [[0, 0], [200, 0]]}}
    ]
    for number, name in enumerate(NAMES):
        x = 10.0 + 6.0 * number
        ring = [[x, 3.0], [x + 1.0, 3.0], [x + 1.0, 4.0], [x, 4.0], [x, 3.0]]
        geometry = {"type": "Polygon", "coordinates": [ring]}
        features.append({"type": "Feature", "properties": {"region": "obstacle", "name": name}, "geometry": geometry})
    road = {"type": "FeatureCollection", "crs": {"type": "name", "properties": {"name": "EPSG:3006"}}, "features": features}
    for feature in features:
        shape = np.array(feature["geometry"]["coordinates"]) + np.array([319000.0, 6400000.0])
        feature["geometry"]["coordinates"] = shape.tolist()
    (tmp_path / "road.geojson").write_text(json.dumps(road), encoding="utf-8")
    outcome = cli("plan", "road.geojson", "--vehicle", "bus", "--format", "svg,dxf,gpkg", "--out", "out")
    harmless(outcome, tmp_path)
    assert outcome.code == 0
    ET.parse(tmp_path / "out" / "plan.svg")  # noqa: S314 - ours
    drawing = ezdxf.readfile(tmp_path / "out" / "plan.dxf")  # type: ignore[attr-defined] # exported
    texts = {text.dxf.text for text in drawing.modelspace().query("TEXT")}
    assert len(texts & {_literal(name) for name in NAMES}) == len(NAMES)
    with closing(sqlite3.connect(tmp_path / "out" / "plan.gpkg")) as layers:
        assert layers.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    told = json.loads((tmp_path / "out" / "summary.json").read_text(encoding="utf-8"))
    assert [one["name"] for one in told["passed"]] == [printable(name) for name in NAMES]


# What stands where a command is to write, by the place that it is given: as a shell makes it.
FILES = {
    "pipe": "mkfifo pipe",
    "device": "ln -s /dev/null device",
    "link/x": "ln -s missing/file link",
    "mine/deeper": "echo mine > mine",
    300 * "x": "",  # too long a name
    "/dev/null/x": "",
}
FOLDERS = FILES | {
    "mine": "echo mine > mine",
    "cad": "mkdir cad; echo mine > cad/plan.dxf",
    "linked": "echo mine > secret; mkdir linked; ln -s ../secret linked/summary.json",
    "full": "mkdir -p full/path.csv",
    "piped": "mkdir piped; mkfifo piped/path.csv",
    "/".join(["x" * 100] * 50): "",  # too long a way
}


def made(folder: Path, script: str) -> None:
    subprocess.run(["/bin/sh", "-ec", script], cwd=folder, check=True)  # noqa: S603 - ours


def all_of(folder: Path) -> dict[str, object]:
    """Return what lies in a folder: kinds of all, contents of files, targets of links."""
    found: dict[str, object] = {}
    for path in folder.rglob("*"):
        mode = path.lstat().st_mode
        content = path.read_bytes() if stat.S_ISREG(mode) else str(path.readlink()) if stat.S_ISLNK(mode) else None
        found[str(path)] = (stat.S_IFMT(mode), content)
    return found


@pytest.mark.parametrize(("out", "script"), FOLDERS.items())
def test_a_plan_replaces_nothing_of_others(cli: Cli, tmp_path: Path, out: str, script: str) -> None:
    (tmp_path / "road.csv").write_text(ROAD, encoding="utf-8")
    made(tmp_path, script)
    before = all_of(tmp_path)
    outcome = cli("plan", "road.csv", "--vehicle", "bus", "--no-plot", "--out", out)
    harmless(outcome, tmp_path)
    assert outcome.code == 2
    assert all_of(tmp_path) == before


@pytest.mark.parametrize(
    "command",
    [
        ("roads", "make", "uturn", "--out"),
        ("vehicles", "show", "bus", "--plot"),
        ("report", "plan", "--out"),
        ("roads", "info", "road.csv", "--csv"),
    ],
)
@pytest.mark.parametrize(("out", "script"), FILES.items())
def test_a_file_that_is_written_replaces_nothing_but_a_file(
    cli: Cli, tmp_path: Path, command: tuple[str, ...], out: str, script: str
) -> None:
    (tmp_path / "road.csv").write_text(ROAD, encoding="utf-8")
    if command[0] == "report":
        assert cli("plan", "road.csv", "--vehicle", "bus", "--no-plot", "--out", "plan").code == 0
    made(tmp_path, script)
    before = all_of(tmp_path)
    outcome = cli(*command, out)
    assert outcome.code == 2, outcome.err
    assert outcome.err.count("error: ") == 1
    assert all_of(tmp_path) == before


def test_a_link_is_replaced_by_a_report_and_what_it_leads_to_is_not(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "road.csv").write_text(ROAD, encoding="utf-8")
    assert cli("plan", "road.csv", "--vehicle", "bus", "--no-plot", "--out", "plan").code == 0
    (tmp_path / "secret").write_text("mine", encoding="utf-8")
    (tmp_path / "page.html").symlink_to(tmp_path / "secret")
    assert cli("report", "plan", "--out", "page.html").code == 0
    assert not (tmp_path / "page.html").is_symlink()
    assert (tmp_path / "secret").read_text(encoding="utf-8") == "mine"


def test_a_benchmark_deletes_no_folder_of_parts_that_is_not_its_own(cli: Cli, tmp_path: Path) -> None:
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "screws.txt").write_text("mine", encoding="utf-8")
    outcome = cli(
        "bench", "--roads", "uturn", "--vehicles", "bus", "--schemes", "rti", "--solvers", "riccati", "--rounds", "1", "--out", "."
    )
    assert outcome.code == 2
    assert "parts/screws.txt is not of a benchmark" in outcome.err
    assert (tmp_path / "parts" / "screws.txt").read_text(encoding="utf-8") == "mine"


@pytest.mark.slow
@pytest.mark.parametrize("name", ["<b>a\\nb", "../../up"])
def test_a_vehicle_of_any_name_is_planned(cli: Cli, tmp_path: Path, name: str) -> None:
    toml = f'name = "{name}"\n[[unit]]\nname = "{name}"\nwheelbase = 6.0\nwidth = 2.5\nmax_curvature = 0.1\nmax_curvature_rate = 0.1\n'
    (tmp_path / "v.toml").write_text(toml, encoding="utf-8")
    (tmp_path / "road.csv").write_text(ROAD, encoding="utf-8")
    outcome = cli("plan", "road.csv", "--vehicle", "v.toml", "--format", "svg,dxf")
    harmless(outcome, tmp_path)
    assert outcome.code == 0
    (folder,) = tmp_path.glob("road.*/")
    ezdxf.readfile(folder / "plan.dxf")  # type: ignore[attr-defined] # exported
    ET.parse(folder / "plan.svg")  # noqa: S314 - ours
    assert folder.resolve().parent == tmp_path.resolve()


def test_words_of_a_table_begin_no_formula_and_end_no_cell() -> None:
    table = pd.DataFrame({"road": ["=1+1", "+x", "-x", "@a", "-5", "a,b", "\tx"], "m": [-1.0, 2, 3, 4, 5, 6, 7]})
    lines = csv_bytes(table).decode().splitlines()
    assert lines[1:] == ["'=1+1,-1.0", "'+x,2.0", "'-x,3.0", "'@a,4.0", "-5,5.0", '"a,b",6.0', "'\tx,7.0"]


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="there is no such device")
@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("plan uturn --vehicle endless.toml", "vehicle file endless.toml cannot be read: it has more than 16 MB"),
        ("turn --vehicle bus --template endless.toml", "template file endless.toml cannot be read: it has more than 16 MB"),
        ("study endless.toml --out out", "study endless.toml is not valid TOML: it has more than 16 MB"),
        ("bench --suite endless.toml --out out", "suite endless.toml is not valid TOML: it has more than 16 MB"),
    ],
)
def test_a_text_that_never_ends_is_refused(cli: Cli, tmp_path: Path, command: str, words: str) -> None:
    (tmp_path / "endless.toml").symlink_to("/dev/zero")
    outcome = cli(*command.split())
    assert (outcome.code, outcome.err.splitlines()[0]) == (2, f"error: {words}")


@pytest.mark.parametrize("name", ["summary.json", "regions.json", "path.csv", "steps.csv"])
@pytest.mark.parametrize("kind", ["device", "pipe", "huge"])
def test_a_plan_s_folder_of_others_is_not_read_without_end(cli: Cli, tmp_path: Path, name: str, kind: str) -> None:
    (tmp_path / "road.csv").write_text(ROAD, encoding="utf-8")
    assert cli("plan", "road.csv", "--vehicle", "bus", "--no-plot", "--out", "plan").code == 0
    file = tmp_path / "plan" / name
    file.unlink()
    if kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "pipe":
        os.mkfifo(file)
    else:
        with file.open("wb") as made:
            made.truncate(10**12)  # takes no room
    outcome = cli("report", "plan")
    assert (outcome.code, outcome.err.count("error: ")) == (2, 1)
    assert not (tmp_path / "report.html").exists()
