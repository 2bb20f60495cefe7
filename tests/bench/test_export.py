"""Exported programs: what the files hold is what was solved, and others read and solve them alike."""

import json
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import clarabel
import numpy as np
import pandas as pd
import pytest
import scipy.sparse as sp

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.export import cases_to_export, export
from hdvplan.bench.suite import Suite
from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.planning.settings import PlannerSettings
from hdvplan.qp.program import StageQp, StageShape
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.solvers.riccati import InteriorWorkspace
from hdvplan.vehicle.load import load_vehicle
from tests.core.twins import kinematics as twin

pytest.importorskip("pyarrow")
sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))
from qp_loaders import from_acados, from_npz, from_parquet, names

HALF_WIDTHS = (2.2, 2.48, 6.0)  # cannot be kept; bind; do not
MOST = None


def sequences(folder: Path, form: str) -> Path:
    settings = PlannerSettings(horizon=15.0)
    cases = []
    for width in HALF_WIDTHS:
        road = SCENARIOS["uturn"]().with_limits(width, width)
        cases.append(Case(replace(road, name=f"uturn-{width}"), load_vehicle("bus"), settings=settings))
    export(cases, folder, form, MOST)
    return folder


@pytest.fixture(scope="module")
def dense(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sequences(tmp_path_factory.mktemp("dense"), "qpbenchmark")


@pytest.fixture(scope="module")
def sparse(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sequences(tmp_path_factory.mktemp("sparse"), "npz")


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return sequences(tmp_path_factory.mktemp("staged"), "acados")


@pytest.fixture
def files(dense: Path) -> list[Path]:
    return [dense / f"uturn-{width}.bus.rti.parquet" for width in (2.2, 6.0)]


def solved(row: dict[str, Any]) -> FloatArray:
    """Return x of a program by Clarabel at 1e-12."""
    n = len(row["q"])
    P, G, A = (sp.csc_matrix(row[part]) for part in "PGA")
    above, below, eye = np.isfinite(row["ub"]), np.isfinite(row["lb"]), sp.eye_array(n, format="csr")
    matrix = sp.vstack([A, G, eye[above], -eye[below]], format="csc")
    right = np.concatenate([row["b"], row["h"], row["ub"][above], -row["lb"][below]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    cones = [clarabel.ZeroConeT(len(row["b"])), clarabel.NonnegativeConeT(len(right) - len(row["b"]))]
    solution = clarabel.DefaultSolver(sp.csc_matrix(sp.triu(P)), row["q"], matrix, right, cones, settings).solve()
    return np.array(solution.x)


@pytest.mark.slow
def test_the_manifest_names_every_program_with_its_place_and_how_exact_its_solution_is(sparse: Path) -> None:
    manifest = json.loads((sparse / "manifest.json").read_text(encoding="utf-8"))
    assert {sequence["notice"] for sequence in manifest["sequences"]} == {None}  # scenarios owe nobody an attribution
    programs = [program for sequence in manifest["sequences"] for program in sequence["programs"]]
    assert [name for _, name in names(sparse)] == [program["name"] for program in programs]
    assert {program["limits"] for program in programs} == {"unkeepable", "binding", "inactive"}
    assert max(max(program[f"{part}_by_scale"] for part in ("dual", "gap")) for program in programs) < 1e-10  # what the format promises
    assert max(program["primal"] for program in programs) < 1e-10
    for sequence in manifest["sequences"]:
        own = sequence["programs"]
        assert [program["shift"] for program in own] == [0, *np.diff([program["first"] for program in own])]
    assert any(program["shift"] == 10 for program in programs)  # 5 m at stations 0.5 m apart


@pytest.mark.slow
def test_an_independent_solver_finds_the_solutions_of_both_forms_with_matrices(dense: Path, sparse: Path) -> None:
    told = dict(names(sparse))
    for sequence in told:
        for row in from_parquet(dense, sequence):
            same = from_npz(sparse, sequence, row["name"])
            for program in (row, same):
                assert np.max(np.abs(solved(program) - program["x"])) < 1e-8  # both run to 1e-10 and less
            for part in ("P", "G", "A"):
                np.testing.assert_array_equal(row[part], same[part].toarray())


def test_sparse_programs_are_what_was_planned_with_and_their_solutions_solve_them(sparse: Path) -> None:
    for sequence, name in names(sparse):
        row = from_npz(sparse, sequence, name)
        assert row["P"].nnz < 0.05 * len(row["q"]) ** 2
        stationary = row["P"] @ row["x"] + row["q"] + row["A"].T @ row["y"] + row["G"].T @ row["z"] + row["z_box"]
        assert np.max(np.abs(stationary)) < 1e-9 * max(1.0, np.max(np.abs(row["z"]), initial=0.0))  # as exact as the manifest says
        assert np.all((row["z_box"] >= 0.0) | np.isfinite(row["lb"]))
        assert np.all((row["z_box"] <= 0.0) | np.isfinite(row["ub"]))
        assert np.max(np.abs(row["A"] @ row["x"] - row["b"])) < 1e-12  # dynamics to rounding
        assert np.max(row["G"] @ row["x"] - row["h"]) < 1e-10


def test_the_layout_finds_the_dynamics_of_a_stage_and_the_price_of_its_slacks(sparse: Path) -> None:
    manifest = json.loads((sparse / "manifest.json").read_text(encoding="utf-8"))
    units, step, standing = load_vehicle("bus").table(), 0.5, np.zeros(3)  # the U-turn begins with a straight

    def rates(x: FloatArray) -> FloatArray:
        return np.append(twin.rates(units, 0.0, x[:2], x[2]), 0.0)

    def driven(x: FloatArray) -> FloatArray:
        return x + step * rates(x + 0.5 * step * rates(x))

    reach = 1e-5 * np.eye(3)
    expected = np.array([(driven(standing + one) - driven(standing - one)) / 2e-5 for one in reach]).T
    for sequence in manifest["sequences"]:
        program = sequence["programs"][0]
        row = from_npz(sparse, sequence["name"], program["name"])
        elastic = program["limits"] == "unkeepable"
        columns = {name: np.array(at, int) for name, at in sequence["layout"]["elastic" if elastic else "hard"].items()}
        rows = len(columns["x"][0]) + np.arange(3)
        np.testing.assert_allclose(row["A"][rows][:, columns["x"][0]].toarray(), expected, atol=1e-9)
        np.testing.assert_allclose(row["A"][rows][:, columns["u"][0]].toarray(), expected[:, 2:], atol=1e-9)  # a change of kappa
        np.testing.assert_array_equal(row["A"][rows][:, columns["x"][1]].toarray(), -np.eye(3))
        assert np.all(row["q"][columns["sigma"]] > 0.0)
        assert np.all(row["lb"][columns["sigma"]] == 0.0)
        every = np.concatenate([at.ravel() for at in columns.values()])
        assert sorted(every) == list(range(len(row["q"])))


@pytest.mark.slow
def test_stages_are_the_programs_and_the_iterate_is_their_solution(staged: Path) -> None:
    for sequence, name in names(staged):
        stages, iterate = from_acados(staged, sequence, name)
        last = len(stages["Q"]) - 1
        n, m, p = len(stages["q"][0]), len(stages["r"][0]), len(stages["ug"][1])
        qp = StageQp.empty(StageShape(last, n, m, p, tuple(int(index) - m for index in stages["idxb"][1][m:])))
        for field, blocks in {"A": "A", "B": "B", "c": "b", "Q": "Q", "q": "q", "u_low": "lbu", "u_high": "ubu"}.items():
            getattr(qp, field)[:] = [block for block in stages[blocks] if block.size]
        for field, blocks in {"R": "R", "r": "r"}.items():
            getattr(qp, field)[:] = stages[blocks][:-1]
        for field, blocks in {"G": "C", "h": "ug", "linear": "zu", "quadratic": "Zu", "x_low": "lbx", "x_high": "ubx"}.items():
            getattr(qp, field)[:] = stages[blocks][1:]
        qp.x_first[:] = stages["lbx"][0]
        x, u = np.array(iterate["x_traj"]), np.array(iterate["u_traj"][:-1])
        point = InteriorWorkspace(qp.shape, tolerance=1e-10).solve(qp, None).point
        # Another method at 1e-10 on the same optimum: to 1e-8, and an input that costs little to its root.
        np.testing.assert_allclose(point.x[:, 0], x[:, 0], atol=1e-7)
        np.testing.assert_allclose(qp.A @ x[:-1, :, None] + qp.B @ u[:, :, None] + qp.c[:, :, None], x[1:, :, None], atol=1e-12)
        assert [len(lam) for lam in iterate["lam_traj"]] == [2 * (m + n), *[2 * (m + 1 + 2 * p)] * (last - 1), 2 * (1 + 2 * p)]


def test_a_second_export_into_a_folder_is_refused_as_the_programs_of_both_would_lie_there(tmp_path: Path) -> None:
    export([], tmp_path, "npz")
    with pytest.raises(OptionError, match="holds an export already"):
        export([], tmp_path, "npz")


def test_a_format_that_nobody_reads_is_refused(tmp_path: Path) -> None:
    with pytest.raises(OptionError, match="no format of QPs is called 'mat'"):
        export([], tmp_path, "mat")


@pytest.mark.slow
def test_multipliers_of_hard_rows_have_the_signs_that_the_module_states(files: list[Path]) -> None:
    rows = pd.read_parquet(files[1])
    assert set(rows.limits) == {"inactive"}
    for _, row in rows.iterrows():
        P, G, A = (np.asarray(row[part]).reshape(-1, len(row.q)) for part in ("P", "G", "A"))
        assert np.max(np.abs(P @ row.x + row.q + A.T @ row.y + G.T @ row.z + row.z_box)) < 1e-9  # solved to 1e-11, unscaled
        assert np.all(row.z >= 0.0)


def test_warm_starts_belong_to_shifted_plans_and_cold_ones_have_none(files: list[Path]) -> None:
    rows = pd.read_parquet(files[0])
    assert len(rows.x_start[0]) == 0
    warm = [row for _, row in rows.iterrows() if len(row.x_start)]
    assert warm
    assert all(len(row.x_start) == len(row.q) and len(row.z_start) == len(row.h) for row in warm)
    assert list(rows["first"]) == sorted(rows["first"])


def test_every_class_of_limits_is_a_file_of_its_own() -> None:
    cases = cases_to_export(Suite(("riccati", "piqp"), ("bus",), ("uturn",), ("rti",), classes=("off", "inactive")))
    assert [case.road.name for case in cases] == ["uturn-off", "uturn-inactive"]


def test_qpbenchmark_reads_the_files_and_finds_the_same_optimum(files: list[Path]) -> None:
    pytest.importorskip("qpbenchmark")
    from qpbenchmark.parquet_test_set import ParquetTestSet  # noqa: PLC0415 - an optional peer
    from qpsolvers import solve_problem  # noqa: PLC0415 - loads every solver that it finds

    class Planning(ParquetTestSet):  # type: ignore[misc] # it has no types
        title, description, sparse_only = "hdvplan", "planning", False

    read = list(Planning(files[0]))
    written = pd.read_parquet(files[0])
    assert len(read) == len(written)
    for problem, (_, row) in zip(read, written.iterrows(), strict=True):
        assert problem.name == row["name"]  # a row's own name is its index
        assert np.all(problem.G @ row.x <= problem.h + 1e-6)  # a broken row would be 1e-3 and more
        assert np.allclose(problem.A @ row.x, problem.b, rtol=0.0, atol=1e-9)  # dynamics to rounding
        found = np.asarray(solve_problem(problem, solver="piqp", eps_abs=1e-11, eps_rel=0.0).x, float)
        written_value, value = (0.5 * x @ problem.P @ x + problem.q @ x for x in (row.x, found))
        assert value == pytest.approx(written_value, rel=1e-8, abs=1e-8)  # as promised; both end at some 1e-11
