"""The bus's plans by acados' export and by hdvplan's, from the same states and in the same run: difference, time, and sizes.

Centring the lead axle, without limits but the steering's: that cost is acados' own linear least squares. acados gets hdvplan's stations,
its discrete dynamics and its rule, and makes one real-time iteration a step, as hdvplan does. Writes acados.csv, acados.md and run.json.
Needs a C compiler and make, the extra ``peers``, and ``pip install --no-deps comma-deps-acados``.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import os
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import acados
import casadi as ca
import numpy as np
import pandas as pd
from cases import options_of, words, write_results
from exact_nlp import advance
from export_c import OPTIMISED, code_bytes
from exported_planner import ExportedPlanner

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Ready
from hdvplan.export import Budget
from hdvplan.export.write import begun
from hdvplan.machine import use_one_thread
from hdvplan.planning.stations import Stations
from hdvplan.planning.terms.centring import Centring
from hdvplan.report.grid import markdown_table
from hdvplan.road.load import find_road
from hdvplan.stepping import Stepper
from hdvplan.vehicle.load import load_vehicle

os.environ |= {"ACADOS_SOURCE_DIR": acados.DIR, "ACADOS_PYTHON_INTERFACE_PATH": acados.TEMPLATE_DIR, "TERA_PATH": acados.TERA_PATH}
from acados.acados_template import AcadosModel, AcadosOcp, AcadosOcpSolver

BLOCKS = (200, 50, 20, 10)  # stages that are left after partial condensing; the fastest counts
LIBRARIES = ("libblasfeo.so", "libhpipm.so", "libqpOASES_e.so.3.1", "libacados.so")  # each needs those before it
ROUNDS = 5
_COLD = 10  # real-time iterations for the first plan


def program(case: Case, start: Ready, blocks: int) -> AcadosOcp:
    """Return a case's program: states and the curvature held before, parameters the road's curvature here and half a step on."""
    vehicle, settings, stages = case.vehicle, case.settings, case.settings.stages
    z, held, kappa, road = ca.SX.sym("z", vehicle.states), ca.SX.sym("held"), ca.SX.sym("kappa"), ca.SX.sym("road", 2)
    model, ocp = AcadosModel(), AcadosOcp()
    model.name, model.x, model.u, model.p = "bus", ca.vertcat(z, held), kappa, road
    model.disc_dyn_expr = ca.vertcat(advance(vehicle, settings.step)(z, kappa, road[0], road[1]), kappa)
    ocp.model, ocp.parameter_values, ocp.dims.N = model, np.zeros(2), stages
    axle, change = np.eye(1, vehicle.states + 1), np.append(np.zeros(vehicle.states), -1.0)[None]
    ocp.cost.cost_type = ocp.cost.cost_type_e = "LINEAR_LS"
    ocp.cost.W, ocp.cost.W_e = np.diag([1.0, settings.smoothness]), np.eye(1)
    ocp.cost.Vx, ocp.cost.Vu, ocp.cost.Vx_e = np.vstack([axle, change]), np.array([[0.0], [1.0]]), axle
    ocp.cost.yref, ocp.cost.yref_e = np.zeros(2), np.zeros(1)
    ocp.constraints.x0 = np.append(start.begin.z, start.begin.kappa)
    ocp.constraints.idxbu = np.array([0])
    ocp.constraints.ubu = np.array([vehicle.max_curvature])
    ocp.constraints.lbu = -ocp.constraints.ubu
    ocp.constraints.C, ocp.constraints.D = change, np.array([[1.0]])
    ocp.constraints.ug = np.array([vehicle.max_curvature_rate * settings.step])
    ocp.constraints.lg = -ocp.constraints.ug
    options = ocp.solver_options
    options.nlp_solver_type, options.hessian_approx, options.integrator_type = "SQP_RTI", "GAUSS_NEWTON", "DISCRETE"
    options.qp_solver, options.hpipm_mode, options.qp_solver_cond_N = "PARTIAL_CONDENSING_HPIPM", "SPEED", blocks
    options.tf, options.qp_solver_warm_start = float(stages), 1
    ocp.acados_include_path, ocp.acados_lib_path = acados.INCLUDE_DIR, acados.LIB_DIR
    return ocp


@dataclass(frozen=True)
class Peer:
    """acados' solver of a case as it was exported, and what it holds."""

    solver: AcadosOcpSolver
    code_bytes: int  # of what acados wrote, compiled; not of its libraries
    memory_bytes: int  # that it allocated


def exported_by_acados(case: Case, start: Ready, blocks: int, folder: Path) -> Peer:
    """Return acados' solver, written, compiled and loaded from a folder."""
    ocp = program(case, start, blocks)
    ocp.code_export_directory = str(folder / "code")
    with contextlib.redirect_stdout(io.StringIO()):
        AcadosOcpSolver.generate(ocp, json_file=str(folder / "ocp.json"))
        AcadosOcpSolver.build(ocp.code_export_directory, with_cython=False, verbose=False)
        before = _allocated()
        solver = AcadosOcpSolver(ocp, json_file=str(folder / "ocp.json"), generate=False, build=False)
    library = next((folder / "code").glob("libacados_ocp_solver*.so"))
    return Peer(solver, code_bytes([library]), _allocated() - before)


class _Allocator(ctypes.Structure):
    """What glibc tells of its allocator: in use are uordblks in the arenas, and hblkhd that are mapped [bytes]."""

    _fields_ = [
        (name, ctypes.c_size_t)
        for name in ("arena", "ordblks", "smblks", "hblks", "hblkhd", "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost")
    ]


def _allocated() -> int:
    """Return the bytes that this process has from its allocator."""
    mallinfo = ctypes.CDLL(None).mallinfo2
    mallinfo.restype = _Allocator
    info = mallinfo()
    return int(info.uordblks + info.hblkhd)


def driven_beside(case: Case, folder: Path, blocks: int) -> dict[str, object]:
    """Return how acados' plans compare with the exported planner's along hdvplan's drive; every plan counts with its fastest round."""
    start = begun(case)
    own, peer = ExportedPlanner(case, folder, flags=OPTIMISED), exported_by_acados(case, start, blocks, folder)
    rounds = np.array([list(_drive(case, start, own, peer.solver)) for _ in range(ROUNDS)])[:, 1:]  # (round, plan, 3), without the first
    apart, theirs, ours = np.moveaxis(np.min(rounds, axis=0), -1, 0)
    return {
        "road": case.road.name, "blocks": blocks, "plans": len(theirs), "difference": float(np.max(apart)),
        "median_difference": float(np.median(apart)), "acados_us": 1e6 * float(np.mean(theirs)), "hdvplan_us": 1e6 * float(np.mean(ours)),
        "ratio": float(np.mean(theirs) / np.mean(ours)), "acados_memory_bytes": peer.memory_bytes, "hdvplan_memory_bytes": own.memory,
        "acados_code_bytes": peer.code_bytes,
    }  # fmt: skip


def _drive(case: Case, start: Ready, own: ExportedPlanner, solver: AcadosOcpSolver) -> Iterator[tuple[float, float, float]]:
    """Yield of every plan how far the two lie apart, and what acados and hdvplan took [s]."""
    (term,) = (part for part in start.goal.terms if isinstance(part, Centring))
    stations, stepper, stages = start.stations, Stepper(case), case.settings.stages
    guess = np.column_stack([stations.centring.e_y, stations.centring.e_psi, stations.centring.kappa])  # by station; later the plans
    own.begin(Budget())
    while not stepper.done:
        at = stepper.at
        _given(solver, term, stations, at, np.append(stepper.z, stepper.kappa), guess[at : at + stages + 1])
        for _ in range(1 if at else _COLD):
            if status := solver.solve():
                msg = f"acados ended with {status} at station {at}"
                raise RuntimeError(msg)
        x = np.stack([solver.get(i, "x") for i in range(stages + 1)])
        u = np.concatenate([solver.get(i, "u") for i in range(stages)])
        guess[at : at + stages + 1] = x
        began = perf_counter()
        motion = own.step(at, stepper.z, stepper.kappa)
        took = perf_counter() - began
        apart = max(float(np.max(np.abs(motion[:, :-1] - x[:, :-1]))), float(np.max(np.abs(motion[:-1, -1] - u))))
        yield apart, float(solver.get_stats("time_tot")[0]), took
        plan = stepper.plan()
        stepper.arrive(stepper.simulate(plan)[-1], float(plan.kappa[stepper.count - 1]))


def _given(solver: AcadosOcpSolver, term: Centring, stations: Stations, at: int, begin: FloatArray, guess: FloatArray) -> None:
    """Hand a step's data to acados: road, targets, the state to start from, and the motion to linearise at."""
    stages, points, target = len(guess) - 1, stations.points, term.residual.target
    for i in range(stages + 1):
        here = points[at + i]
        solver.set(i, "p", np.array([here["curvature"], here["curvature_between"]]))
        solver.cost_set(i, "yref", np.array([target[at + i], 0.0])[: 2 if i < stages else 1])
        solver.set(i, "x", guess[i])
        if i < stages:
            solver.set(i, "u", guess[i + 1, -1:])  # what is held there after it
    solver.constraints_set(0, "lbx", begin)
    solver.constraints_set(0, "ubx", begin)


def text(rows: pd.DataFrame) -> str:
    """Return the page."""
    libraries = code_bytes([Path(acados.LIB_DIR, name) for name in LIBRARIES])
    shown = rows.drop(columns=["acados_code_bytes", "acados_memory_bytes", "hdvplan_memory_bytes"])
    for name in ("difference", "median_difference"):
        shown[name] = shown[name].map("{:.1e}".format)
    for name in ("acados_us", "hdvplan_us", "ratio"):
        shown[name] = shown[name].map("{:.1f}".format)
    first = rows.iloc[0]
    return (
        "A bus, horizon 100 m, step 0.5 m, the lead axle centred, no limits but the steering's: every plan by both from the same state, in "
        "turns. acados: SQP_RTI, discrete dynamics, partial condensing to ``blocks`` stages, HPIPM in its fast mode; the time is its own "
        "count of preparation and feedback, without handing over the road and shifting the guess. hdvplan: ``hdvplan_step``, which does "
        "both, timed around the call from Python. "
        f"Every plan but the first, with the fastest of {ROUNDS} rounds. Plans differ where the stages that are new to the horizon are "
        "guessed in another way.\n\n"
        f"{markdown_table(shown, text=('road', 'difference', 'median_difference'))}\n\n"
        f"acados wrote {first['acados_code_bytes'] / 1e3:.0f} kB of code, which is linked to {libraries / 1e6:.1f} MB of libraries, and "
        f"allocated {first['acados_memory_bytes'] / 1e3:.0f} kB; hdvplan's memory is {first['hdvplan_memory_bytes'] / 1e3:.0f} kB, "
        "allocated by the host.\n"
    )


def main() -> None:
    """Compare and write."""
    parser = options_of(__doc__, "acados-export")
    parser.add_argument("--roads", default="uturn,monaco_fairmont_hairpin,neubrandenburg_ring", type=words, metavar="A,B")
    given = parser.parse_args()
    roads = [replace(find_road(name)(), limits=None) for name in given.roads]
    cases = [Case(road, load_vehicle("bus"), objective="lead-axle") for road in roads]
    rows = []
    for case in cases:
        for blocks in BLOCKS:
            with tempfile.TemporaryDirectory() as folder:
                rows.append(driven_beside(case, Path(folder), blocks))
    table = pd.DataFrame(rows)
    write_results(given.out, {"acados": table}, {"acados": text(table)}, cases, form=None)
    print(text(table))


if __name__ == "__main__":
    use_one_thread()
    for one in LIBRARIES:
        ctypes.CDLL(str(Path(acados.LIB_DIR, one)), ctypes.RTLD_GLOBAL)  # the export's own search finds no wheel
    main()
