"""The roads that travel with hdvplan: real centre lines from OpenStreetMap."""

from __future__ import annotations

from pathlib import Path

NOTICE = "© OpenStreetMap contributors, ODbL 1.0"
_PACKAGE = Path(__file__).parents[1]


def road_directory() -> Path:
    """Return the folder of the shipped roads: inside an installed package, else the checkout's ``roads/osm``."""
    installed = _PACKAGE / "_roads" / "osm"
    return installed if installed.is_dir() else _PACKAGE.parent / "roads" / "osm"


def road_names() -> list[str]:
    """Return the names of the shipped roads, sorted."""
    return sorted(path.stem for path in road_directory().glob("*.geojson"))


def road_file(name: str) -> Path | None:
    """Return the file of a shipped road, or None if there is no road of that name."""
    return road_directory() / f"{name}.geojson" if name in road_names() else None
