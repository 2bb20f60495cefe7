"""Tell which folders of results are older than what the program does now; exit code 1 where that is not written down.

    python benchmarks/check_results.py           # what run.json, behaviour.toml and the installed solvers say
    python benchmarks/check_results.py --times   # measures, for minutes: whether planning takes another time than when it was tabulated

results.toml names the areas of behaviour that each folder rests on, and whether it has times. A folder is stale where it has no run.json,
where one of its areas had another integer (hdvplan/behaviour.toml), where it was made before the moment ``moved``, or, for times, where a
solver of another minor version is installed.
Stale folders are listed in results/stale.txt, one a line: one that is not listed, and one that is listed and is not stale, are errors.
Whoever makes a folder anew takes its line out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, cast

from hdvplan.machine import behaviour, software

RESULTS = Path(__file__).parents[1] / "results"
TABLE = Path(__file__).parent / "results.toml"
_SOLVERS = ("piqp", "clarabel", "osqp", "casadi", "daqp", "proxsuite", "qpsolvers")
_GATE = (sys.executable, "-m", "hdvplan", "bench", "--json", "--quiet", "--against")


def why_stale(folder: Path, areas: Sequence[str], *, times: bool, moved: datetime | None = None) -> str | None:
    """Return why a folder of results, or one in it, is stale; None where none is.

    ``areas`` are those of behaviour that it rests on; ``moved`` is when a change moved what it holds and raised no integer.
    """
    if (folder / "run.json").exists():
        return _stale(folder / "run.json", areas, times=times, moved=moved)
    parts = {path.parent.name: path for path in sorted(folder.glob("*/run.json"))}
    parts |= {path.name.removesuffix("-run.json"): path for path in sorted(folder.glob("*-run.json"))}
    found = ((name, _stale(path, areas, times=times, moved=moved)) for name, path in parts.items())
    return next((f"{name}: {reason}" for name, reason in found if reason), None) if parts else "it has no run.json"


def _stale(path: Path, areas: Sequence[str], *, times: bool, moved: datetime | None) -> str | None:
    record = json.loads(path.read_text(encoding="utf-8"))
    ran, now = record.get("software", {}), behaviour()
    if "behaviour" not in ran:
        return "it was made before behaviour was numbered"
    changed = [area for area in areas if ran["behaviour"].get(area) != now[area]]
    if changed:
        return f"{', '.join(changed)} changed since"
    if moved is not None and _begun(record) < moved:
        return f"it was made before {moved:%Y-%m-%d %H:%M}, when what it holds moved (results.toml)"
    return _other_solver(record, ran.get("packages", {})) if times else None


def _begun(record: Mapping[str, Any]) -> datetime:
    return datetime.fromisoformat(record["date"] if "date" in record else record["sessions"][0]["started"])


def _other_solver(record: Mapping[str, Any], packages: Mapping[str, str]) -> str | None:
    solvers = tuple(dict.fromkeys(solvers_of(record)))
    here = cast("dict[str, str]", software(solvers)["packages"])
    for name in (name for name in _SOLVERS if any(name in solver for solver in solvers)):
        then, now = packages.get(name), here.get(name)
        if then and now and minor(then) != minor(now):
            return f"it was made with {name} {then}, and {now} is installed"
    return None


def solvers_of(record: Mapping[str, object]) -> list[str]:
    """Return the solvers of a record: of a benchmark's suite, or of its cases."""
    suite, cases = record.get("suite"), record.get("cases")
    if isinstance(suite, dict):
        return [str(name) for name in suite.get("solvers", [])]
    return [str(case["solver"]) for case in cases if isinstance(case, dict) and "solver" in case] if isinstance(cases, list) else []


def minor(version: str) -> list[str]:
    """Return the first two parts of a version."""
    return version.split(".")[:2]


def listed_stale(results: Path) -> set[str]:
    """Return the folders that stale.txt names."""
    return {line.split()[0] for line in (results / "stale.txt").read_text(encoding="utf-8").splitlines() if line and line[0] != "#"}


def check(results: Path, table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return what is wrong: a folder that ``table`` does not name, a stale one that is not listed, a listed one that is not stale."""
    listed = listed_stale(results)
    folders = sorted(path for path in results.iterdir() if path.is_dir())
    wrong = [f"{name}: there is no such folder; take it out of results.toml" for name in table if name not in {one.name for one in folders}]
    for folder in folders:
        if folder.name not in table:
            wrong.append(f"{folder.name}: results.toml does not say what it rests on")
            continue
        entry = table[folder.name]
        reason = why_stale(folder, entry["areas"], times=entry["times"], moved=entry.get("moved"))
        if reason is not None and folder.name not in listed:
            wrong.append(f"{folder.name}: {reason}; make it anew (results/README.md) or list it in stale.txt")
        if reason is None and folder.name in listed:
            wrong.append(f"{folder.name}: it is not stale; take it out of stale.txt")
    return wrong


def check_times(results: Path, table: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Return which folders with times were made at a commit that plans in another time than this one, as the timing gate measures it."""
    commits: dict[str, list[str]] = {}
    for name in (name for name, entry in table.items() if entry["times"]):
        for record in sorted((results / name).glob("**/*run.json")):
            commit = (json.loads(record.read_text(encoding="utf-8")).get("commit") or "").removesuffix("+")
            commits.setdefault(commit, []).append(name)
    return [f"{', '.join(dict.fromkeys(names))}: {said}" for commit, names in commits.items() if (said := _against(commit)) is not None]


def _against(commit: str) -> str | None:
    """Return what the timing gate finds against a commit; None where planning takes as long."""
    if not commit:
        return "no commit says what was measured"
    with tempfile.TemporaryDirectory() as folder:
        ended = subprocess.run([*_GATE, commit, "--out", folder], capture_output=True, text=True, check=False)  # noqa: S603 - our own command
    try:
        found = json.loads(ended.stdout)
    except ValueError:
        return f"against {commit[:7]}: {(ended.stderr.strip() or 'the gate said nothing').splitlines()[0]}"
    faster = [one for one in found.get("times", []) if one.get("high") is not None and one["high"] < 1.0 / found["factor"]]
    if ended.returncode == 0 and not faster:
        return None
    return f"against {commit[:7]}: {found['summary']}" + (f"; faster in {len(faster)} cells" if faster else "")


def main(arguments: Sequence[str] | None = None) -> int:
    """Print what is wrong, and return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--times", action="store_true", help="measure whether planning times changed since the tables were made")
    table = tomllib.loads(TABLE.read_text(encoding="utf-8"))
    found = (check_times if parser.parse_args(arguments).times else check)(RESULTS, table)
    print("\n".join(found) or "all results are as new as they claim")
    return 1 if found else 0


if __name__ == "__main__":
    sys.exit(main())
