"""The programs of drives as a test set for QP solvers: Parquet files that qpbenchmark reads as they are.

One file a drive, one row a program, in the order in which the drive asked for them. Columns of qpbenchmark: minimise
1/2 x'Px + q'x subject to G x <= h, A x = b, lb <= x <= ub, matrices dense and flattened by rows, and ``name``. Columns of ours:

- ``x``, ``y``, ``z``, ``z_box``: the solution with multipliers, to 1e-11: P x + q + A'y + G'z + z_box = 0, z >= 0, z_box positive at an
  upper bound and negative at a lower one; those of the bounds of elastic columns are left out
- ``x_start``, ...: the warm start that the planner had, empty at a cold one
- ``active``: rows of G with a multiplier
- ``limits``: off, inactive, binding or unkeepable
- ``first``, ``number``: the plan's first station, and the number of the program within its plan

Where limits can be kept rows are hard; where they cannot, every row has an elastic column.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.measuring.recording import ACTIVE, Recorded, record
from hdvplan.bench.suite import AS_SET, Suite
from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.fileio import json_bytes, write_atomically
from hdvplan.qp.program import StageSolution
from hdvplan.record import record_of
from hdvplan.solvers.registry import solver_named
from hdvplan.solvers.sparse import SparseQp

_TOLERANCE = 1e-11  # of the solutions


def cases_to_export(suite: Suite) -> list[Case]:
    """Return the cases of a suite's first solver, one a file: a class of limits is part of the road's name, as nothing else tells it.

    Raises:
        RoadError: a road that cannot be read, or a pinch that closes it.
        VehicleError: a vehicle that cannot be read.

    """
    return [
        case if cell.limits == AS_SET else replace(case, road=replace(case.road, name=f"{case.road.name}-{cell.limits}"))
        for cell, case in zip(suite.cells(), cases_of(suite), strict=True)
        if cell.solver == suite.solvers[0]
    ]


def export(cases: Sequence[Case], directory: Path, most: int | None = None) -> list[Path]:
    """Record the programs of every case's drive, at most ``most`` each, and write them into ``directory``; return the files.

    Raises:
        OptionError: pyarrow is not installed.
        OSError: a file cannot be written.

    """
    arrow, parquet = _arrow()
    directory.mkdir(parents=True, exist_ok=True)
    files = []
    for case in cases:
        file = directory / f"{Path(case.road.name).name}.{case.vehicle.name}.{case.settings.scheme}.parquet"
        rows = [_row(each, f"{file.stem}.{at}") for at, each in enumerate(record(case, most))]
        schema = arrow.Table.from_pylist(rows[:1]).schema if rows else arrow.schema([])
        with parquet.ParquetWriter(file, schema, compression="zstd") as writer:
            for row in rows:  # a row group each: dense matrices of all at once would fill the memory
                writer.write_table(arrow.Table.from_pylist([row], schema=schema))
        files.append(file)
    write_atomically(directory / "run.json", json_bytes(record_of(cases)))
    return files


def _arrow() -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        msg = "writing Parquet files needs pyarrow, which is not installed"
        raise OptionError(msg, hint="pip install pyarrow") from error


def _row(each: Recorded, name: str) -> dict[str, object]:
    form = SparseQp.of(each.qp.shape, elastic=each.limits == "unkeepable")
    form.load(each.qp)
    exact = solver_named("riccati", _TOLERANCE)(each.qp.shape).solve(each.qp, None).point
    solution, start = _vectors(form, exact), _vectors(form, each.guess)
    full = form.P + sp.triu(form.P, 1).T
    return {
        "P": full.toarray().ravel(), "q": form.q, "G": form.G.toarray().ravel(), "h": form.h, "A": form.E.toarray().ravel(), "b": form.b,
        "lb": form.low, "ub": form.high, "name": name,
        **solution, **{f"{part}_start": values for part, values in start.items()},
        "active": np.flatnonzero(solution["z"] > ACTIVE), "limits": each.limits, "first": each.first, "number": each.number,
    }  # fmt: skip


def _vectors(form: SparseQp, point: StageSolution | None) -> dict[str, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    if point is None:
        return {part: np.empty(0) for part in ("x", "y", "z", "z_box")}
    return dict(zip(("x", "y", "z", "z_box"), form.flatten(point), strict=True))
