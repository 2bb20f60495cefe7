"""The cells of a study: every combination of what it names, in a fixed order, each with a key over the content of its inputs."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import asdict, dataclass, fields, replace
from functools import lru_cache
from hashlib import sha256
from itertools import product
from pathlib import Path

from hdvplan.machine import software
from hdvplan.planning.settings import PlannerSettings
from hdvplan.plugins import OBJECTIVE, SOLVER, identity_of, is_reference, version_of
from hdvplan.road.load import REFERENCE_SLACK, RoadOptions
from hdvplan.study.inputs import RoadSource, Variant
from hdvplan.study.spec import Manner, Study, Width

FORMAT = 1  # of the key: raise it when the same content gets another key
_DIGITS = 32  # of a digest in hexadecimal: 128 bits

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
    parts = (study.roads, study.vehicles, study.widths, study.objectives, study.solvers, study.manners)
    for road, variant, width, objective, solver, manner in product(*parts):
        cell = Cell("", road, variant, width, objective, solver, manner, study.smooth, study.crs, study.prove, study.refine, study.need)
        yield replace(cell, key=_key(cell))


def _key(cell: Cell) -> str:
    """Return a digest of everything that decides a cell's row: contents of files, names, settings and software.

    The same in every process, and on every machine with the same software.
    """
    width = None if cell.width is None else [cell.width.left, cell.width.right]
    asked = [FORMAT, width, cell.smooth, cell.crs, cell.prove, cell.refine, cell.need]
    parts = [asked, _road(cell.road), _variant(cell.variant), _manner(cell.manner), _software(cell.solver, cell.objective)]
    return _digest(parts)


@lru_cache(maxsize=8)
def _road(road: RoadSource) -> str:
    content = asdict(road)
    del content["source"]  # where a file lies says nothing of what is in it
    return _digest(content)


@lru_cache(maxsize=4096)
def _variant(variant: Variant) -> str:
    return _digest(asdict(variant))


@lru_cache(maxsize=4096)
def _manner(manner: Manner) -> str:
    file = Path(manner.bias or "")
    return _digest([asdict(manner), sha256(file.read_bytes()).hexdigest() if file.is_file() else None])


@lru_cache(maxsize=64)
def _software(solver: str, objective: str) -> str:
    """Return a digest of hdvplan's source, the libraries' versions, and of what users brought."""
    brought = [[*identity_of(name), version_of(kind, name)] for kind, name in ((SOLVER, solver), (OBJECTIVE, objective))]
    named = tuple(name for name in (solver,) if not is_reference(name))
    return _digest([software(named), brought])


def _digest(content: object) -> str:
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:_DIGITS]


def _plain(value: object) -> object:
    return str(value) if isinstance(value, str) else value
