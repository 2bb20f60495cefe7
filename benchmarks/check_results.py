"""Tell which folders of results are older than the code that they are about; exit code 1 where that is not written down.

    python benchmarks/check_results.py

A folder is stale where it has no run.json, where the planning code has changed since (``hdvplan.machine.planning_code``), or
where a solver of another minor version is installed than the one that ran. Stale folders are listed in results/stale.txt, one a
line: one that is not listed, and one that is listed and is not stale, are errors. Whoever makes a folder anew takes its line out.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import cast

from hdvplan.machine import planning_code, software

RESULTS = Path(__file__).parents[1] / "results"
_SOLVERS = ("piqp", "clarabel", "osqp", "casadi", "daqp", "proxsuite", "qpsolvers")


def why_stale(folder: Path) -> str | None:
    """Return why a folder of results, or one in it, is stale; None where none is."""
    parts = sorted(path.parent for path in folder.glob("*/run.json"))
    if not (folder / "run.json").exists() and parts:
        return next((f"{part.name}: {reason}" for part in parts if (reason := why_stale(part))), None)
    try:
        record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    except OSError:
        return "it has no run.json"
    ran = record.get("software", {})
    if "planning" not in ran:
        return "it was made before the planning code was recorded"
    solvers = tuple(dict.fromkeys(solvers_of(record)))
    if ran["planning"] != planning_code(solvers):
        return "the planning code has changed since"
    here = cast("dict[str, str]", software(solvers)["packages"])
    used = [name for name in _SOLVERS if any(name in solver for solver in solvers)]
    for name in used:
        then, now = ran["packages"].get(name), here.get(name)
        if then and now and minor(then) != minor(now):
            return f"it was made with {name} {then}, and {now} is installed"
    return None


def solvers_of(record: dict[str, object]) -> list[str]:
    """Return the solvers of a record: of a benchmark's suite, or of its cases."""
    suite, cases = record.get("suite"), record.get("cases")
    if isinstance(suite, dict):
        return [str(name) for name in suite.get("solvers", [])]
    return [str(case["solver"]) for case in cases if isinstance(case, dict) and "solver" in case] if isinstance(cases, list) else []


def minor(version: str) -> list[str]:
    """Return the first two parts of a version."""
    return version.split(".")[:2]


def check(results: Path) -> list[str]:
    """Return what is wrong: a stale folder that is not listed, a listed one that is not stale."""
    listed = {line.split()[0] for line in (results / "stale.txt").read_text(encoding="utf-8").splitlines() if line and line[0] != "#"}
    wrong = []
    for folder in sorted(path for path in results.iterdir() if path.is_dir()):
        reason = why_stale(folder)
        if reason is not None and folder.name not in listed:
            wrong.append(f"{folder.name}: {reason}; make it anew (results/README.md) or list it in stale.txt")
        if reason is None and folder.name in listed:
            wrong.append(f"{folder.name}: it is not stale; take it out of stale.txt")
    return wrong


if __name__ == "__main__":
    found = check(RESULTS)
    print("\n".join(found) or "all results are as new as they claim")
    sys.exit(1 if found else 0)
