"""Write the answer of ``hdvplan need``. Each file appears whole or not at all, and ``need.json`` comes last."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

from hdvplan.fileio import Together, json_bytes
from hdvplan.need.answer import Need
from hdvplan.need.widening import Widening
from hdvplan.record import NAME, record_of
from hdvplan.report.needs import Json, widening_geojson

SUMMARY = "need.json"
PICTURE = "need.png"
WIDENINGS = {"area": "widening.geojson", "depth": "widening_least_depth.geojson"}


def write_need(need: Need, answer: Json, directory: Path, *, plot: bool) -> None:
    """Write ``answer``, that of ``need_json``, with widenings as polygons and a picture into ``directory``, made if need be.

    Raises:
        OptionError: the folder holds files of others.
        OSError: the folder or a file cannot be written.

    """
    contents: dict[str, Callable[[], bytes]] = {NAME: lambda: json_bytes(record_of([need.case]))}
    for kind, name in WIDENINGS.items():
        widening = None if need.widenings is None else getattr(need.widenings, kind)
        if widening is not None:
            contents[name] = partial(_widening, need, widening)
    if plot and answer["s_m"] is not None:
        contents[PICTURE] = partial(_picture, need)
    contents[SUMMARY] = lambda: json_bytes(answer)
    Together(SUMMARY, (PICTURE, *WIDENINGS.values()), {NAME: "software", SUMMARY: "tolerance_m"}).write(directory, contents)


def _widening(need: Need, widening: Widening) -> bytes:
    return json_bytes(widening_geojson(need, widening), indent=None)


def _picture(need: Need) -> bytes:
    from hdvplan.report.need_plots import need_figure  # noqa: PLC0415 - Matplotlib takes half a second to import
    from hdvplan.report.style import figure_bytes  # noqa: PLC0415 - as above

    return figure_bytes(need_figure(need, need.case.road.own_limits), "png")
