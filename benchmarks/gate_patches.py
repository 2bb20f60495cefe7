"""How a program can become worse in the gate's experiment: what is done to recorded numbers, and patches of the planner."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.bench.comparing.sides import IMPORT, PEAK, Name, Steps

SAME = "same"
Process = tuple[Mapping[Name, Steps], Mapping[str, float]]
Worse = Callable[[Process, np.random.Generator], Process]


def _added(steps: Steps, added: FloatArray) -> Steps:
    """Return steps that take longer, within the planner's own clock."""
    return replace(steps, total=steps.total + added, outer=steps.outer + added)


def _everywhere(change: Callable[[Steps, np.random.Generator], Steps]) -> Worse:
    def worse(process: Process, random: np.random.Generator) -> Process:
        return {name: change(steps, random) for name, steps in process[0].items()}, process[1]

    return worse


def _one_cell(process: Process, _: np.random.Generator) -> Process:
    first = next(iter(process[0]))
    return {name: _added(steps, 0.2 * steps.total) if name == first else steps for name, steps in process[0].items()}, process[1]


def _more(key: str, amount: float) -> Worse:
    return lambda process, _: (process[0], {**process[1], key: process[1][key] + amount})


# What is done to the recorded numbers of the new side.
WORSE: Mapping[str, Worse] = {
    SAME: lambda process, _: process,
    "12 % everywhere": _everywhere(lambda steps, _: _added(steps, 0.12 * steps.total)),
    "20 % in one cell of eight": _one_cell,
    "a random half of the steps x 2": _everywhere(
        lambda steps, random: _added(steps, steps.total * random.choice([0.0, 1.0], steps.total.shape))
    ),
    "5 % of the steps + 5 ms": _everywhere(
        lambda steps, random: _added(steps, random.choice([0.0, 5e-3], steps.total.shape, p=[0.95, 0.05]))
    ),
    "20 % outside of the planner's clock": _everywhere(lambda steps, _: replace(steps, outer=steps.outer + 0.2 * steps.total)),
    "first plan x 2": _everywhere(lambda steps, _: replace(steps, first=2.0 * steps.first)),
    "import + 0.5 s": _more(IMPORT, 0.5),
    "memory + 100 MB": _more(PEAK, 1e8),
}

# What is appended to the planner's module in the copies.
_SLOWER = """

import random as _random
from dataclasses import replace as _replace


def _slowed(plan):
    def slower(self, *arguments):
        began = perf_counter()
        planned = plan(self, *arguments)
        took = perf_counter() - began
        first = not getattr(self, "_planned_before", False)
        self._planned_before = True
        end = perf_counter() + ({wait})
        while perf_counter() < end:
            pass
        return {returned}

    return slower


Planner.plan = _slowed(Planner.plan)
"""
_ONE_CELL = """

def _marked(made):
    def init(self, vehicle, stations, *others):
        made(self, vehicle, stations, *others)
        self._is_marked = len(vehicle.units) > 1 and str(others[1].scheme) == "rti" and stations.path.length > 400.0

    return init


Planner.__init__ = _marked(Planner.__init__)
"""
_TIMED = "_replace(planned, times=_replace(planned.times, total=perf_counter() - began))"
_FURTHER = """

from dataclasses import replace as _replace


def _further(made):
    def init(self, vehicle, stations, centred, settings, make_workspace):
        made(self, vehicle, stations, centred, _replace(settings, sqp_tolerance=1e-3 * settings.sqp_tolerance), make_workspace)

    return init


Planner.__init__ = _further(Planner.__init__)
"""
PATCHES = {
    SAME: "",
    "12 % everywhere": _SLOWER.format(wait="0.12 * took", returned=_TIMED),
    "20 % in one cell of eight": _SLOWER.format(wait="0.2 * took * self._is_marked", returned=_TIMED) + _ONE_CELL,
    "a random half of the steps x 2": _SLOWER.format(wait="took * (_random.random() < 0.5)", returned=_TIMED),
    "5 % of the steps + 5 ms": _SLOWER.format(wait="5e-3 * (_random.random() < 0.05)", returned=_TIMED),
    "20 % outside of the planner's clock": _SLOWER.format(wait="0.2 * took", returned="planned"),
    "first plan x 2": _SLOWER.format(wait="took if first else 0.0", returned=_TIMED),
    "import + 0.5 s": "\n\nimport time as _time\n\n_time.sleep(0.5)\n",
    "memory + 100 MB": "\n\n_HELD = np.ones(12_500_000)\n",
    "changed iterations": _FURTHER,
    "a crash at import": "\n\nraise RuntimeError('half a commit')\n",
}
