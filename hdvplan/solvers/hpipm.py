"""HPIPM: the interior-point method for optimal control of acados, by its C interface in a wheel; native workspace.

The wheel ``comma-deps-acados`` brings it with a BLASFEO for AVX2 processors; else CasADi's is taken, whose BLASFEO is for any processor.

A program is copied into memory of the workspace, which HPIPM reads in one call through pointers that are made once. The given first
state is eliminated. Rows are HPIPM's own soft constraints, behind the bounds of u and x; their lower sides, which we do not have, are
masked. HPIPM condenses blocks of stages before it solves, and expands the solution. Its fastest mode is tried first; where residuals,
recomputed, do not prove its point, its careful mode solves the program again, and both times count.
"""

from __future__ import annotations

import ctypes
import platform
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from hdvplan.arrays import FloatArray
from hdvplan.errors import SolverError
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import QpResult, Status, largest_multiplier, residuals

TOLERANCE = 1e-6  # absolute, of all four residuals; at 1e-8 the balanced mode does not end where limits cannot be kept
_STATUS = (Status.SOLVED, Status.ITERATION_LIMIT, Status.NUMERICAL, Status.NUMERICAL, Status.INFEASIBLE)  # as hpipm_status counts
_START = 1e4  # complementarity at the start: rows cost 1e4 a metre; at 1e2 it takes twice as many iterations where they bind
_CLASSICAL = 0  # recursion of the condensing; the default takes the root of Q, and gives wrong points where Q is singular
_PROVED = 10.0  # times the tolerance: residuals up to which the fast mode's point is taken; metres, and shares of the largest multiplier


class _Setting(NamedTuple):
    mode: str
    number: int  # as hpipm_mode counts
    block: int  # stages condensed into one
    power: int  # of the tolerance
    most: int  # iterations


_LEAST = 1e-12  # tolerance: rounding leaves no more
_ROOM = 1024  # bytes of a structure of which HPIPM does not tell the size; they hold a few pointers
_ALIGNED = 64  # bytes, for vector instructions
_CONDENSING = ("d_part_cond_qp_arg", "d_part_cond_qp_ws")
_FILES = {"Darwin": "libhpipm.dylib", "Windows": "hpipm.dll"}
_WHEELS = (("acados", "install/lib"), ("casadi", ""))  # modules, and where their libraries are; both would not fit into one environment
# Fastest of SPEED_ABS, SPEED and BALANCE by 1, 2, 4, 8 and 16 stages on 192 programs of all classes of limits, cold; SPEED_ABS looks at
# products alone, so that it needs the tolerance squared. BALANCE solves most of what the fast modes do not: limits that cannot be kept.
_SETTINGS = (_Setting("SPEED_ABS", 0, 8, 2, 20), _Setting("BALANCE", 2, 4, 1, 100))

IntC = NDArray[np.int32]
Addresses = NDArray[np.uintp]  # one pointer a stage
Structure: TypeAlias = "ctypes.Array[ctypes.c_char] | ctypes.c_void_p"


class Memory(NamedTuple):
    """HPIPM's structures: a program and its solution, both once more in blocks of stages, and what condenses and solves them."""

    qp: Structure
    solution: Structure
    workspace: Structure
    condensing: Structure | None = None  # None, as all that follow: acados keeps them
    condenser: Structure | None = None
    blocks: Structure | None = None
    blocks_solution: Structure | None = None
    arguments: Structure | None = None


class HpipmWorkspace:
    """HPIPM in its fast mode, then in its balanced one, with partial condensing, cold in every solve."""

    name = "hpipm"
    starts_warm = False
    settings = (
        ", else ".join(f"{one.mode} by {one.block} stages{' at its square' * (one.power > 1)}" for one in _SETTINGS)
        + f"; mu0 {_START:g}, soft rows of its own, cold; "
        + ("BLASFEO of comma-deps-acados for AVX2" if find_spec("acados") else "BLASFEO of CasADi, for any processor")
    )

    def __init__(self, shape: StageShape, *, tolerance: float = TOLERANCE) -> None:
        """Allocate HPIPM's memory and lay out what it does not read from the program.

        Raises:
            SolverError: CasADi has brought no HPIPM.

        """
        self._shape, self._library, self._close = shape, load_hpipm(), _PROVED * tolerance
        self._point = StageSolution.empty(shape)
        self._kept: list[object] = []
        self._memories = self._allocated(tolerance)
        stages, n, m, p, b = shape.stages, shape.states, shape.inputs, shape.rows, len(shape.bounded_states)
        count = stages + 1
        self._program = StageQp.empty(shape)
        self._first, self._G = np.zeros(n), np.zeros((count, p, n))
        self._h, self._linear, self._quadratic = (np.zeros((count, p)) for _ in range(3))
        self._x, self._u, self._pi = np.zeros((count, n)), np.zeros((count, m)), np.zeros((count, n))
        self._sigma, self._upper = np.zeros((count, p)), np.zeros((count, p))
        self._low, self._high = np.zeros((count, m + b)), np.zeros((count, m + b))
        self._none, self._unused = np.zeros((max(n, p), max(n, m))), np.zeros(max(m + b, p, n))  # S, D and lower rows; where nobody reads
        self._one = np.ones(p)
        self._bounded, self._inputs = np.array(shape.bounded_states, np.int32), np.arange(m, dtype=np.int32)
        softened, softening = np.arange(p, dtype=np.int32) + m + b, np.array([-1] * (m + b) + list(range(p)), np.int32)
        self._softened = [softened] * stages + [softened - m]  # rows alone; the last stage has no bounds of u before them
        self._softening = [softening] * stages + [softening[m:]]  # the same the other way round: HPIPM takes either
        self._into = tuple(map(self._pointer_to, self._places_of_solution()))
        self._from = tuple(map(self._pointer_to, self._places_of_program()))
        for memory in self._memories:
            self._mask(memory.qp)

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - a guess helps no interior point here
        """Solve ``qp``; see ``QpWorkspace``."""
        started = perf_counter()
        qp.check()
        self._program.buffer[:] = qp.buffer
        self._gather()
        updated, iterations, status = perf_counter(), 0, Status.FAILED
        for memory in self._memories:
            status, took = self._attempt(memory)
            iterations += took
            if memory is self._memories[-1] or (status is Status.SOLVED and self._proved(qp)):
                break
        return QpResult(status, self._point, iterations, updated - started, perf_counter() - updated)

    def _attempt(self, memory: Memory) -> tuple[Status, int]:
        library = self._library
        library.d_ocp_qp_set_all_rowmaj(*self._from, memory.qp)
        library.d_part_cond_qp_cond(memory.qp, memory.blocks, memory.condensing, memory.condenser)
        library.d_ocp_qp_ipm_solve(memory.blocks, memory.blocks_solution, memory.arguments, memory.workspace)
        expanded = (memory.qp, *([memory.blocks] if _is_old(library) else []), memory.blocks_solution, memory.solution)
        library.d_part_cond_qp_expand_sol(*expanded, memory.condensing, memory.condenser)
        library.d_ocp_qp_sol_get_all(memory.solution, *self._into)
        self._publish()
        status, iterations = ctypes.c_int(), ctypes.c_int()
        library.d_ocp_qp_ipm_get_status(memory.workspace, ctypes.byref(status))
        library.d_ocp_qp_ipm_get_iter(memory.workspace, ctypes.byref(iterations))
        return _STATUS[status.value] if 0 <= status.value < len(_STATUS) else Status.FAILED, iterations.value

    def _proved(self, qp: StageQp) -> bool:
        judged, scale = residuals(qp, self._point), max(1.0, largest_multiplier(self._point))
        return judged.primal <= self._close and max(judged.dual, judged.gap) <= self._close * scale

    def _allocated(self, tolerance: float) -> list[Memory]:
        return [self._allocate(setting, tolerance) for setting in _SETTINGS]

    def _allocate(self, setting: _Setting, tolerance: float) -> Memory:
        library, shape = self._library, self._shape
        stages, sizes = shape.stages, dimensions_of(shape, library)
        dimensions = self._made("d_ocp_qp_dim", stages)
        library.d_ocp_qp_dim_set_all(*map(pointer, sizes), dimensions)
        count = max(1, stages // setting.block)
        lengths, shorter = np.zeros(count + 1, np.int32), self._made("d_ocp_qp_dim", count)
        library.d_part_cond_qp_compute_block_size(stages, count, pointer(lengths))
        library.d_part_cond_qp_compute_dim(dimensions, pointer(lengths), shorter)
        condensing = self._made("d_part_cond_qp_arg", count)
        library.d_part_cond_qp_arg_set_default(condensing)
        library.d_part_cond_qp_arg_set_ric_alg(_CLASSICAL, condensing)
        arguments = self._made("d_ocp_qp_ipm_arg", shorter)
        library.d_ocp_qp_ipm_arg_set_default(setting.number, arguments)
        library.d_ocp_qp_ipm_arg_set_comp_dual_sol_eq(
            ctypes.byref(ctypes.c_int(1)), arguments
        )  # of the dynamics: SPEED_ABS leaves them out
        library.d_ocp_qp_ipm_arg_set_iter_max(ctypes.byref(ctypes.c_int(setting.most)), arguments)
        library.d_ocp_qp_ipm_arg_set_mu0(ctypes.byref(ctypes.c_double(_START)), arguments)
        for residual in ("stat", "eq", "ineq", "comp"):
            getattr(library, f"d_ocp_qp_ipm_arg_set_tol_{residual}")(
                ctypes.byref(ctypes.c_double(max(tolerance**setting.power, _LEAST))), arguments
            )
        return Memory(
            self._made("d_ocp_qp", dimensions), self._made("d_ocp_qp_sol", dimensions), self._made("d_ocp_qp_ipm_ws", shorter, arguments),
            condensing, self._made("d_part_cond_qp_ws", dimensions, self._pointer_to(lengths), shorter, condensing),
            self._made("d_ocp_qp", shorter), self._made("d_ocp_qp_sol", shorter), arguments,
        )  # fmt: skip

    def _made(self, kind: str, *given: object) -> Structure:
        library = self._library
        structure = ctypes.create_string_buffer(_ROOM if kind in _CONDENSING else getattr(library, f"{kind}_strsize")())
        memory = ctypes.create_string_buffer(getattr(library, f"{kind}_memsize")(*given) + _ALIGNED)
        begin = ctypes.addressof(memory)
        getattr(library, f"{kind}_create")(*given, structure, ctypes.c_void_p(begin + -begin % _ALIGNED))
        self._kept += [structure, memory]
        return structure

    def _pointer_to(self, array: IntC | Addresses) -> ctypes.c_void_p:
        """Return a pointer to an array that stays as long as the workspace."""
        self._kept.append(array)
        return pointer(array)

    def _places_of_program(self) -> list[Addresses]:
        """Return where HPIPM finds every argument of its ``set_all``, stage by stage."""
        s, everywhere = self._program.stages, len(self._program.stages)
        b = _addresses(s["c"])
        b[0] = self._first.ctypes.data
        nothing = [self._none] * everywhere
        softening = [] if _is_old(self._library) else [_addresses(self._softening)]
        return [
            _addresses(s["A"]), _addresses(s["B"]), b, _addresses(s["Q"]), _addresses(nothing), _addresses(s["R"]),
            _addresses(s["q"]), _addresses(s["r"]),
            _addresses([self._bounded] * everywhere), _addresses(s["x_low"]), _addresses(s["x_high"]),
            _addresses([self._inputs] * everywhere), _addresses(s["u_low"]), _addresses(s["u_high"]),
            _addresses(self._G), _addresses(nothing), _addresses(nothing), _addresses(self._h),
            _addresses([self._one] * everywhere), _addresses(self._quadratic), _addresses(nothing), _addresses(self._linear),
            _addresses(self._softened), *softening, _addresses(nothing), _addresses(nothing),
        ]  # fmt: skip

    def _places_of_solution(self) -> list[Addresses]:
        """Return where HPIPM writes u, x, slacks, multipliers of dynamics, bounds, rows and slacks."""
        unused = _addresses([self._unused] * len(self._x))
        low, high = _addresses(self._low), _addresses(self._high)
        low[-1], high[-1] = self._low[-1, self._shape.inputs :].ctypes.data, self._high[-1, self._shape.inputs :].ctypes.data
        return [
            _addresses(self._u), _addresses(self._x), unused, _addresses(self._sigma), _addresses(self._pi), low, high, unused,
            _addresses(self._upper), unused, unused,
        ]  # fmt: skip

    def _mask(self, program: Structure) -> None:
        """Take the rows' lower sides and their slacks out of the program."""
        zeros = np.zeros(max(self._shape.rows, 1))
        for stage in range(1, self._shape.stages + 1):
            for field in (b"lg_mask", b"lls_mask"):
                self._library.d_ocp_qp_set(field, stage, pointer(zeros), program)

    def _gather(self) -> None:
        """Lay the program's rows out as HPIPM reads them; the first state moves into the first interval's c."""
        own, stage = self._program, self._program.stages[0]
        for name, to in (("g", self._G), ("h", self._h), ("linear", self._linear), ("quadratic", self._quadratic)):
            to[:] = own.rows[name]
        self._first[:] = stage["A"] @ own.x_first + stage["c"]

    def _publish(self) -> None:
        """Bring HPIPM's solution into our order and signs."""
        own, point, m = self._program, self._point, self._shape.inputs
        stage, bounds = own.stages[0], self._high - self._low
        point.x[0], point.x[1:] = own.x_first, self._x[1:]
        point.dynamics[1:] = -self._pi[:-1]
        point.dynamics[0] = stage["A"].T @ point.dynamics[1] - stage["Q"] @ own.x_first - stage["q"]
        point.u[:], point.u_bounds[:], point.x_bounds[:] = self._u[:-1], bounds[:-1, :m], bounds[1:, m:]
        point.sigma[:], point.rows[:] = self._sigma[1:], self._upper[1:]


def dimensions_of(shape: StageShape, library: ctypes.CDLL) -> list[IntC]:
    """Return HPIPM's dimensions of programs without their first state, an array a kind with an entry a stage."""
    stages, p, b = shape.stages, shape.rows, len(shape.bounded_states)
    kinds = [
        [0] + [shape.states] * stages, [shape.inputs] * stages + [0], [0] + [b] * stages, [shape.inputs] * stages + [0],
        [0] + [p] * stages, *([[0] * (stages + 1)] * 2 if _is_old(library) else []), [0] + [p] * stages,
    ]  # fmt: skip
    return [np.array(values, np.int32) for values in kinds]


def pointer(array: FloatArray | IntC | Addresses) -> ctypes.c_void_p:
    """Return a pointer to an array's first entry."""
    return ctypes.c_void_p(array.ctypes.data)


def _addresses(array: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | Sequence[FloatArray | IntC]) -> Addresses:
    """Return where each entry along an array's first axis, or each of several arrays, begins."""
    if isinstance(array, np.ndarray):
        return array.ctypes.data + array.strides[0] * np.arange(len(array), dtype=np.uintp)
    return np.array([one.ctypes.data for one in array], np.uintp)


def _is_old(library: ctypes.CDLL) -> bool:
    """Tell whether HPIPM is older than 2025: slacks counted by kind, and three functions with other arguments."""
    return hasattr(library, "d_ocp_qp_dim_set_nsg")


@cache
def load_hpipm() -> ctypes.CDLL:
    """Load HPIPM from a wheel.

    Raises:
        SolverError: it is not there.

    """
    name = _FILES.get(platform.system(), "libhpipm.so")
    found = [(find_spec(module), within) for module, within in _WHEELS]
    folders = [Path(place, within) for spec, within in found if spec for place in spec.submodule_search_locations or ()]
    folder = next((folder for folder in folders if (folder / name).is_file()), None)
    if folder is None:
        msg = f"neither the wheel comma-deps-acados nor CasADi's brings {name}"
        without = "in an environment without CasADi: both bring a module casadi"
        raise SolverError(msg, hint=f"pip install comma-deps-acados, for a processor with AVX2, {without}")
    needed = folder / name.replace("hpipm", "blasfeo")
    if needed.is_file():
        ctypes.CDLL(str(needed))  # which the other then finds, wherever the wheel lies
    library = ctypes.CDLL(str(folder / name))
    structures = ["d_ocp_qp", *(f"d_ocp_qp_{kind}" for kind in ("dim", "sol", "ipm_arg", "ipm_ws"))]
    sizes = [f"{kind}_{size}" for kind in structures for size in ("strsize", "memsize")] + [f"{kind}_memsize" for kind in _CONDENSING]
    for size in sizes:
        getattr(library, size).restype = ctypes.c_size_t
    return library
