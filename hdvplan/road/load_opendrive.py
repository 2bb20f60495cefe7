"""Read a road from OpenDRIVE."""

from __future__ import annotations

from pathlib import Path

from hdvplan.errors import RoadError
from hdvplan.road.raw import RawRoad


def read_opendrive(path: Path, *, road_ids: str | None, lane: int | None) -> RawRoad:
    """Refuse the file.

    Raises:
        RoadError: always.

    """
    msg = f"{path.name}: OpenDRIVE cannot be read (road ids {road_ids}, lane {lane})"
    raise RoadError(msg)
