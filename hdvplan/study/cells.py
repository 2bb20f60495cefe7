"""The cells of a study: every combination of what it names, in a fixed order, each with a key over the content of its inputs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from itertools import product

from hdvplan.planning.settings import PlannerSettings
from hdvplan.road.line import RoadOptions
from hdvplan.road.load import REFERENCE_SLACK
from hdvplan.study.digests import content_digest
from hdvplan.study.inputs import RoadSource, Variant
from hdvplan.study.spec import Manner, Study, Width

FORMAT = 3  # of the key: raise it when the same content gets another key

Row = dict[str, object]  # of a table, by its columns
Smoothed = tuple[RoadSource, float, float, bool]  # what tells one smoothed road from another within a study


@dataclass(frozen=True)
class Cell:
    """One combination, ready to be sent to another process: the road is read there."""

    key: str
    road: RoadSource
    variant: Variant
    width: Width | None
    objective: str
    solver: str
    manner: Manner
    smooth: float
    crs: str | None
    unit: str | None
    corners: str | None
    corner_radius: float | None
    prove: bool
    refine: bool
    need: bool

    @property
    def reading(self) -> RoadOptions:
        """How its road is read: as ``hdvplan plan`` reads it for this vehicle."""
        road, manner = self.road, self.manner
        return RoadOptions(
            smooth=self.smooth,
            crs=self.crs,
            unit=self.unit,
            corners=self.corners,
            corner_radius=self.corner_radius,
            feature=road.feature,
            max_curvature=REFERENCE_SLACK * self.variant.vehicle.max_curvature,
            offset=manner.offset,
            reverse=manner.reverse,
            layer=road.layer,
            roles=road.roles,
            road_ids=road.road_ids,
            lane=road.lane,
        )

    @property
    def smoothed(self) -> Smoothed:
        """What decides the road as it is driven; cells that have it in common can share the work of smoothing."""
        return self.road, self.variant.vehicle.max_curvature, self.manner.offset, self.manner.reverse

    def coordinates(self) -> Row:
        """Return what tells the cell from the others of its study, by columns."""
        width, manner = self.width, self.manner
        return {
            "key": self.key,
            "road": self.road.label,
            "vehicle": self.variant.vehicle.name,
            **dict(self.variant.varied),
            "half_width_m": width.left if width is not None and width.left == width.right else None,
            "left_m": None if width is None else width.left,
            "right_m": None if width is None else width.right,
            "objective": self.objective,
            "scheme": str(manner.settings.scheme),
            "solver": self.solver,
            "offset_m": manner.offset,
            "reverse": manner.reverse,
            "bias": manner.bias,
            "pass": None if manner.side is None else str(manner.side),
            **{f"settings_{name}": _plain(getattr(manner.settings, name)) for name in SETTINGS},
        }


SETTINGS = tuple(field.name for field in fields(PlannerSettings) if field.name != "scheme")


def cells_of(study: Study) -> Iterator[Cell]:
    """Yield the cells of a study, those of one road and vehicle behind each other."""
    for road, variant, width, objective, solver, manner in product(*study.parts):
        reading = study.smooth, study.crs, study.unit, study.corners, study.corner_radius
        cell = Cell("", road, variant, width, objective, solver, manner, *reading, study.prove, study.refine, study.need)
        yield replace(cell, key=_key(cell, study.code[solver, objective]))


def _key(cell: Cell, code: str) -> str:
    """Return a digest of everything that decides a cell's row: contents of files, names, settings and ``code``, a digest of the software.

    The same in every process, and on every machine with the same software.
    """
    width = None if cell.width is None else [cell.width.left, cell.width.right]
    reading = [cell.smooth, cell.crs, cell.unit, cell.corners, cell.corner_radius]
    asked = [FORMAT, width, *reading, cell.prove, cell.refine, cell.need]
    parts = [asked, _road(cell.road), _variant(cell.variant), _manner(cell.manner), code]
    return content_digest(parts)


@lru_cache(maxsize=8)
def _road(road: RoadSource) -> str:
    content = asdict(road)
    del content["source"]  # where a file lies says nothing of what is in it
    return content_digest(content)


@lru_cache(maxsize=4096)
def _variant(variant: Variant) -> str:
    return content_digest(asdict(variant))


@lru_cache(maxsize=4096)
def _manner(manner: Manner) -> str:
    content = asdict(manner)
    if manner.bias_digest is not None:
        del content["bias"]  # as above
    return content_digest(content)


def _plain(value: object) -> object:
    return str(value) if isinstance(value, str) else value
