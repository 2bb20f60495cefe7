"""An exported planner, compiled here and called as its host would: in the place of hdvplan's own in a drive."""

from __future__ import annotations

import atexit
import ctypes
import shutil
import subprocess
import tempfile
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import NamedTuple, cast

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.case import Case
from hdvplan.driving.drive import Drive
from hdvplan.driving.drive import driven as driven_from
from hdvplan.export import UNLIMITED, Budget
from hdvplan.export.write import PLANNER, begun, exported
from hdvplan.planning.planner import Plan, Planner
from hdvplan.stepping import Stepper

FLAGS = ("-std=c99", "-Wall", "-Wextra", "-Werror", "-pedantic")
ROUNDING = 1e-12  # of plans by other instructions [m, rad, 1/m]
STATUSES = ("done", "spent", "kept", "beyond")
_PROBE = """
#include "sample.h"
static struct hdvplan_memory memory;
static int64_t gone; /* stations, from the tables */
int begin(void) {
    gone = 0;
    int agrees = hdvplan_begin(&memory, &sample_road);
    return agrees;
}
void budget(int64_t factorisations, int64_t linearisations) {
    memory.planner.most_factorisations = factorisations;
    memory.planner.most_linearisations = linearisations;
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


@cache
def _objects(texts: tuple[tuple[str, str], ...], flags: tuple[str, ...]) -> list[str]:
    """Return the object files of a vehicle's planner and its probe, compiled once for all its roads."""
    made = tempfile.mkdtemp()
    atexit.register(shutil.rmtree, made)
    for name, text in texts:
        Path(made, name).write_text(text, encoding="utf-8")
    sources = ["planner.c", "vehicle.c", "probe.c", *(f"{name}.c" for name in PLANNER)]
    command = ["cc", *FLAGS, *flags, "-fPIC", "-c", *sources]
    subprocess.run(command, cwd=made, check=True, capture_output=True, text=True)  # noqa: S603 - ours
    return sorted(str(path) for path in Path(made).glob("*.o"))


class ExportedPlanner:
    """The planner of a case as its C files have it; ``plan`` is that of ``Planner``.

    ``counts`` has what each plan took: its status in C, programs, factorisations and linearisations; ``memory`` [bytes].
    """

    def __init__(self, case: Case, folder: Path, *, flags: tuple[str, ...] = ("-O2",)) -> None:
        """Write and compile."""
        texts = exported(case, UNLIMITED) | {"probe.c": _PROBE}
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        del texts["sample.c"]
        objects = _objects(tuple(texts.items()), flags)
        command = ["cc", "-std=c99", "-shared", "-fPIC", "-o", "planner.so", "sample.c", *objects, "-lm"]
        subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True)  # noqa: S603 - ours
        library = ctypes.CDLL(str(folder / "planner.so"))
        library.motion.restype = ctypes.POINTER(ctypes.c_double)
        library.step.argtypes = [ctypes.c_int64, ctypes.c_void_p, ctypes.c_double]
        library.budget.argtypes = [ctypes.c_int64, ctypes.c_int64]
        self._library, self._stages, self._states = library, case.settings.stages, case.vehicle.states
        self._counts, self._violation = np.zeros(4, np.int64), np.zeros(1)
        self.begin(UNLIMITED)

    def begin(self, budget: Budget) -> None:
        """Forget the last drive, and keep to a budget."""
        self.counts: list[tuple[str, int, int, int]] = []
        self.violations: list[float] = []
        if self._library.begin() != 1:
            msg = "vehicle.h was made for another core"
            raise RuntimeError(msg)
        self.keep_to(budget)
        self._count()

    def keep_to(self, budget: Budget) -> None:
        """Keep to a budget from now on."""
        self._library.budget(budget.factorisations, budget.linearisations)

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


class Apart(NamedTuple):
    """How an exported planner's plans lie beside hdvplan's, each from the same state and with its own memory of the last."""

    difference: float  # the largest of a state or curvature
    beyond: int  # plans that differ by more than ROUNDING
    recounted: int  # plans that took another number of programs or factorisations


def compared(case: Case, planner: ExportedPlanner) -> Apart:
    """Return how the plans of a case compare, along hdvplan's drive."""
    stepper, most, beyond, recounted = Stepper(case), 0.0, 0, 0
    while not stepper.done:
        motion = planner.step(stepper.at, stepper.z, stepper.kappa)
        plan = stepper.plan()
        apart = max(float(np.max(np.abs(motion[:, :-1] - plan.z))), float(np.max(np.abs(motion[:-1, -1] - plan.kappa))))
        most, beyond = max(most, apart), beyond + (apart > ROUNDING)
        recounted += planner.counts[-1][1:3] != (plan.qp_count, plan.qp_iterations)
        stepper.arrive(stepper.simulate(plan)[-1], float(plan.kappa[stepper.count - 1]))
    return Apart(most, beyond, recounted)


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
