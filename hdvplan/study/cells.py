"""The cells of a study: every combination of what it names, in a fixed order, each with a key over the content of its inputs.

And the columns of its tables: names, kinds, and where in ``summary.json`` and ``need.json`` their values come from.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from itertools import product

from hdvplan.case import content_digest, settings_json
from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.options import RoadOptions
from hdvplan.study.inputs import RoadSource, Variant
from hdvplan.study.spec import Setup, Study, Width

Row = dict[str, object]  # of a table, by its columns
Smoothed = tuple[RoadSource, RoadOptions]  # what tells one smoothed road from another
SETTINGS = tuple(field.name for field in fields(PlannerSettings) if field.name not in {"scheme", "give_way_on"})  # of which studies vary

TIGHTEST, BREACH, DEAD_END, WIDENING = "tightest", "breach", "no plan", "widening"  # where on a road something decides
TEXT, NUMBER, COUNT, TRUTH, SHAPE = "text", "number", "count", "truth", "shape"
PARALLEL = "parallel_"  # begins the names of what was measured beside other work: no benchmark, and never twice the same


@dataclass(frozen=True)
class Cell:
    """One combination, ready to be sent to another process: the road is read there, as ``hdvplan plan`` reads it for this vehicle."""

    key: str
    road: RoadSource
    variant: Variant
    width: Width | None
    objective: str
    solver: str
    setup: Setup
    reading: RoadOptions
    prove: bool
    refine: bool
    need: bool

    @property
    def smoothed(self) -> Smoothed:
        """What decides the road as it is driven; cells that have it in common can share the work of smoothing."""
        return self.road, self.reading

    def coordinates(self) -> Row:
        """Return what tells the cell from the others of its study, by columns."""
        width, setup = self.width, self.setup
        return {
            "key": self.key,
            "road": self.road.label,
            "vehicle": self.variant.vehicle.name,
            **dict(self.variant.varied),
            "half_width_m": width.left if width is not None and width.left == width.right else None,
            "left_m": None if width is None else width.left,
            "right_m": None if width is None else width.right,
            "objective": self.objective,
            "scheme": str(setup.settings.scheme),
            "solver": self.solver,
            "offset_m": setup.offset,
            "reverse": setup.reverse,
            "bias": setup.bias,
            "pass": None if setup.side is None else str(setup.side),
            **{f"settings_{name}": value for name, value in settings_json(setup.settings).items() if name in SETTINGS},
            **({"settings_clearance": None} if setup.clearest else {}),  # what was found to be kept is in the answer
        }


def cells_of(study: Study) -> Iterator[Cell]:
    """Yield the cells of a study, those of one road and vehicle behind each other."""
    for road, variant, width, objective, solver, setup in product(*study.parts):
        reading = replace(
            study.reading.followed_by(variant.vehicle.max_curvature),
            feature=road.feature,
            layer=road.layer,
            roles=road.roles,
            road_ids=road.road_ids,
            lane=road.lane,
            unit=road.unit or study.reading.unit,
            offset=setup.offset,
            reverse=setup.reverse,
        )
        cell = Cell("", road, variant, width, objective, solver, setup, reading, study.prove, study.refine, study.need)
        yield replace(cell, key=_key(cell, study.code[solver, objective]))


def _key(cell: Cell, code: str) -> str:
    """Return a digest of everything that decides a cell's row: contents of files, names, settings and ``code``, a digest of the software.

    The same in every process, and on every machine with the same software.
    """
    width = None if cell.width is None else [cell.width.left, cell.width.right]
    parts = [_digest(part) for part in (cell.road, cell.variant, cell.setup, cell.reading)]
    return content_digest([*parts, width, cell.prove, cell.refine, cell.need, code])


@lru_cache(maxsize=4096)
def _digest(part: RoadSource | Variant | Setup | RoadOptions) -> str:
    content = asdict(part)
    content.pop("source", None)  # where a file lies says nothing of what is in it
    if content.get("bias_digest") is not None:
        del content["bias"]  # as above
    return content_digest(content)


@dataclass(frozen=True)
class Column:
    """One column; ``path`` leads to its value in a summary, "a.b" being b in a."""

    name: str
    kind: str
    path: str = ""


def _columns(kind: str, names: str, *, before: str = "", within: str = "") -> tuple[Column, ...]:
    """Return columns of a kind, called ``before`` and the name of the entry, which lies ``within`` another one."""
    return tuple(Column(before + name, kind, within + name) for name in names.split())


_KINDS = {str: TEXT, bool: TRUTH, int: COUNT, float: NUMBER}

COORDINATES = (  # before the parameters that vary, which stand behind the vehicle
    *_columns(TEXT, "key road vehicle"),
    *_columns(NUMBER, "half_width_m left_m right_m"),
    *_columns(TEXT, "objective scheme solver"),
    *_columns(NUMBER, "offset_m"),
    *_columns(TRUTH, "reverse"),
    *_columns(TEXT, "bias pass"),
)
CONDITIONS = tuple(
    Column(f"settings_{field.name}", next(kind for like, kind in _KINDS.items() if isinstance(field.default, like)))
    for field in fields(PlannerSettings)
    if field.name in SETTINGS
)
ENDING = _columns(TEXT, "outcome reason case")
SUMMARY = (
    Column("verdict", TEXT, "verdict.text"),
    Column("verdict_details", TEXT, "verdict.details"),
    *_columns(TEXT, "word", within="verdict."),
    *_columns(TRUTH, "fits", within="verdict."),
    *_columns(NUMBER, "spare_m s_m x y lon lat", within="verdict."),
    *_columns(TEXT, "side unit part region obstacle", within="verdict."),
    *_columns(NUMBER, "wheels_spare_m", within="verdict."),
    Column("verdict_half_width_m", NUMBER, "verdict.half_width_m"),
    *_columns(TRUTH, "proved", within="verdict."),
    *_columns(TEXT, "kind unit", before="proof_", within="verdict.proof."),
    *_columns(NUMBER, "s_from_m s_to_m", before="proof_", within="verdict.proof."),
    *_columns(TEXT, "status"),
    *_columns(NUMBER, "clearance_wanted_m tracking_error_m tracking_length_m tracking_s_m"),
    *_columns(TEXT, "tracking_unit tracking_part"),
    *_columns(NUMBER, "length_m mean_bias_m"),
    Column("plans", COUNT, "plans"),
    *_columns(NUMBER, "max_left_m max_right_m imbalance_m mean_abs_imbalance_m mean_abs_off_bias_m expected_half_width_m"),
    Column("tighter_than_balanced_circle", TRUTH, "tighter_than_balanced_circle"),
    *_columns(NUMBER, "needed_half_width_m min_clearance_m limit_violation_m"),
    *_columns(COUNT, "corners breaches obstacles failed_steps rescued_steps attempts"),
    Column("crossed_sides", COUNT, "passed.crossed"),
    *_columns(NUMBER, "share s_m", before="manners_steering_", within="manners.steering."),
    *_columns(NUMBER, "share s_m", before="manners_steering_rate_", within="manners.steering_rate."),
    *_columns(NUMBER, "prediction_error_m sqp_iterations_mean"),
    *_columns(COUNT, "sqp_iterations_max converged_plans steps_halved"),
    *_columns(NUMBER, "merit_mean merit_max"),
    *_columns(COUNT, "points duplicates", before="smoothing_", within="smoothing."),
    *_columns(
        NUMBER,
        "max_deviation_m max_deviation_s_m rms_deviation_m max_curvature_per_m max_curvature_s_m",
        before="smoothing_",
        within="smoothing.",
    ),
    Column("step_m", NUMBER, "settings.step"),
    Column("stretches", COUNT, "stretches.count"),
    *_columns(TEXT, "plane notice version notes"),
)
STEPS = _columns(NUMBER, "mean p50 p95 p99 max first", before=f"{PARALLEL}step_ms_", within="time_ms.")
NEED = (
    Column("need_text", TEXT, "text"),
    *_columns(NUMBER, "half_width_m tolerance_m proved_below_m out_of_reach_m s_m x y lon lat", before="need_"),
    *_columns(TEXT, "side unit part objective scheme", before="need_"),
    Column("need_plans", COUNT, "plans"),
    Column("need_fits", TRUTH, "fits"),
    Column("need_widening_m2", NUMBER, "widening_m2"),
    *(
        Column(f"need_{kind}_{name}", TRUTH if name == "fits_then" else NUMBER, f"widening.{kind}.{name}")
        for kind in ("least_area", "least_depth")
        for name in ("area_m2", "depth_m", "fits_then")
    ),
)
NEED_TIME = Column(f"{PARALLEL}need_s", NUMBER, "time_s")
SPENT = (*_columns(COUNT, "attempts", before=PARALLEL), *_columns(NUMBER, "cpu_s wall_s", before=PARALLEL))
GEOMETRY = Column("geometry", SHAPE)

_PLACE = (
    Column("kind", TEXT),
    *_columns(NUMBER, "s_m s_from_m s_to_m x y lon lat depth_m spare_m area_m2"),
    *_columns(TEXT, "side unit part region obstacle"),
    GEOMETRY,
)


def cell_columns(varied: tuple[str, ...]) -> tuple[Column, ...]:
    """Return the columns of ``cells.parquet`` for a study in which the parameters ``varied`` vary."""
    return (*_coordinates(varied), *ENDING, *SUMMARY, *NEED, *CONDITIONS, *SPENT, *STEPS, NEED_TIME, GEOMETRY)


def place_columns(varied: tuple[str, ...]) -> tuple[Column, ...]:
    """Return the columns of ``places.parquet``, likewise."""
    return (*_coordinates(varied), *_PLACE)


def _coordinates(varied: tuple[str, ...]) -> tuple[Column, ...]:
    behind = next(number for number, column in enumerate(COORDINATES, start=1) if column.name == "vehicle")
    return (*COORDINATES[:behind], *(Column(name, NUMBER) for name in varied), *COORDINATES[behind:])


def taken(summary: Mapping[str, object], columns: tuple[Column, ...]) -> Row:
    """Return the values of columns of a summary; a list counts as its length, or entries that are true, or is several lines."""
    row: Row = {}
    for column in columns:
        value: object = summary
        for name in column.path.split("."):
            value = (
                [one for one in value if one[name]] if isinstance(value, list) else value.get(name) if isinstance(value, Mapping) else None
            )
        if isinstance(value, list):
            value = len(value) if column.kind == COUNT else "\n".join(map(str, value))
        row[column.name] = float(value) if column.kind == NUMBER and isinstance(value, int | float) else value
    return row
