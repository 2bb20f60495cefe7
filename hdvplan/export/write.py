"""The files of ``hdvplan export-c``: those of the core that plan, and a vehicle, its settings and a sample road as constants."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hdvplan import core
from hdvplan.arrays import FloatArray, IntArray, Records
from hdvplan.case import Case
from hdvplan.driving.drive import Ready, ready
from hdvplan.errors import OptionError
from hdvplan.export import Budget
from hdvplan.fileio import Together, json_bytes
from hdvplan.passing.sides import choose_sides
from hdvplan.planning.assembly import assemble
from hdvplan.planning.objectives import objective_named
from hdvplan.planning.planner import planner_record
from hdvplan.planning.terms.centring import Centring, CentringPart
from hdvplan.planning.terms.limits import LimitsPart
from hdvplan.planning.terms.steering import bounds_of
from hdvplan.planning.terms.term import CorePart, Scene
from hdvplan.qp.program import by_stage
from hdvplan.record import NAME as RECORD
from hdvplan.record import record_of
from hdvplan.solvers.registry import dependable
from hdvplan.solvers.riccati import TOLERANCE
from hdvplan.version import __version__

PLANNER = (  # files of the core that plan
    "step", "motion", "dynamics", "steering", "centring", "limits", "street", "screening", "solve", "active_set", "interior",
    "riccati", "residuals",
)  # fmt: skip
_SAMPLE = ("simulate",)  # that drive the sample
_OWN = ("planner.h", "planner.c", "sample.h", "main.c", "Makefile", "README.md")
_CORE, _HERE = Path(core.__file__).parent / "core", Path(__file__).parent / "c"
_WIDTH = 110  # of a line of numbers
_TYPES = {"f": "double", "i": "int64_t"}
_WRITTEN = f"Written by hdvplan {__version__}: export it again instead of editing."
_INCLUDED = re.compile(r'^#include "(\w+\.h)"$', re.MULTILINE)
_UNROLLED = re.compile(r"#define HDV_UNROLLED\(n, m, function, \.\.\.\)(?:.*\\\n)+.*\n")
_MOST = re.compile(r"HDV_MOST_UNITS = \d+, HDV_MOST_STATES = \d+, HDV_MOST_INPUTS = \d+")


class _Planner(NamedTuple):
    """A planner as it is before its first step."""

    begun: Ready
    scene: Scene
    parts: dict[str, CorePart]


def exported(case: Case, budget: Budget) -> dict[str, str]:
    """Return the files of a case's planner and of its road as the sample, by name.

    Raises:
        OptionError: an objective that is more than centring, or a solver that is not ours.
        SolverError, RoadError, PlanError: as for ``Stepper``.

    """
    planner = _planner(case)
    shape = planner.scene.qp.shape
    files = core_files((*PLANNER, *_SAMPLE), len(planner.scene.units), shape.states, shape.inputs)  # with room for this vehicle alone
    for name in _OWN:
        files[name] = (_HERE / name).read_text(encoding="utf-8")
    files["Makefile"] = files["Makefile"].replace("@PLANNER@", " ".join(["planner.c", "vehicle.c", *(f"{name}.c" for name in PLANNER)]))
    files["vehicle.h"] = _vehicle_header(planner)
    files["vehicle.c"] = _vehicle(planner, case, budget)
    files["sample.c"] = _sample(planner, case)
    return files


def write_planner(case: Case, directory: Path, budget: Budget) -> None:
    """Write the files of ``exported`` into a folder, and ``run.json``, which says from what.

    Raises:
        OptionError: as for ``exported``, or files of these names are there that hdvplan did not write.
        OSError: the folder or a file cannot be written.

    """
    texts = exported(case, budget)
    texts[RECORD] = json_bytes(record_of([case]) | {"budget": asdict(budget)}).decode()
    contents = {name: text.encode for name, text in texts.items()}
    Together(RECORD, tuple(texts), {RECORD: "software"}).write(directory, contents)


def begun(case: Case) -> Ready:
    """Return what a drive of a case begins with."""
    road, _ = choose_sides(case)
    return ready(road, case.vehicle, objective_named(case.objective), dependable(case.solver), case.settings, case.bias)


def _planner(case: Case) -> _Planner:
    """Return a case's planner, with memory for one horizon."""
    if case.solver_name != "riccati":
        msg = f"only the solver riccati is exported, not {case.solver_name}"
        raise OptionError(msg, hint="leave --solver out")
    start = begun(case)
    if len(start.goal.terms) != 1 or not isinstance(start.goal.terms[0], Centring):
        msg = f"the objective {case.objective_name} cannot be exported: it is more than centring two axles"
        raise OptionError(msg, hint="export one that centres an axle, or a weighted sum of two, such as geometric or lead-axle")
    scene, parts = assemble(case.vehicle, start.stations, start.goal, case.settings)
    return _Planner(start, scene, {_name(part): part for part in parts if isinstance(part, CorePart)})


def _name(part: CorePart) -> str:
    """Return what the C files call a term."""
    name: str = part.functions.linearise.__name__
    return name.removeprefix("hdv_linearise_")


def core_files(names: tuple[str, ...], units: int, n: int, m: int) -> dict[str, str]:
    """Return files of the core and what they include, for programs of ``n`` states and ``m`` inputs alone."""
    files, wanted = {}, [f"{name}.c" for name in names]
    while wanted:
        name = wanted.pop()
        if name not in files and name not in _OWN:
            files[name] = (_CORE / name).read_text(encoding="utf-8")
            wanted += _INCLUDED.findall(files[name])
    most = f"HDV_MOST_UNITS = {units + 1}, HDV_MOST_STATES = {n}, HDV_MOST_INPUTS = {m}"
    only = f"#define HDV_UNROLLED(n, m, function, ...) ((void)(n), (void)(m), function(__VA_ARGS__, {n}, {m}))\n"
    for name, pattern, text in (("hdvplan.h", _MOST, most), ("sizes.h", _UNROLLED, only)):
        files[name], found = pattern.subn(text, files[name])
        assert found == 1  # noqa: S101 - a change of the core's headers shows in the tests
    return files


def _vehicle_header(planner: _Planner) -> str:
    shape, vehicle, settings = planner.scene.qp.shape, planner.begun.vehicle, planner.begun.settings
    sizes = {
        "UNITS": (len(vehicle.units), "bodies"),
        "STATES": (vehicle.states, "e_y, e_psi, articulation angles, angles of the wheels that the plan steers"),
        "WHEELS": (len(vehicle.active), "axles that the plan steers besides the front one"),
        "STAGES": (shape.stages, "intervals of a horizon"),
        "EXECUTED": (settings.executed, "of them driven before the next plan"),
        "COLUMNS": (shape.states, "states of the program"),
        "INPUTS": (shape.inputs, "of an interval"),
        "ROWS": (shape.rows, "limits of a stage"),
        "BOUNDED": (len(shape.bounded_states), "states with bounds"),
    }
    lines = "".join(f"    {name} = {value}, /* {what} */\n" for name, (value, what) in sizes.items())
    return (
        f"/* Sizes of the planner of the {_comment(vehicle.name)}. {_WRITTEN} */\n"
        "#ifndef HDVPLAN_VEHICLE_H\n#define HDVPLAN_VEHICLE_H\n\n"
        f"enum {{\n{lines}}};\n\n#define STEP_M {number(settings.step)} /* between stations [m] */\n\n#endif\n"
    )


def _comment(text: str) -> str:
    """Return text from a user that cannot end a comment."""
    return re.sub(r"[^\w .,:()-]", " ", text)


def _vehicle(planner: _Planner, case: Case, budget: Budget) -> str:
    """Return ``vehicle.c``: dimensions, settings, and what the records of a program begin with."""
    scene, parts = planner.scene, planner.parts
    limits = parts.get("limits")
    own = planner_record(scene.vehicle, planner.begun.goal, scene.settings)
    own["most_factorisations"], own["most_linearisations"] = budget.factorisations, budget.linearisations
    most, change = bounds_of(scene.vehicle, scene.settings.step)
    arrays = [
        array("units", scene.units, "hdv_unit"),
        array("most", most),
        array("change", change),
        array("behind", limits.kept[2] if isinstance(limits, LimitsPart) else np.zeros(len(scene.units))),
        array("stage", by_stage(_begins_with(scene.qp.stages))),
        array("rows", by_stage(_begins_with(scene.qp.rows))),
        array("bounded", scene.qp.bounded),
    ]
    records = {name: record(parts[name].data) for name in ("dynamics", "steering", "centring", "limits") if name in parts}
    fields = [f".units = units, .planner = {record(own)}", *(f".{name} = {values}" for name, values in records.items())]
    fields += [*(f".{name} = {name}" for name in ("most", "change", "behind", "stage", "rows", "bounded")), f".tolerance = {TOLERANCE!r}"]
    listed = ",\n".join(f"    {field}" for field in fields)
    return (
        f"/* The {_comment(scene.vehicle.name)}, objective {_comment(case.objective_name)}. {_WRITTEN} */\n"
        '#include "planner.h"\n\n#include <math.h>\n\n'
        + "\n".join(f"static {text}" for text in arrays)
        + f"\nconst struct hdvplan_vehicle hdvplan_vehicle = {{\n{listed}}};\n"
    )


def _begins_with(records: Records) -> Records:
    """Return the record that all stages begin with, (1, ...)."""
    assert (records == records[:1]).all()  # noqa: S101 - what differs from stage to stage is the road's, and stands in its tables
    return np.ascontiguousarray(records[:1])


_STREET = {"pieces": "hdv_piece", "reach": "", "blocks": "hdv_block", "block_reach": ""}  # arrays, and what they are of


def _sample(planner: _Planner, case: Case) -> str:
    """Return ``sample.c``: a road's tables, and the vehicle at its start."""
    stations, begin, parts = planner.begun.stations, planner.begun.begin, planner.parts
    centring, street, steering = parts["centring"], stations.street, parts["steering"]
    assert isinstance(centring, CentringPart)  # noqa: S101 - for the type checker
    total = int(np.ceil(planner.begun.road.path.length / stations.step - 1e-9))
    curve = stations.path.record
    arrays = [
        array("coefficients", stations.path.coefficients),
        array("stations", stations.points, "hdv_station"),
        array("states", stations.centring.states),
        array("curvatures", stations.centring.kappa),
        array("residuals", centring.coefficients, "hdv_residual"),
        array("angles", steering.kept[0]),
        *(array(name, getattr(street, name), kind) for name, kind in (_STREET.items() if street else ())),
    ]
    own = {} if street is None else {"street": record(_kept(street.record, case), {name: name for name in _STREET})}
    fields = {
        "curve": record(curve, {"coefficients": "coefficients"}),
        **{name: name for name in ("stations", "states", "curvatures", "residuals", "angles")},
        "count": str(len(stations.s)),
        **own,
    }
    listed = ",\n".join(f"    .{name} = {value}" for name, value in fields.items())
    return (
        f"/* {_comment(planner.begun.road.name)}. {_WRITTEN} */\n"
        '#include "sample.h"\n\n#include <math.h>\n\n'
        + "\n".join(f"static {text}" for text in arrays)
        + f"\nconst struct hdvplan_road sample_road = {{\n{listed}}};\n"
        + f"\n{array('sample_start', begin.z)}const double sample_kappa = {number(begin.kappa)};\n"
        + f"const int64_t sample_stations = {total};\n"
    )


def _kept(street: Records, case: Case) -> Records:
    """Return the street's record with the clearance that the settings ask for."""
    found = street.copy()
    found["clearance"] = case.settings.clearance - case.settings.give_way
    return found


def number(value: Any) -> str:  # noqa: ANN401 - a number of Python or NumPy
    """Return a number, or an array of them, as C reads it: a float to its last bit."""
    if isinstance(value, np.ndarray):
        return "{" + ", ".join(map(number, value)) + "}"
    if isinstance(value, int | np.integer):
        return f"{value}" if abs(int(value)) < np.iinfo(np.int64).max else "INT64_MAX"
    text = repr(float(value))
    return {"inf": "INFINITY", "-inf": "-INFINITY", "nan": "NAN"}.get(text, text)


def record(values: np.void | Records, addresses: dict[str, str] | None = None) -> str:
    """Return the initialiser of a record: its numbers by name, and those addresses that are given; others stay null."""
    one: Any = values[0] if values.shape else values
    names = one.dtype.names or ()
    given = addresses or {}
    fields = [f".{name} = {given[name] if name in given else number(one[name])}" for name in names if _is_told(one, name, given)]
    return "{" + (", ".join(fields) or "0") + "}"


def _is_told(one: Any, name: str, given: dict[str, str]) -> bool:  # noqa: ANN401 - a record
    kind = one.dtype[name].base
    return name in given or (kind.names is None and kind != core.ADDRESS and bool(np.any(one[name] != 0)))


def array(name: str, values: FloatArray | IntArray | Records, kind: str = "") -> str:
    """Return the definition of an array of numbers, or of records of the struct ``kind``; at least of one entry, which C needs."""
    flat: NDArray[Any] = np.ascontiguousarray(values).reshape(-1)
    entries = [record(one) if kind else number(one) for one in flat]
    declared = f"struct {kind}" if kind else _TYPES[flat.dtype.kind]
    return f"const {declared} {name}[{max(len(entries), 1)}] = {{\n{_lines(entries or ['0'])}}};\n"


def _lines(entries: Iterable[str]) -> str:
    """Return entries in lines of some width."""
    lines, line = [], ""
    for entry in entries:
        if line and len(line) + len(entry) > _WIDTH:
            lines.append(line)
            line = ""
        line += f"{entry}, "
    return "".join(f"    {line.rstrip()}\n" for line in [*lines, line])
