"""The solver of an exported planner as a contestant: ``hdvplan bench --solvers riccati,benchmarks/exported_solver.py:ExportedWorkspace``.

Compiles, for a program's shape, the files that ``hdvplan export-c`` writes, with ``$CC``, else ``cc``. Linearising stays hdvplan's own, as
with every contestant: what differs is that all sizes are constants, and the compiler.
"""

from __future__ import annotations

import ctypes
import os
import shlex
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path
from time import perf_counter

from hdvplan.errors import SolverError
from hdvplan.export.write import core_files
from hdvplan.qp.program import StageQp, StageShape, StageSolution
from hdvplan.qp.workspace import ENDINGS, QpResult
from hdvplan.solvers.riccati import RiccatiWorkspace

SOLVER = ("solve", "active_set", "interior", "riccati")
# as hdvplan's own core, on the processor that is here
FLAGS = ("-std=c99", "-O3", "-ffp-contract=fast", "-fno-math-errno", "-fno-trapping-math", "-march=native", "-shared", "-fPIC")


COMPILER = shlex.split(os.environ.get("CC") or "cc")
if shutil.which(COMPILER[0]) is None:
    _MSG = f"the exported solver needs a C compiler, and there is no {COMPILER[0]!r}"
    raise SolverError(_MSG, hint="install gcc or clang, or let CC name one")


@cache
def compiled(states: int, inputs: int) -> ctypes.CDLL:
    """Return the solver for programs of ``states`` and ``inputs``.

    Raises:
        SolverError: the compiler refuses the files.

    """
    with tempfile.TemporaryDirectory() as made:
        for name, text in core_files(SOLVER, states, states, inputs).items():
            Path(made, name).write_text(text, encoding="utf-8")
        words = [*COMPILER, *FLAGS, "-o", "solver.so", *(f"{name}.c" for name in SOLVER), "-lm"]
        try:
            subprocess.run(words, cwd=made, check=True, capture_output=True, text=True)  # noqa: S603 - the user's compiler
        except subprocess.CalledProcessError as error:
            msg = f"{COMPILER[0]!r} cannot compile the exported solver: {error.stderr.strip().splitlines()[:1]}"
            raise SolverError(msg) from error
        return ctypes.CDLL(str(Path(made, "solver.so")))


class ExportedWorkspace(RiccatiWorkspace):
    """hdvplan's solver as ``export-c`` writes it for one vehicle, compiled here."""

    name = "exported"

    def __init__(self, shape: StageShape) -> None:
        """Compile, once a shape."""
        super().__init__(shape)
        self._own = compiled(shape.states, shape.inputs).hdv_solve
        self._own.argtypes, self._own.restype = 5 * [ctypes.c_void_p], None

    def solve(self, qp: StageQp, guess: StageSolution | None) -> QpResult:
        """Solve by what was compiled; see ``RiccatiWorkspace``."""
        started = perf_counter()
        solver, point, solved = self._to
        self._own(solver, qp.address, None if guess is None else guess.address_for(qp.shape), point, solved)
        ending, factorisations, binding = self._solved.tolist()
        return QpResult(ENDINGS[ending], self._point, factorisations, 0.0, perf_counter() - started, leaves_guess=bool(binding))
