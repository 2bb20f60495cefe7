"""acados: its layer of QPs (``ocp_qp``: partial condensing and HPIPM), by the C interface of the wheel ``comma-deps-acados``.

One step of acados' SQP_RTI linearises every stage and then solves one program by this layer. Here the linearisation is ours, so that a
planning step is acados' step without what its own layer of nonlinear programs adds. The program is handed over as to ``hpipm``: acados'
structures of programs and solutions are HPIPM's.
"""

from __future__ import annotations

import ctypes
import weakref
from ctypes import byref, c_char_p, c_double, c_int, c_void_p
from functools import cache
from pathlib import Path

from hdvplan.errors import SolverError
from hdvplan.qp.program import StageShape
from hdvplan.qp.workspace import Status
from hdvplan.solvers.hpipm import HpipmWorkspace, Memory, dimensions_of, load_hpipm, pointer

TOLERANCE = 1e-6  # absolute, of all four residuals, as hpipm's
_PARTIAL_CONDENSING_HPIPM = 0  # as ocp_qp_solver_t counts
_START = 1e4  # complementarity at the start, as hpipm's: rows cost 1e4 a metre
_SETTINGS = (("SPEED", 8, 30), ("BALANCE", 4, 100))  # mode, stages a block, iterations
_STATUS = (Status.SOLVED, Status.NUMERICAL, Status.ITERATION_LIMIT, Status.NUMERICAL, Status.FAILED)  # as return_values counts
_MAKERS = (
    "ocp_qp_xcond_solver_config_create", "ocp_qp_dims_create", "ocp_qp_xcond_solver_dims_create_from_ocp_qp_dims", "ocp_qp_in_create",
    "ocp_qp_out_create", "ocp_qp_xcond_solver_opts_create", "ocp_qp_create",
)  # fmt: skip


class _Plan(ctypes.Structure):
    _fields_ = (("qp_solver", c_int),)


class _QpInfo(ctypes.Structure):
    """``qp_info``: times [s] that nobody reads here, iterations, and whether slacks of inequalities were computed."""

    _fields_ = (*((name, c_double) for name in ("solve", "condensing", "interface", "total")), ("iterations", c_int), ("slacks", c_int))


class AcadosWorkspace(HpipmWorkspace):
    """acados' partial condensing and HPIPM, in its fast mode, then in its balanced one, cold in every solve."""

    name = "acados"
    settings = (
        "ocp_qp, PARTIAL_CONDENSING_HPIPM, "
        + ", else ".join(f"{mode} by {block} stages" for mode, block, _ in _SETTINGS)
        + f"; mu0 {_START:g}, soft rows of its own, cold; BLASFEO of comma-deps-acados for AVX2"
    )

    def __init__(self, shape: StageShape, *, tolerance: float = TOLERANCE) -> None:
        """Allocate the memory of acados.

        Raises:
            SolverError: the wheel is not there.

        """
        self._acados = _library()
        super().__init__(shape, tolerance=tolerance)

    def _allocated(self, tolerance: float) -> list[Memory]:
        return [self._made_by_acados(mode, max(1, self._shape.stages // block), most, tolerance) for mode, block, most in _SETTINGS]

    def _made_by_acados(self, mode: str, blocks: int, most: int, tolerance: float) -> Memory:
        acados = self._acados
        dimensions = c_void_p(acados.ocp_qp_dims_create(self._shape.stages))
        sizes = dimensions_of(self._shape, self._library)
        self._library.d_ocp_qp_dim_set_all(*map(pointer, sizes), dimensions)
        config = c_void_p(acados.ocp_qp_xcond_solver_config_create(_Plan(_PARTIAL_CONDENSING_HPIPM)))
        condensed = c_void_p(acados.ocp_qp_xcond_solver_dims_create_from_ocp_qp_dims(config, dimensions))
        options = c_void_p(acados.ocp_qp_xcond_solver_opts_create(config, condensed))
        numbers: dict[str, c_int | c_double] = {f"tol_{residual}": c_double(tolerance) for residual in ("stat", "eq", "ineq", "comp")}
        numbers |= {"iter_max": c_int(most), "cond_N": c_int(blocks), "warm_start": c_int(0), "mu0": c_double(_START)}
        acados.ocp_qp_xcond_solver_opts_set(config, options, b"hpipm_mode", c_char_p(mode.encode()))
        for field, value in numbers.items():  # after the mode, which sets all of them
            acados.ocp_qp_xcond_solver_opts_set(config, options, field.encode(), byref(value))
        solver = c_void_p(acados.ocp_qp_create(config, condensed, options))
        program, solution = c_void_p(acados.ocp_qp_in_create(dimensions)), c_void_p(acados.ocp_qp_out_create(dimensions))
        weakref.finalize(self, _free, acados, solver, program, solution)
        return Memory(qp=program, solution=solution, workspace=solver)

    def _attempt(self, memory: Memory) -> tuple[Status, int]:
        self._library.d_ocp_qp_set_all_rowmaj(*self._from, memory.qp)
        status = self._acados.ocp_qp_solve(memory.workspace, memory.qp, memory.solution)
        self._library.d_ocp_qp_sol_get_all(memory.solution, *self._into)
        self._publish()
        info = c_void_p()
        self._acados.ocp_qp_out_get(memory.solution, b"qp_info", byref(info))
        iterations = int(_QpInfo.from_address(info.value).iterations) if info.value else 0
        return _STATUS[status] if 0 <= status < len(_STATUS) else Status.FAILED, iterations


def _free(acados: ctypes.CDLL, solver: c_void_p, program: c_void_p, solution: c_void_p) -> None:
    acados.ocp_qp_solver_destroy(solver)
    acados.ocp_qp_in_free(program)
    acados.ocp_qp_out_free(solution)


@cache
def _library() -> ctypes.CDLL:
    """Load acados beside its HPIPM."""
    folder = Path(load_hpipm()._name).parent  # noqa: SLF001 - where ctypes keeps the path
    if not (folder / "libacados.so").is_file():
        msg = f"no libacados.so beside HPIPM in {folder}"
        raise SolverError(msg, hint="pip install comma-deps-acados, in an environment without CasADi")
    ctypes.CDLL(str(folder / "libqpOASES_e.so"))  # which the other then finds
    library = ctypes.CDLL(str(folder / "libacados.so"))
    for maker in _MAKERS:
        getattr(library, maker).restype = c_void_p
    return library
