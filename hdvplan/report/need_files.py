"""Write the answer of ``hdvplan need``. Each file appears whole or not at all, and ``need.json`` comes last."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from hdvplan.fileio import Together, json_bytes
from hdvplan.judging.result import Result
from hdvplan.need.answer import Need
from hdvplan.need.widening import Widening
from hdvplan.record import NAME, record_of
from hdvplan.report.files import DRAWINGS, PICTURES
from hdvplan.report.need_layers import need_features, shown_plan
from hdvplan.report.needs import Json, need_lines, widening_geojson

SUMMARY = "need.json"
WIDENINGS = {"area": "widening.geojson", "depth": "widening_least_depth.geojson"}


def write_need(need: Need, answer: Json, directory: Path, kinds: Sequence[str] = ("png",)) -> None:
    """Write ``answer``, that of ``need_json``, with widenings as polygons into ``directory``, made if need be.

    ``kinds`` are those of ``PICTURES`` and ``DRAWINGS`` that are drawn as well; where no plan was found there is nothing to draw.

    Raises:
        OptionError: the folder holds files of others.
        OSError: the folder or a file cannot be written.

    """
    contents: dict[str, Callable[[], bytes]] = {NAME: lambda: json_bytes(record_of([need.case]))}
    for kind, name in WIDENINGS.items():
        widening = None if need.widenings is None else getattr(need.widenings, kind)
        if widening is not None:
            contents[name] = partial(_widening, need, widening)
    shown = shown_plan(need) if kinds else None
    if shown is not None:
        contents |= {f"need.{kind}": partial(_drawn, need, shown[0], kind) for kind in kinds}
    contents[SUMMARY] = lambda: json_bytes(answer)
    names = (*(f"need.{kind}" for kind in (*PICTURES, *DRAWINGS)), *WIDENINGS.values())
    Together(SUMMARY, names, {NAME: "software", SUMMARY: "tolerance_m"}).write(directory, contents)


def _widening(need: Need, widening: Widening) -> bytes:
    return json_bytes(widening_geojson(need, widening), indent=None)


def _drawn(need: Need, shown: Result, kind: str) -> bytes:
    """Return the file of one of ``PICTURES`` or ``DRAWINGS``; what they need takes half a second to import."""
    if kind in PICTURES:
        from hdvplan.report.need_plots import need_figure  # noqa: PLC0415 - as above
        from hdvplan.report.style import figure_bytes  # noqa: PLC0415 - as above

        return figure_bytes(need_figure(need), kind)
    if kind == "gpkg":
        from hdvplan.report.geopackage import geopackage_bytes  # noqa: PLC0415 - as above

        return geopackage_bytes(shown, need_features(need, shown))
    from hdvplan.report.dxf import dxf_bytes  # noqa: PLC0415 - as above

    return dxf_bytes(shown, need_features(need, shown), need_lines(need))
