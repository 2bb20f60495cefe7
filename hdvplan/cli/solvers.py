"""``hdvplan solvers``: every QP back end, installed or not, and what it supports."""

from __future__ import annotations

from hdvplan.cli.console import ExitCode, print_json, print_tables
from hdvplan.cli.options import JsonOption


def solvers(json: JsonOption = False) -> int:
    """List every QP solver and what it supports."""
    from dataclasses import asdict

    from hdvplan.report.tables import grid
    from hdvplan.solvers.registry import DEFAULT, solver_infos

    infos = solver_infos()
    if json:
        print_json([asdict(info) | {"default": info.name == DEFAULT} for info in infos])
        return ExitCode.OK
    rows = [
        (
            f"{info.name} (default)" if info.name == DEFAULT else info.name,
            info.version or "not installed",
            _yes(info.native),
            _yes(info.warm_start),
            _yes(info.detects_infeasible),
            info.note,
        )
        for info in infos
    ]
    columns = ("solver", "version", "native", "warm\nstart", "infeasible", "note")
    print_tables(grid("QP solvers", columns, rows, text=columns))
    return ExitCode.OK


def _yes(flag: bool) -> str:
    return "yes" if flag else "no"
