"""An exported planner, compiled here and called as its host would: in the place of hdvplan's own in a drive."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import cast

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive, Ready, ready
from hdvplan.driving.drive import driven as driven_from
from hdvplan.export.budget import UNLIMITED, Budget
from hdvplan.export.write import PLANNER, exported
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.planner import Plan, Planner
from hdvplan.solvers.registry import dependable

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
STATUSES = ("done", "spent", "kept", "beyond")
_PROBE = """
#include "sample.h"
static struct hdvplan_memory memory;
static int64_t gone; /* stations, from the tables */
int begin(int64_t factorisations, int64_t linearisations) {
    gone = 0;
    int agrees = hdvplan_begin(&memory, &sample_road);
    memory.planner.most_factorisations = factorisations;
    memory.planner.most_linearisations = linearisations;
    return agrees;
}
void refresh(int64_t dropped) {
    static struct hdvplan_road road;
    road = sample_road;
    road.stations += dropped;
    road.states += dropped * STATES;
    road.curvatures += dropped;
    road.residuals += dropped;
    road.angles += dropped * WHEELS;
    road.count -= dropped;
    hdvplan_refresh(&memory, &road, dropped - gone);
    gone = dropped;
}
int step(int64_t station, const double *state, double kappa) { return hdvplan_step(&memory, station - gone, state, kappa); }
const double *motion(void) { return hdvplan_motion(&memory, 0); }
void counts(int64_t *to, double *violation) {
    to[0] = memory.planner.programs;
    to[1] = memory.planner.iterations;
    to[2] = memory.planner.linearisations;
    to[3] = sizeof memory;
    *violation = memory.planner.violation;
}
"""


class ExportedPlanner:
    """The planner of a case as its C files have it; ``plan`` is that of ``Planner``.

    ``counts`` has what each plan took: its status in C, programs, factorisations and linearisations; ``memory`` [bytes].
    """

    def __init__(self, case: Case, folder: Path, *, compiler: str = "cc", flags: tuple[str, ...] = ("-O2",)) -> None:
        """Write and compile."""
        for name, text in exported(case, UNLIMITED).items():
            (folder / name).write_text(text, encoding="utf-8")
        (folder / "probe.c").write_text(_PROBE, encoding="utf-8")
        sources = ["planner.c", "vehicle.c", "sample.c", "probe.c", *(f"{name}.c" for name in PLANNER)]
        command = [compiler, *FLAGS, *flags, "-shared", "-fPIC", "-o", "planner.so", *sources, "-lm"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)  # noqa: S603 - ours
        library = ctypes.CDLL(str(folder / "planner.so"))
        library.motion.restype = ctypes.POINTER(ctypes.c_double)
        library.step.argtypes = [ctypes.c_int64, ctypes.c_void_p, ctypes.c_double]
        library.begin.argtypes = [ctypes.c_int64, ctypes.c_int64]
        self._library, self._stages, self._states = library, case.settings.stages, case.vehicle.states
        self._counts, self._violation = np.zeros(4, np.int64), np.zeros(1)
        self.begin(UNLIMITED)

    def begin(self, budget: Budget) -> None:
        """Forget the last drive, and keep to a budget from now on."""
        self.counts: list[tuple[str, int, int, int]] = []
        self.violations: list[float] = []
        if self._library.begin(budget.factorisations, budget.linearisations) != 1:
            msg = "vehicle.h was made for another core"
            raise RuntimeError(msg)
        self._count()

    def _count(self) -> list[int]:
        """Return programs, factorisations and linearisations of the last step; note the size of the memory."""
        self._library.counts(ctypes.c_void_p(self._counts.ctypes.data), ctypes.c_void_p(self._violation.ctypes.data))
        *counts, self.memory = self._counts.tolist()
        return counts

    def refresh(self, dropped: int) -> None:
        """Let the road's tables begin at station ``dropped``."""
        self._library.refresh(ctypes.c_int64(dropped))

    def step(self, first: int, z: FloatArray, kappa_before: float) -> FloatArray:
        """Plan once; return the motion, (N + 1, states + 1)."""
        z = np.ascontiguousarray(z)
        status = self._library.step(first, z.ctypes.data, kappa_before)
        programs, factorisations, linearisations = self._count()
        self.counts.append((STATUSES[status], programs, factorisations, linearisations))
        self.violations.append(float(self._violation[0]))
        motion = np.ctypeslib.as_array(self._library.motion(), ((self._stages + 1) * (self._states + 1),))
        return motion.reshape(self._stages + 1, self._states + 1).copy()


def begun(case: Case) -> Ready:
    """Return what a drive of a case begins with."""
    road, _ = choose_sides(case)
    return ready(road, case.vehicle, objective_named(case.objective), dependable(case.solver), case.settings, case.bias)


class _InPlace:
    """An exported planner where a drive expects hdvplan's: its plans are those of ``planner`` with the motion exchanged."""

    def __init__(self, planner: ExportedPlanner, pattern: Plan) -> None:
        self._planner, self._pattern = planner, pattern

    def plan(self, first: int, z: FloatArray, kappa_before: float) -> Plan:
        """Return the plan; what belongs to a solver is the pattern's."""
        motion = self._planner.step(first, z, kappa_before)
        return replace(self._pattern, first=first, z=motion[:, :-1], kappa=motion[:-1, -1], kappa_before=kappa_before)


def driven(case: Case, planner: ExportedPlanner) -> Drive:
    """Return the drive of a case by its exported planner."""
    start = begun(case)
    pattern = start.planner.plan(0, np.ascontiguousarray(start.begin.z), start.begin.kappa)
    return driven_from(replace(start, planner=cast("Planner", _InPlace(planner, pattern))))
