"""Write the answer of ``hdvplan need``. Each file appears whole or not at all, and ``need.json`` comes last."""

from __future__ import annotations

from pathlib import Path

from hdvplan.fileio import json_bytes, write_atomically
from hdvplan.need.answer import Need
from hdvplan.record import NAME, record_of
from hdvplan.report.needs import Json, widening_geojson

SUMMARY = "need.json"
PICTURE = "need.png"
WIDENINGS = {"area": "widening.geojson", "depth": "widening_least_depth.geojson"}


def write_need(need: Need, answer: Json, directory: Path, *, plot: bool) -> None:
    """Write ``answer``, that of ``need_json``, with widenings as polygons and a picture into ``directory``, made if need be.

    Raises:
        OSError: the folder or a file cannot be written.

    """
    directory.mkdir(parents=True, exist_ok=True)
    for former in (SUMMARY, PICTURE, *WIDENINGS.values()):
        (directory / former).unlink(missing_ok=True)
    write_atomically(directory / NAME, json_bytes(record_of([need.case])))
    for kind, name in WIDENINGS.items():
        widening = None if need.widenings is None else getattr(need.widenings, kind)
        if widening is not None:
            write_atomically(directory / name, json_bytes(widening_geojson(need, widening), indent=None))
    if plot and answer["s_m"] is not None:
        from hdvplan.report.need_plots import need_figure  # noqa: PLC0415 - Matplotlib takes half a second to import
        from hdvplan.report.style import figure_bytes  # noqa: PLC0415 - as above

        write_atomically(directory / PICTURE, figure_bytes(need_figure(need, need.case.road.own_limits), "png"))
    write_atomically(directory / SUMMARY, json_bytes(answer))
