"""The programs of drives as test sets for QP solvers, in the formats that their authors read, with one manifest.

- ``qpbenchmark``: a Parquet file a drive, a row a program, as qpbenchmark's ``ParquetTestSet`` reads it: matrices dense and flattened by
  rows, which that reader wants
- ``npz``: a file a program, matrices sparse by columns: ``P_data``, ``P_indices``, ``P_indptr``, so for G and A too
- ``acados``: a folder a program, stage by stage, as acados' ``AcadosOcpQp.from_json`` reads it, with ``_meta`` and ``_ref_sol`` beside it

The first two state minimise 1/2 x'Px + q'x subject to G x <= h, A x = b, lb <= x <= ub, and beside them

- ``x``, ``y``, ``z``, ``z_box``: the solution with multipliers: P x + q + A'y + G'z + z_box = 0, z >= 0, z_box positive at an
  upper bound and negative at a lower one
- ``x_start``, ...: the warm start that the planner had, empty at a cold one

Where limits can be kept rows are hard there; where they cannot, every row has an elastic column. In stages every row has its slack.
``manifest.json`` names all programs in their order, with ``shift``, the stations that the horizon moved on since the program before, and
by how much the solution breaks its program's optimality conditions, which is 1e-10 at most of the largest multiplier; ``ended`` is why
a drive ended early, else null. ``layout`` has, for hard and elastic rows, the columns of every stage's states x_0..x_N, inputs
u_0..u_{N-1} and slacks sigma_1..sigma_N. The first rows of A give x_0, as many each then x_1..x_N; those of G belong to stages 1..N.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import scipy.sparse as sp

from hdvplan.arrays import FloatArray
from hdvplan.bench.measuring.courses import cases_of
from hdvplan.bench.measuring.recording import ACTIVE, Recorded, record
from hdvplan.bench.measuring.referee import scale_of
from hdvplan.bench.suite import AS_SET, Suite
from hdvplan.case import Case
from hdvplan.errors import OptionError
from hdvplan.fileio import json_bytes, write_atomically
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import residuals
from hdvplan.record import record_of
from hdvplan.solvers.registry import solver_named
from hdvplan.solvers.sparse import SparseQp

_MANIFEST = "manifest.json"
_TOLERANCES = (1e-11, 1e-12, 1e-13, 1e-14, 1e-15, 1e-10)  # of the solutions, tried in this order until one is good to the first of them
_REFINED = 8  # times a solution is solved for again


@dataclass(frozen=True)
class _Solved:
    """A recorded program with its name and its solution."""

    name: str
    recorded: Recorded
    solution: StageSolution


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


def export(cases: Sequence[Case], directory: Path, form: str = "qpbenchmark", most: int | None = None) -> list[dict[str, Any]]:
    """Record the programs of every case's drive, at most ``most`` each, and write them into ``directory``.

    ``form`` is one of ``FORMATS``. Returned are the sequences as the manifest has them.

    Raises:
        OptionError: no such format, pyarrow is not installed, which qpbenchmark's needs, or the directory holds another export.
        OSError: a file cannot be written.

    """
    if form not in FORMATS:
        msg = f"no format of QPs is called {form!r}"
        raise OptionError(msg, hint=f"formats: {', '.join(FORMATS)}")
    if (directory / _MANIFEST).exists():
        msg = f"{directory} holds an export already, and the programs of both would lie there"
        raise OptionError(msg, hint="choose another folder, or delete that one")
    directory.mkdir(parents=True, exist_ok=True)
    sequences: list[dict[str, Any]] = []
    for case in cases:
        name = f"{Path(case.road.name).name}.{case.vehicle.name}.{case.settings.scheme}"
        programs, early = record(case, most)
        found = [_Solved(f"{name}.{at:04d}", one, _exact(one.qp)) for at, one in enumerate(programs)]
        FORMATS[form](directory, name, found)
        road = {"road": case.road.name, "notice": case.road.notice}
        settings = {"horizon_m": case.settings.horizon, "step_m": case.settings.step, "scheme": str(case.settings.scheme)}
        entry = {"name": name} | road | {"vehicle": case.vehicle.name, "ended": early} | settings
        entry["layout"] = _layout(found[0].recorded.qp.shape) if found and form != "acados" else None
        sequences.append(entry | {"programs": [_listed(one, before) for before, one in zip([None, *found], found, strict=False)]})
    manifest = {"format": form, "sequences": sequences}
    write_atomically(directory / _MANIFEST, json_bytes(manifest))
    write_atomically(directory / "run.json", json_bytes(record_of(cases)))
    return sequences


def _layout(shape: StageShape) -> dict[str, dict[str, list[list[int]]]]:
    """Return the columns of every stage, of programs with hard and with elastic rows."""
    forms = {name: SparseQp.of(shape, elastic=name == "elastic") for name in ("hard", "elastic")}
    return {
        name: {"x": form.x_columns.tolist(), "u": form.u_columns.tolist(), "sigma": form.sigma_columns.tolist()}
        for name, form in forms.items()
    }


def _exact(qp: StageQp) -> StageSolution:
    """Return the best of some solutions: the interior point's, and what solving again from its active set and its slacks makes of it."""
    found: list[StageSolution] = []
    for tolerance in _TOLERANCES:
        exact = solver_named("riccati", tolerance)(qp.shape)
        found.append(exact.solve(qp, None).point.copy())
        for _ in range(_REFINED):
            if max(_broken(qp, found[-1]).values()) <= _TOLERANCES[0]:
                return found[-1]
            found.append(exact.solve(qp, found[-1]).point.copy())
    return min(found, key=lambda point: max(_broken(qp, point).values()))


def _broken(qp: StageQp, point: StageSolution) -> dict[str, float]:
    judged, scale = residuals(qp, point), scale_of(point)
    return {"primal": judged.primal, "dual_by_scale": judged.dual / scale, "gap_by_scale": judged.gap / scale}


def _listed(one: _Solved, before: _Solved | None) -> dict[str, object]:
    recorded = one.recorded
    shift = 0 if before is None else recorded.first - before.recorded.first
    entry = {"name": one.name, "first": recorded.first, "number": recorded.number, "shift": shift, "limits": recorded.limits}
    return (
        entry
        | {"warm_start": recorded.guess is not None, "largest_multiplier": scale_of(one.solution)}
        | _broken(recorded.qp, one.solution)
    )


def _qpbenchmark(directory: Path, name: str, programs: Sequence[_Solved]) -> None:
    arrow, parquet = _arrow()
    rows = [_dense(one) for one in programs]
    schema = arrow.Table.from_pylist(rows[:1]).schema if rows else arrow.schema([])
    with parquet.ParquetWriter(directory / f"{name}.parquet", schema, compression="zstd") as writer:
        for row in rows:  # a row group each: dense matrices of all at once would fill the memory
            writer.write_table(arrow.Table.from_pylist([row], schema=schema))


def _arrow() -> tuple[Any, Any]:
    try:
        return import_module("pyarrow"), import_module("pyarrow.parquet")
    except ImportError as error:
        msg = "writing Parquet files needs pyarrow, which is not installed"
        raise OptionError(msg, hint="pip install pyarrow, or choose --qp-format npz") from error


def _dense(one: _Solved) -> dict[str, object]:
    matrices, vectors = _problem(one)
    active = np.flatnonzero(vectors["z"] > ACTIVE)
    entry = {"name": one.name, "active": active, "limits": one.recorded.limits, "first": one.recorded.first, "number": one.recorded.number}
    return {name: matrix.toarray().ravel() for name, matrix in matrices.items()} | vectors | entry


def _npz(directory: Path, name: str, programs: Sequence[_Solved]) -> None:
    (directory / name).mkdir(exist_ok=True)
    for one in programs:
        matrices, vectors = _problem(one)
        parts = {f"{key}_{part}": getattr(matrix, part) for key, matrix in matrices.items() for part in ("data", "indices", "indptr")}
        buffer = BytesIO()
        np.savez_compressed(buffer, allow_pickle=False, **parts, **vectors)
        write_atomically(directory / name / f"{one.name}.npz", buffer.getvalue())


def _problem(one: _Solved) -> tuple[dict[str, sp.csc_matrix], dict[str, FloatArray]]:
    """Return a program's matrices and vectors, by the names of the module's docstring."""
    recorded = one.recorded
    form = SparseQp.of(recorded.qp.shape, elastic=recorded.limits == "unkeepable")
    form.load(recorded.qp)
    matrices = {"P": sp.csc_matrix(form.P + sp.triu(form.P, 1).T), "G": form.G, "A": form.E}
    vectors = {"q": form.q, "h": form.h, "b": form.b, "lb": form.low, "ub": form.high}
    parts = ("x", "y", "z", "z_box")
    started = [np.empty(0)] * len(parts) if recorded.guess is None else _flat(form, recorded.qp, recorded.guess)
    solution = zip(parts, _flat(form, recorded.qp, one.solution), strict=True)
    return matrices, vectors | dict(solution) | {f"{part}_start": values for part, values in zip(parts, started, strict=True)}


def _flat(form: SparseQp, qp: StageQp, point: StageSolution) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    v, equality, rows, bounds = form.flatten(point)
    if form.elastic:
        bounds[form.sigma_columns] = -np.maximum(_of_slacks(qp, point), 0.0)
    return v, equality, rows, bounds


def _of_slacks(qp: StageQp, point: StageSolution) -> FloatArray:
    """Return the multipliers of sigma >= 0, which follow from those of the rows, (N, p)."""
    return qp.linear + qp.quadratic * point.sigma - point.rows


def _acados(directory: Path, name: str, programs: Sequence[_Solved]) -> None:
    for one in programs:
        folder = directory / name / one.name
        folder.mkdir(parents=True, exist_ok=True)
        shape = one.recorded.qp.shape
        rows = bool(shape.rows)
        meta = {"name": one.name, "N": shape.stages, "has_slacks": rows, "has_masks": rows, "has_idxs_rev_not_idxs": rows}
        files = {"": _stages(one.recorded.qp), "_meta": meta, "_ref_sol": _iterate(one.recorded.qp, one.solution)}
        for ending, content in files.items():
            write_atomically(folder / f"{one.name}{ending}.json", json_bytes(content))


def _stages(qp: StageQp) -> dict[str, object]:
    shape = qp.shape
    n, m, p, last = shape.states, shape.inputs, shape.rows, shape.stages
    digits = len(str(last + 2))
    fields: dict[str, object] = {}
    for i in range(last + 1):
        inputs = m if i < last else 0
        states = list(range(n)) if i == 0 else list(shape.bounded_states)
        soft, rows = (0, None) if i == 0 else (p, i - 1)
        lower, upper = (qp.x_first, qp.x_first) if i == 0 else (qp.x_low[i - 1], qp.x_high[i - 1])
        stage: dict[str, object] = {
            "Q": qp.Q[i],
            "q": qp.q[i],
            "R": np.zeros((0, 0)),
            "r": [],
            "S": np.zeros((inputs, n)),
            "lbu": [],
            "ubu": [],
        }
        if i < last:
            stage |= {"A": qp.A[i], "B": qp.B[i], "b": qp.c[i], "R": qp.R[i], "r": qp.r[i], "lbu": qp.u_low[i], "ubu": qp.u_high[i]}
        stage |= {"idxb": [*range(inputs), *(inputs + state for state in states)], "lbx": lower, "ubx": upper}
        stage |= {"idxe": [inputs + state for state in states] if i == 0 else []}
        C = np.zeros((0, n)) if rows is None else qp.G[rows]
        stage |= {"C": C, "D": np.zeros((soft, inputs)), "lg": np.zeros(soft), "ug": np.zeros(0) if rows is None else qp.h[rows]}
        stage |= {"idxs_rev": [-1] * (inputs + len(states)) + list(range(soft)), "lls": np.zeros(soft), "lus": np.zeros(soft)}
        stage |= {"zl": np.zeros(soft), "Zl": np.ones(soft)}
        stage |= {"zu": np.zeros(0) if rows is None else qp.linear[rows], "Zu": np.zeros(0) if rows is None else qp.quadratic[rows]}
        masks = {"lbu": inputs, "ubu": inputs, "lbx": len(states), "ubx": len(states), "ug": soft, "lus": soft}
        stage |= {f"{field}_mask": np.ones(count) for field, count in masks.items()}
        stage |= {"lg_mask": np.zeros(soft), "lls_mask": np.zeros(soft)}  # rows have an upper side alone
        fields |= {f"{field}_{i:0{digits}d}": np.asarray(value).tolist() for field, value in stage.items()}
    return fields


def _iterate(qp: StageQp, point: StageSolution) -> dict[str, list[list[float]]]:
    """Return a solution as acados' iterates have it: by stage, multipliers of lower sides before those of upper ones, then of slacks."""
    stages, none, of_slacks = qp.shape.stages, np.zeros(0), _of_slacks(qp, point)
    found: dict[str, list[list[float]]] = {name: [] for name in ("x_traj", "u_traj", "z_traj", "sl_traj", "su_traj", "pi_traj", "lam_traj")}
    for i in range(stages + 1):
        inputs = point.u_bounds[i] if i < stages else none
        states = point.dynamics[0] if i == 0 else point.x_bounds[i - 1]
        sigma, rows = (none, none) if i == 0 else (point.sigma[i - 1], point.rows[i - 1])
        of_sigma = none if i == 0 else of_slacks[i - 1]
        bounds, zeros = np.concatenate([inputs, states]), np.zeros(len(rows))
        lam = np.concatenate([np.maximum(-bounds, 0.0), zeros, np.maximum(bounds, 0.0), rows, zeros, of_sigma])
        own = {"x_traj": point.x[i], "u_traj": point.u[i] if i < stages else none, "z_traj": none, "sl_traj": zeros, "su_traj": sigma}
        own |= {"lam_traj": lam} | ({"pi_traj": -point.dynamics[i + 1]} if i < stages else {})
        for name, values in own.items():
            found[name].append(values.tolist())
    return found


FORMATS: Mapping[str, Callable[[Path, str, Sequence[_Solved]], None]] = {"qpbenchmark": _qpbenchmark, "npz": _npz, "acados": _acados}
