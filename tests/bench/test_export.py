"""Exported programs: what the files hold is what was solved, and others read and solve them alike."""

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
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import load_vehicle

pytest.importorskip("pyarrow")


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    settings = PlannerSettings(horizon=15.0)
    cases = [Case(SCENARIOS["uturn"]().with_limits(w, w), load_vehicle("bus"), settings=settings) for w in (2.2, 6.0)]
    return [*export(cases[:1], tmp_path_factory.mktemp("tight")), *export(cases[1:], tmp_path_factory.mktemp("wide"), most=4)]


def solved(row: Any) -> FloatArray:  # noqa: ANN401 - a row of pandas
    """Return x of a file's row by Clarabel at 1e-12."""
    n = len(row.q)
    P, G, A = (np.asarray(row[part]).reshape(-1, n) for part in ("P", "G", "A"))
    above, below = np.isfinite(row.ub), np.isfinite(row.lb)
    matrix = sp.csc_matrix(np.vstack([A, G, np.eye(n)[above], -np.eye(n)[below]]))
    right = np.concatenate([row.b, row.h, row.ub[above], -row.lb[below]])
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    settings.tol_gap_abs = settings.tol_gap_rel = settings.tol_feas = 1e-12
    cones = [clarabel.ZeroConeT(len(row.b)), clarabel.NonnegativeConeT(len(right) - len(row.b))]
    solution = clarabel.DefaultSolver(sp.csc_matrix(np.triu(P)), row.q, matrix, right, cones, settings).solve()
    return np.array(solution.x)


@pytest.mark.slow
def test_an_independent_solver_finds_our_solutions(files: list[Path]) -> None:
    kinds = set()
    for file in files:
        for _, row in pd.read_parquet(file).iterrows():
            assert np.max(np.abs(solved(row) - row.x)) < 1e-8  # both run to 1e-10 and less
            kinds.add(row.limits)
    assert kinds >= {"inactive", "unkeepable"}


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


def test_qpbenchmark_reads_the_files(files: list[Path]) -> None:
    pytest.importorskip("qpbenchmark")
    from qpbenchmark.parquet_test_set import ParquetTestSet  # noqa: PLC0415 - an optional peer

    class Planning(ParquetTestSet):  # type: ignore[misc] # it has no types
        title, description, sparse_only = "hdvplan", "planning", False

    read = list(Planning(files[0]))
    written = pd.read_parquet(files[0])
    assert len(read) == len(written)
    for problem, (_, row) in zip(read, written.iterrows(), strict=True):
        assert problem.name == row["name"]  # a row's own name is its index
        assert np.all(problem.G @ row.x <= problem.h + 1e-6)  # a broken row would be 1e-3 and more
        assert np.allclose(problem.A @ row.x, problem.b, rtol=0.0, atol=1e-9)  # dynamics to rounding
