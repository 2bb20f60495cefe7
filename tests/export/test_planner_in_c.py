"""The planner as C files: it compiles as strictly as promised, plans what hdvplan plans, and keeps to its budget."""

from __future__ import annotations

import csv
import itertools
import platform
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from hdvplan.api import drive_case
from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.export import UNLIMITED, Budget
from hdvplan.export.write import PLANNER, exported
from hdvplan.road.load import load_road
from hdvplan.stepping import Stepper
from hdvplan.vehicle.load import load_vehicle

if TYPE_CHECKING:
    from exported_planner import ExportedPlanner

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
TIGHT = Case(load_road("uturn").with_limits(2.55, 2.55), load_vehicle("bus"))  # 2.49 m are needed
# What a freestanding compiler asks of its environment, and functions of math.h.
STACK_BYTES = 16384  # of one function: embedded systems give a task some tens of kB
ASKED = {"memcpy", "memmove", "memset", "memcmp", "sin", "cos", "tan", "atan", "sqrt", "hypot", "fabs", "copysign", "sincos"}


@pytest.fixture(scope="module")
def compiled() -> Iterator[type[ExportedPlanner]]:
    with pytest.MonkeyPatch.context() as patched:
        patched.syspath_prepend(str(Path(__file__).parents[2] / "benchmarks"))
        from exported_planner import ExportedPlanner  # noqa: PLC0415 - a script, found by now

        yield ExportedPlanner


@pytest.fixture(scope="module")
def tight(compiled: type[ExportedPlanner], tmp_path_factory: pytest.TempPathFactory) -> ExportedPlanner:
    return compiled(TIGHT, tmp_path_factory.mktemp("tight"), flags=("-O1",))


def ran(folder: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Return what a command has printed."""
    return subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)  # noqa: S603 - fixed


@pytest.mark.slow
@pytest.mark.skipif(platform.machine() != "x86_64", reason="instructions of x86-64")
def test_it_compiles_without_a_warning_for_a_processor_of_one_s_own(tmp_path: Path) -> None:
    ran(tmp_path, sys.executable, "-m", "hdvplan", "export-c", "--vehicle", "semitrailer-active", "--half-width", "3.2", "--out", "planner")
    fast = "-O3 -march=x86-64-v3 -ffp-contract=fast -fno-math-errno -fno-trapping-math"
    ran(tmp_path / "planner", "make", "freestanding", f"CFLAGS=-std=c99 -Wall -Wextra -Werror -pedantic {fast}")


@pytest.mark.slow
def test_the_sample_drives_what_hdvplan_drives_under_sanitizers(tmp_path: Path) -> None:
    words = ["export-c", "--vehicle", "tractor-trailer", "--half-width", "3.2", "--out", "planner"]
    said = ran(tmp_path, sys.executable, "-m", "hdvplan", *words)
    assert said.stdout == "planner/ holds the planner; try it: make -C planner && planner/sample > driven.csv\n"
    assert said.stderr == "a planning step has at most 120 factorisations and 24 linearisations\n"
    strict = "-std=c99 -O1 -g -Wall -Wextra -Werror -pedantic -fsanitize=address,undefined -fno-sanitize-recover=all"
    ran(tmp_path / "planner", "make", f"CFLAGS={strict}")
    sample = ran(tmp_path, "planner/sample")
    header, *lines = csv.reader(sample.stdout.splitlines())
    assert header == ["s", "e_y", "e_psi", "beta1", "kappa"]
    rows = np.array([[float(word) for word in row] for row in lines])
    own = drive_case(Case(load_road("uturn").with_limits(3.2, 3.2), load_vehicle("tractor-trailer")))
    # the sample simulates at steps of 5 cm, as the drive does; limits bind, and rounding is that of another compiler
    assert np.max(np.abs(rows[:, 1:4] - own.z)) < 1e-9
    assert "0 with the budget spent, 0 kept, 0 beyond the model" in sample.stderr


@pytest.mark.slow
def test_every_plan_of_a_tight_drive_is_that_of_hdvplan(tight: ExportedPlanner) -> None:
    tight.begin(UNLIMITED)
    stepper = Stepper(TIGHT)
    while not stepper.done:
        motion = tight.step(stepper.at, stepper.z, stepper.kappa)
        plan = stepper.plan()
        # other flags round otherwise; what is asked of plans is 1e-12
        assert np.max(np.abs(motion[:, :-1] - plan.z)) < 1e-12
        assert np.max(np.abs(motion[:-1, -1] - plan.kappa)) < 1e-12
        assert tight.violations[-1] == pytest.approx(plan.violation, abs=1e-12)
        assert tight.counts[-1][:3] == ("done", plan.qp_count, plan.qp_iterations)
        stepper.arrive(stepper.simulate(plan)[-1], float(plan.kappa[stepper.count - 1]))


def test_every_plan_where_limits_bind_takes_what_hdvplan_takes(tmp_path: Path, compiled: type[ExportedPlanner]) -> None:
    case = Case(load_road("monaco_fairmont_hairpin").with_limits(3.5, 3.5), load_vehicle("bus"))
    planner, stepper, took = compiled(case, tmp_path, flags=("-O1",)), Stepper(case), []
    while not stepper.done:
        motion = planner.step(stepper.at, stepper.z, stepper.kappa)
        plan = stepper.plan()
        # the interior point's weights of 1e8 turn the rounding of other flags into 1e-11 m at one plan in a hundred
        assert np.max(np.abs(motion[:, :-1] - plan.z)) < 1e-10
        assert planner.counts[-1][:3] == ("done", plan.qp_count, plan.qp_iterations)
        took.append(plan.qp_iterations)
        stepper.arrive(stepper.simulate(plan)[-1], float(plan.kappa[stepper.count - 1]))
    assert any(2 <= count <= 6 for count in took)  # of the active set: the interior point takes more


def test_tables_that_move_along_give_the_same_plans(tight: ExportedPlanner) -> None:
    tight.begin(UNLIMITED)
    stepper = Stepper(TIGHT)
    while not stepper.done:
        if stepper.at >= 2 * stepper.count:
            tight.refresh(stepper.at - stepper.count)  # the last plan's first station stays
        motion = tight.step(stepper.at, stepper.z, stepper.kappa)
        plan = stepper.plan()
        assert np.max(np.abs(motion[:, :-1] - plan.z)) < 1e-12  # as above
        stepper.arrive(stepper.simulate(plan)[-1], float(plan.kappa[stepper.count - 1]))


@pytest.mark.parametrize("budget", [Budget(1, 3), Budget(6, 3)])
def test_a_step_keeps_to_its_budget_and_its_motion_to_the_vehicle(tight: ExportedPlanner, budget: Budget) -> None:
    tight.begin(budget)
    stepper, vehicle, step = Stepper(TIGHT), TIGHT.vehicle, TIGHT.settings.step
    while not stepper.done:
        motion = tight.step(stepper.at, stepper.z, stepper.kappa)
        status, _, factorisations, linearisations = tight.counts[-1]
        assert status in {"done", "spent"}
        assert factorisations <= budget.factorisations
        assert linearisations <= budget.linearisations
        kappa = np.array([stepper.kappa, *motion[:-1, -1]])
        assert np.max(np.abs(kappa)) <= vehicle.max_curvature + 1e-6  # of a solver's bounds
        assert np.max(np.abs(np.diff(kappa))) <= vehicle.max_curvature_rate * step + 1e-6
        plan = stepper.plan()  # for what it is not: the motion is that of the files
        own = type(plan)(**{**vars(plan), "z": motion[:, :-1], "kappa": motion[:-1, -1]})
        states = stepper.simulate(own)
        # a plan's own prediction is exact to millimetres over the part that is driven
        assert np.max(np.abs(states[:, 0] - motion[: len(states), 0])) < 5e-3
        stepper.arrive(states[-1], float(motion[stepper.count - 1, -1]))
    assert any(status == "spent" for status, *_ in tight.counts)


@pytest.mark.parametrize("factorisations", [1, 6, 20])
def test_a_step_from_another_curvature_than_its_last_plan_s_steers_what_the_vehicle_can(
    tight: ExportedPlanner, factorisations: int
) -> None:
    """However early the budget ends: the last plan's steering is brought within reach before anything is solved."""
    most, change = TIGHT.vehicle.max_curvature, TIGHT.vehicle.max_curvature_rate * TIGHT.settings.step
    start, ended = np.zeros(TIGHT.vehicle.states), set()
    for station, before, off in itertools.product((40, 80, 120), (-most, most), ([1.2, 0.3], [-1.2, -0.3], [1.2, -0.3])):
        tight.begin(UNLIMITED)
        tight.step(station, start, 0.0)
        tight.keep_to(Budget(factorisations, 3))
        kappa = np.array([before, *tight.step(station + 10, np.array(off), before)[:-1, -1]])
        ended.add(tight.counts[-1][0])
        assert np.max(np.abs(kappa)) <= most + 1e-6  # of a solver's bounds
        assert np.max(np.abs(np.diff(kappa))) <= change + 1e-6
    assert "spent" in ended


def test_a_state_outside_the_model_or_the_tables_has_no_plan(tight: ExportedPlanner) -> None:
    tight.begin(UNLIMITED)
    tight.step(40, np.zeros(TIGHT.vehicle.states), 0.0)  # before any plan there is no motion to read
    for station, state in ((0, [0.0, 1.6]), (0, [float("nan"), 0.0]), (0, [100.0, 0.0]), (10_000, [0.0, 0.0]), (-1, [0.0, 0.0])):
        tight.step(station, np.array(state), 0.0)
        assert tight.counts[-1][0] == "beyond"


@pytest.mark.slow
def test_the_planner_asks_for_nothing_but_mathematics_and_copies(tmp_path: Path) -> None:
    for name, text in exported(TIGHT, UNLIMITED).items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    ran(tmp_path, "make", "freestanding", "CFLAGS=-std=c99 -O0 -fno-pic")
    listed = ran(tmp_path, "nm", *(f"{name}.o" for name in ("planner", "vehicle", *PLANNER))).stdout
    symbols = [line.split()[-2:] for line in listed.splitlines() if line.strip() and not line.endswith(":")]
    defined = {name for kind, name in symbols if kind != "U"}
    assert {name for kind, name in symbols if kind == "U"} - defined <= ASKED
    assert {kind for kind, _ in symbols} <= set("TtRrUd")  # no memory of its own that is written: neither data nor bss
    assert "malloc" not in listed
    frames = [int(line.split("\t")[1]) for path in tmp_path.glob("*.su") for line in path.read_text(encoding="utf-8").splitlines()]
    assert 0 < max(frames) < STACK_BYTES  # what is larger belongs into the caller's memory


@pytest.mark.parametrize(
    ("changed", "said"),
    [
        ({"objective": "body-max"}, "the objective body-max cannot be exported: it is more than centring two axles"),
        ({"solver": "piqp"}, "only the solver riccati is exported, not piqp"),
    ],
)
def test_what_cannot_be_exported_is_refused(changed: dict[str, str], said: str) -> None:
    case = Case(TIGHT.road, TIGHT.vehicle, **changed)  # type: ignore[arg-type]
    with pytest.raises(OptionError, match=said):
        exported(case, UNLIMITED)


def test_a_name_from_a_user_ends_no_comment() -> None:
    named = replace(TIGHT.vehicle, name='*/ #include "evil.h"')
    assert "*/ #include" not in exported(replace(TIGHT, vehicle=named), UNLIMITED)["vehicle.h"]
