"""Write a driven manoeuvre. Each file appears whole or not at all, and ``turn.json`` comes last."""

from __future__ import annotations

from collections.abc import Callable, Collection
from functools import partial
from pathlib import Path

from hdvplan.fileio import Together, csv_bytes, json_bytes
from hdvplan.report.files import PICTURES
from hdvplan.report.style import figure_bytes
from hdvplan.report.turn_plots import turn_figure
from hdvplan.report.turns import poses_table, turn_geojson, turn_json, width_table
from hdvplan.turning.turn import Turn

TURN_DRAWINGS = ("dxf",)  # for CAD; it lies nowhere on a map


def write_turn(turn: Turn, directory: Path, *, kinds: Collection[str] = ()) -> None:
    """Write ``turn.json``, ``poses.csv``, ``width.csv``, ``turn.geojson`` and what is drawn into ``directory``.

    ``kinds`` are those of ``PICTURES`` and ``TURN_DRAWINGS`` that are drawn.

    Raises:
        OptionError: the folder holds files of others.
        OSError: the folder or a file cannot be written.

    """
    contents: dict[str, Callable[[], bytes]] = {
        "poses.csv": lambda: csv_bytes(poses_table(turn.driven)),
        "width.csv": lambda: csv_bytes(width_table(turn)),
        "turn.geojson": lambda: json_bytes(turn_geojson(turn), indent=None),
    }
    contents |= {f"turn.{kind}": partial(_drawn, turn, kind) for kind in kinds}
    contents["turn.json"] = lambda: json_bytes(turn_json(turn))
    names = tuple(f"turn.{kind}" for kind in (*PICTURES, *TURN_DRAWINGS))
    Together("turn.json", names, {"turn.json": "swept_width_m"}).write(directory, contents)


def _drawn(turn: Turn, kind: str) -> bytes:
    if kind == "dxf":
        from hdvplan.report.turn_layers import turn_dxf  # noqa: PLC0415 - ezdxf takes half a second to import

        return turn_dxf(turn)
    return figure_bytes(turn_figure(turn), kind)
