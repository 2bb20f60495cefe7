"""hdvplan: can this bus or truck drive this real road, how evenly does it sweep it, and which QP solver plans it fast enough?

The Python interface, in the order of use; everything else may change::

    road = hdvplan.load_road("monaco_fairmont_hairpin").with_limits(4.2, 4.2)  # a file, or a name that ships
    vehicle = hdvplan.load_vehicle("tractor-trailer")                          # a preset, or a TOML file
    case = hdvplan.Case(road, vehicle)                                         # a run as a value: it pickles, and has a key
    result = hdvplan.plan(case)                                                # receding horizon, judged by simulation
    result.balance.max_left, result.balance.min_clearance, result.balance.breaches
    hdvplan.write_plan(result, Path("out"), pictures=["png"])                  # what `hdvplan plan` writes
    hdvplan.study.run("lines.toml", "out")                                     # many cases, as `hdvplan study` plans them

Names load when they are first used: ``import hdvplan`` itself, and so ``hdvplan --help``, stays quick.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from hdvplan.version import __version__

if TYPE_CHECKING:
    from hdvplan import study as study
    from hdvplan.api import clearest as clearest
    from hdvplan.api import judge as judge
    from hdvplan.api import plan as plan
    from hdvplan.api import prove as prove
    from hdvplan.api import replanned as replanned
    from hdvplan.api import solver as solver
    from hdvplan.case import Case as Case
    from hdvplan.driving.given import GivenPath as GivenPath
    from hdvplan.errors import HdvplanError as HdvplanError
    from hdvplan.judging.legs import LegsResult as LegsResult
    from hdvplan.judging.result import Result as Result
    from hdvplan.judging.verdict import verdict_of as verdict_of
    from hdvplan.legs import load_legs as load_legs
    from hdvplan.legs import plan_legs as plan_legs
    from hdvplan.loop import LoopSettings as LoopSettings
    from hdvplan.loop.closed import closed_loop as closed_loop
    from hdvplan.need.answer import need_of as need_of
    from hdvplan.planning.bias import Bias as Bias
    from hdvplan.planning.settings import PlannerSettings as PlannerSettings
    from hdvplan.qp.workspace import QpWorkspace as QpWorkspace
    from hdvplan.report.files import write_plan as write_plan
    from hdvplan.report.html import write_report as write_report
    from hdvplan.report.leg_files import write_legs as write_legs
    from hdvplan.report.plots import plan_figure as plan_figure
    from hdvplan.report.summary import summary_of as summary_of
    from hdvplan.road.legs import Leg as Leg
    from hdvplan.road.legs import Legs as Legs
    from hdvplan.road.limits import Limits as Limits
    from hdvplan.road.load import load_road as load_road
    from hdvplan.road.meeting import beside_swept as beside_swept
    from hdvplan.road.options import RoadOptions as RoadOptions
    from hdvplan.road.road import Road as Road
    from hdvplan.stepping import Stepper as Stepper
    from hdvplan.vehicle.load import load_vehicle as load_vehicle
    from hdvplan.vehicle.model import Unit as Unit
    from hdvplan.vehicle.model import Vehicle as Vehicle

_HOMES = {
    "Bias": "hdvplan.planning.bias",
    "Case": "hdvplan.case",
    "HdvplanError": "hdvplan.errors",
    "GivenPath": "hdvplan.driving.given",
    "Leg": "hdvplan.road.legs",
    "Legs": "hdvplan.road.legs",
    "LegsResult": "hdvplan.judging.legs",
    "Limits": "hdvplan.road.limits",
    "LoopSettings": "hdvplan.loop",
    "PlannerSettings": "hdvplan.planning.settings",
    "QpWorkspace": "hdvplan.qp.workspace",
    "Result": "hdvplan.judging.result",
    "Road": "hdvplan.road.road",
    "RoadOptions": "hdvplan.road.options",
    "Stepper": "hdvplan.stepping",
    "Unit": "hdvplan.vehicle.model",
    "Vehicle": "hdvplan.vehicle.model",
    "judge": "hdvplan.api",
    "load_legs": "hdvplan.legs",
    "load_road": "hdvplan.road.load",
    "load_vehicle": "hdvplan.vehicle.load",
    "need_of": "hdvplan.need.answer",
    "plan": "hdvplan.api",
    "plan_figure": "hdvplan.report.plots",
    "plan_legs": "hdvplan.legs",
    "prove": "hdvplan.api",
    "beside_swept": "hdvplan.road.meeting",
    "clearest": "hdvplan.api",
    "closed_loop": "hdvplan.loop.closed",
    "replanned": "hdvplan.api",
    "solver": "hdvplan.api",
    "study": "hdvplan.study",
    "summary_of": "hdvplan.report.summary",
    "verdict_of": "hdvplan.judging.verdict",
    "write_legs": "hdvplan.report.leg_files",
    "write_plan": "hdvplan.report.files",
    "write_report": "hdvplan.report.html",
}

__all__ = ["__version__", *_HOMES]  # noqa: PLE0604 - they are strings


if not TYPE_CHECKING:  # else a type checker would believe in any name

    def __getattr__(name: str) -> object:
        """Load a public name when it is first asked for (PEP 562)."""
        if name not in _HOMES:
            msg = f"module 'hdvplan' has no attribute {name!r}"
            raise AttributeError(msg)
        home = import_module(_HOMES[name])
        value: object = home if home.__name__ == f"hdvplan.{name}" else getattr(home, name)  # a package is public as a whole
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    """Tell the public names before they are loaded."""
    return sorted(__all__)
