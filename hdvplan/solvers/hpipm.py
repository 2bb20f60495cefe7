"""HPIPM: the interior-point method for optimal control of acados, by its C interface in CasADi's wheel; native workspace.

A program is copied into memory of the workspace, which HPIPM reads in one call through pointers that are made once. The given first
state is eliminated. Rows are HPIPM's own soft constraints, behind the bounds of u and x; their lower sides, which we do not have, are
masked. HPIPM condenses blocks of stages before it solves, and expands the solution.
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
from hdvplan.qp.workspace import QpResult, Status

TOLERANCE = 1e-8  # absolute, of all four residuals
_STATUS = (Status.SOLVED, Status.ITERATION_LIMIT, Status.NUMERICAL, Status.NUMERICAL, Status.INFEASIBLE)  # as hpipm_status counts
_ITERATIONS = 100
_BALANCE = 2  # hpipm_mode: relative formulation, refinement where it helps; SPEED is faster, but fails on some programs with broken limits
_START = 1e4  # complementarity at the start: rows cost 1e4 a metre; at 1e2 it takes twice as many iterations where they bind
_BLOCK = 4  # stages condensed into one: of 1, 3, 4, 5 and 8 the fastest at 200 stages, 1.2 to 2 times as fast as 1
_CLASSICAL = 0  # recursion of the condensing; the default takes the root of Q, and gives wrong points where Q is singular
_ROOM = 1024  # bytes of a structure of which HPIPM does not tell the size; they hold a few pointers
_ALIGNED = 64  # bytes, for vector instructions
_CONDENSING = ("d_part_cond_qp_arg", "d_part_cond_qp_ws")
_FILES = {"Darwin": "libhpipm.dylib", "Windows": "hpipm.dll"}

IntC = NDArray[np.int32]
Addresses = NDArray[np.uintp]  # one pointer a stage
Structure: TypeAlias = "ctypes.Array[ctypes.c_char]"


class _Memory(NamedTuple):
    """HPIPM's structures: a program and its solution, both once more in blocks of stages, and what condenses and solves them."""

    qp: Structure
    solution: Structure
    condensing: Structure
    condenser: Structure
    blocks: Structure
    blocks_solution: Structure
    arguments: Structure
    workspace: Structure


class HpipmWorkspace:
    """HPIPM in its balanced mode with partial condensing, cold in every solve."""

    name = "hpipm"
    starts_warm = False
    settings = (
        f"BALANCE, mu0 {_START:g}, condensed by {_BLOCK} stages, soft rows of its own, cold; "
        "BLASFEO built with TARGET=GENERIC in CasADi's wheel"
    )

    def __init__(self, shape: StageShape, *, tolerance: float = TOLERANCE) -> None:
        """Allocate HPIPM's memory and lay out what it does not read from the program.

        Raises:
            SolverError: CasADi has brought no HPIPM.

        """
        self._shape, self._library = shape, _library()
        self._point = StageSolution.empty(shape)
        self._kept: list[object] = []
        self._memory = self._allocate(tolerance)
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
        self._mask()

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:  # noqa: ARG002 - a guess helps no interior point here
        """Solve ``qp``; see ``QpWorkspace``."""
        started = perf_counter()
        qp.check()
        self._program.buffer[:] = qp.buffer
        self._gather()
        library, memory = self._library, self._memory
        library.d_ocp_qp_set_all_rowmaj(*self._from, memory.qp)
        updated = perf_counter()
        library.d_part_cond_qp_cond(memory.qp, memory.blocks, memory.condensing, memory.condenser)
        library.d_ocp_qp_ipm_solve(memory.blocks, memory.blocks_solution, memory.arguments, memory.workspace)
        library.d_part_cond_qp_expand_sol(memory.qp, memory.blocks_solution, memory.solution, memory.condensing, memory.condenser)
        library.d_ocp_qp_sol_get_all(memory.solution, *self._into)
        self._publish()
        status, iterations = ctypes.c_int(), ctypes.c_int()
        library.d_ocp_qp_ipm_get_status(memory.workspace, ctypes.byref(status))
        library.d_ocp_qp_ipm_get_iter(memory.workspace, ctypes.byref(iterations))
        claimed = _STATUS[status.value] if 0 <= status.value < len(_STATUS) else Status.FAILED
        return QpResult(claimed, self._point, iterations.value, updated - started, perf_counter() - updated)

    def _allocate(self, tolerance: float) -> _Memory:
        """Make HPIPM's structures."""
        library, shape = self._library, self._shape
        stages, p, b = shape.stages, shape.rows, len(shape.bounded_states)
        sizes = [
            np.array(values, np.int32)
            for values in (
                [0] + [shape.states] * stages, [shape.inputs] * stages + [0], [0] + [b] * stages, [shape.inputs] * stages + [0],
                [0] + [p] * stages, [0] + [p] * stages,
            )
        ]  # fmt: skip
        dimensions = self._made("d_ocp_qp_dim", stages)
        library.d_ocp_qp_dim_set_all(*map(_pointer, sizes), dimensions)
        count = max(1, stages // _BLOCK)
        lengths, shorter = np.zeros(count + 1, np.int32), self._made("d_ocp_qp_dim", count)
        library.d_part_cond_qp_compute_block_size(stages, count, _pointer(lengths))
        library.d_part_cond_qp_compute_dim(dimensions, _pointer(lengths), shorter)
        condensing = self._made("d_part_cond_qp_arg", count)
        library.d_part_cond_qp_arg_set_default(condensing)
        library.d_part_cond_qp_arg_set_ric_alg(_CLASSICAL, condensing)
        arguments = self._made("d_ocp_qp_ipm_arg", shorter)
        library.d_ocp_qp_ipm_arg_set_default(_BALANCE, arguments)
        library.d_ocp_qp_ipm_arg_set_iter_max(ctypes.byref(ctypes.c_int(_ITERATIONS)), arguments)
        library.d_ocp_qp_ipm_arg_set_mu0(ctypes.byref(ctypes.c_double(_START)), arguments)
        for residual in ("stat", "eq", "ineq", "comp"):
            getattr(library, f"d_ocp_qp_ipm_arg_set_tol_{residual}")(ctypes.byref(ctypes.c_double(tolerance)), arguments)
        return _Memory(
            self._made("d_ocp_qp", dimensions), self._made("d_ocp_qp_sol", dimensions),
            condensing, self._made("d_part_cond_qp_ws", dimensions, self._pointer_to(lengths), shorter, condensing),
            self._made("d_ocp_qp", shorter), self._made("d_ocp_qp_sol", shorter),
            arguments, self._made("d_ocp_qp_ipm_ws", shorter, arguments),
        )  # fmt: skip

    def _made(self, kind: str, *given: object) -> Structure:
        """Return one of HPIPM's structures with separate memory."""
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
        return _pointer(array)

    def _places_of_program(self) -> list[Addresses]:
        """Return where HPIPM finds every argument of its ``set_all``, stage by stage."""
        s, everywhere = self._program.stages, len(self._program.stages)
        b = _addresses(s["c"])
        b[0] = self._first.ctypes.data
        nothing = [self._none] * everywhere
        return [
            _addresses(s["A"]), _addresses(s["B"]), b, _addresses(s["Q"]), _addresses(nothing), _addresses(s["R"]),
            _addresses(s["q"]), _addresses(s["r"]),
            _addresses([self._bounded] * everywhere), _addresses(s["x_low"]), _addresses(s["x_high"]),
            _addresses([self._inputs] * everywhere), _addresses(s["u_low"]), _addresses(s["u_high"]),
            _addresses(self._G), _addresses(nothing), _addresses(nothing), _addresses(self._h),
            _addresses([self._one] * everywhere), _addresses(self._quadratic), _addresses(nothing), _addresses(self._linear),
            _addresses(self._softened), _addresses(self._softening), _addresses(nothing), _addresses(nothing),
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

    def _mask(self) -> None:
        """Take the rows' lower sides and their slacks out of the program."""
        zeros = np.zeros(max(self._shape.rows, 1))
        for stage in range(1, self._shape.stages + 1):
            for field in (b"lg_mask", b"lls_mask"):
                self._library.d_ocp_qp_set(field, stage, _pointer(zeros), self._memory.qp)

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


def _pointer(array: FloatArray | IntC | Addresses) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _addresses(array: np.ndarray[tuple[int, ...], np.dtype[np.float64]] | Sequence[FloatArray | IntC]) -> Addresses:
    """Return where each entry along an array's first axis, or each of several arrays, begins."""
    if isinstance(array, np.ndarray):
        return array.ctypes.data + array.strides[0] * np.arange(len(array), dtype=np.uintp)
    return np.array([one.ctypes.data for one in array], np.uintp)


@cache
def _library() -> ctypes.CDLL:
    """Load HPIPM from CasADi's wheel.

    Raises:
        SolverError: it is not there.

    """
    found = find_spec("casadi")
    places = [] if found is None else [Path(place) for place in found.submodule_search_locations or ()]
    name = _FILES.get(platform.system(), "libhpipm.so")
    file = next((place / name for place in places if (place / name).is_file()), None)
    if file is None:
        msg = f"the installed CasADi brings no {name}"
        raise SolverError(msg, hint="install another one: pip install --upgrade casadi")
    library = ctypes.CDLL(str(file))
    structures = ["d_ocp_qp", *(f"d_ocp_qp_{kind}" for kind in ("dim", "sol", "ipm_arg", "ipm_ws"))]
    sizes = [f"{kind}_{size}" for kind in structures for size in ("strsize", "memsize")] + [f"{kind}_memsize" for kind in _CONDENSING]
    for size in sizes:
        getattr(library, size).restype = ctypes.c_size_t
    return library
