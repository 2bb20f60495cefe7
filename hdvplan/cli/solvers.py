"""``hdvplan solvers``: every QP back end, installed or not, and what it supports."""

from __future__ import annotations

from hdvplan.cli.console import ExitCode, print_json, print_tables
from hdvplan.cli.options import JsonOption

_CAPTION = "n: native workspace; w: starts warm; i: detects infeasibility; ?: not known before it is loaded; version -: not installed"


def solvers(json: JsonOption = False) -> int:
    """List every QP solver and what it supports."""
    from dataclasses import asdict

    from hdvplan.report.grid import grid
    from hdvplan.solvers.registry import DEFAULT, solver_infos

    infos = solver_infos()
    if json:
        print_json([asdict(info) | {"default": info.name == DEFAULT} for info in infos])
        return ExitCode.OK
    rows = [
        (
            f"{info.name} (default)" if info.name == DEFAULT else info.name,
            info.version or "-",
            " ".join(
                "?" if supported is None else letter if supported else "-"
                for letter, supported in (("n", info.native), ("w", info.warm_start), ("i", info.detects_infeasible))
            ),
            info.note,
        )
        for info in infos
    ]
    columns = ("solver", "version", "can", "method")
    print_tables(grid("QP solvers", columns, rows, text=columns, caption=_CAPTION))
    return ExitCode.OK
