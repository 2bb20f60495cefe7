"""How much of the house one has to hold in the head: floors of packages, and modules that a planning step passes."""

from __future__ import annotations

import ast
import sys
from functools import cache
from pathlib import Path
from types import FrameType

import pytest

import hdvplan
from hdvplan.driving.drive import ready
from hdvplan.planning.bias import NONE
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.settings import PlannerSettings
from hdvplan.solvers.registry import dependable

HOUSE = Path(hdvplan.__file__).parent


def needed(module: Path) -> set[str]:
    """Return the packages and modules at the top of the house that a module imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").partition(".")[0] == "hdvplan":
            _, *rest = (node.module or "").split(".")
            found |= set(rest[:1]) or {one.name for one in node.names}
    return found


@pytest.mark.slow
def test_the_deepest_chain_of_packages_has_at_most_14_floors() -> None:
    tops = [top for top in HOUSE.iterdir() if top.suffix == ".py" or (top / "__init__.py").is_file()]
    below = {top.stem: {one for module in (top.rglob("*.py") if top.is_dir() else [top]) for one in needed(module)} for top in tops}

    @cache
    def floors(name: str) -> int:
        return 1 + max((floors(other) for other in below[name] & below.keys() - {name, "__init__"}), default=0)

    assert 8 < floors("cli") <= 14  # demanded; by far more than 8


@pytest.mark.parametrize("solver", ["riccati", "piqp"])
def test_a_planning_step_passes_at_most_nine_modules(solver: str) -> None:
    road, vehicle = hdvplan.load_road("uturn").with_limits(4.0, 4.0), hdvplan.load_vehicle("tractor-trailer")
    begun = ready(road, vehicle, objective_named("geometric"), dependable(solver), PlannerSettings(), NONE)
    seen = set[str]()

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and frame.f_code.co_filename.startswith(str(HOUSE)):
            seen.add(frame.f_code.co_filename)

    sys.setprofile(note)
    try:
        begun.planner.plan(0, *begun.begin)
    finally:
        sys.setprofile(None)
    assert 1 <= len(seen) <= 9  # demanded; seven with a solver in Python's hands, one with ours
