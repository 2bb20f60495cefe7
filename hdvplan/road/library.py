"""The roads that travel with hdvplan: real centre lines from OpenStreetMap, and small made-up places."""

from __future__ import annotations

from pathlib import Path

NOTICE = "© OpenStreetMap contributors, ODbL 1.0"
_PACKAGE = Path(__file__).parents[1]


def road_directory(kind: str = "osm") -> Path:
    """Return the folder of the shipped roads: inside an installed package, else the checkout's ``roads/osm``."""
    installed = _PACKAGE / "_roads" / kind
    return installed if installed.is_dir() else _PACKAGE.parent / "roads" / kind


def road_names() -> list[str]:
    """Return the names of the shipped roads, sorted."""
    return sorted(path.stem for path in road_directory().glob("*.geojson"))


def road_file(name: str) -> Path | None:
    """Return the file of a shipped road, or None if there is no road of that name."""
    return road_directory() / f"{name}.geojson" if name in road_names() else None


def map_file(name: str) -> Path | None:
    """Return the file of a shipped map, or None if there is none of that name."""
    return road_directory("networks") / f"{name}.osm.pbf" if name in map_names() else None


def map_names() -> list[str]:
    """Return the names of the shipped maps, sorted."""
    return sorted(path.name.removesuffix(".osm.pbf") for path in road_directory("networks").glob("*.osm.pbf"))


def example_names() -> list[str]:
    """Return the names of the made-up places with obstacles and kerbs, sorted."""
    return sorted(path.stem for path in road_directory("examples").glob("*.geojson"))


def example_file(name: str) -> Path | None:
    """Return the file of a made-up place, or None if there is none of that name."""
    return road_directory("examples") / f"{name}.geojson" if name in example_names() else None
