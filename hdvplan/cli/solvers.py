"""``hdvplan solvers``: every QP back end, installed or not, and what it supports; the test of their contract."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli.console import ExitCode, note, print_json, print_line, print_tables, progress
from hdvplan.cli.options import JsonOption, offered_solvers

if TYPE_CHECKING:
    from hdvplan.bench.contract import Finding

_CAPTION = (
    "n: has a workspace in hdvplan, updated in place; w: starts warm; i: detects infeasibility; ?: not known before it is loaded; "
    "version -: not installed"
)


def solvers(
    check: Annotated[
        str | None,
        typer.Option(
            "--check",
            metavar="NAME",
            help="Test this solver against the contract of all solvers; your own: package.module:Class, file.py:Class.",
            autocompletion=offered_solvers,
        ),
    ] = None,
    json: JsonOption = False,
) -> int:
    """List the solvers of quadratic programs (QPs), or test one.

    Exit code of --check: 0 the solver keeps all rules; 1 it breaks one; 2 it cannot be used.
    """
    from dataclasses import asdict

    from hdvplan.report.grid import grid
    from hdvplan.solvers.registry import DEFAULT, solver_infos

    if check is not None:
        return _check(check, json=json)
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


def _check(name: str, *, json: bool) -> int:
    from dataclasses import asdict

    from hdvplan.qp.program import StageShape
    from hdvplan.solvers.registry import solver_named

    make = solver_named(name)
    make(StageShape(stages=2, states=2, inputs=1, rows=2))  # a class that cannot be made is no broken rule
    from hdvplan.bench.contract import CONTRACT, checked, samples

    programs = samples()
    note(f"{len(CONTRACT)} rules, on {len(programs)} programs each; each rule is printed when it is done", quiet=json)
    said: list[str] = []
    with progress("checking", quiet=json, part=lambda: f"rule {len(said) + 1} of {len(CONTRACT)}") as on_progress:
        findings = checked(make, None if json else lambda finding: _print_finding(finding, said), on_progress)
    if json:
        print_json([asdict(finding) for finding in findings])
    if all(finding.kept for finding in findings):
        return ExitCode.OK
    note(
        "every plan is judged exactly, whatever its solver; what a broken rule means: docs/extending.md, 'Benchmark it'",
        quiet=json,
    )
    return ExitCode.BROKEN


def _print_finding(finding: Finding, said: list[str]) -> None:
    """Print what was found: once, as one exception often breaks most rules."""
    told = f"the same as of rule {said.index(finding.said) + 1}" if finding.said in said else finding.said
    print_line(f"{'ok  ' if finding.kept else 'FAIL'} {len(said) + 1}. {finding.rule}: {told}")
    said.append(finding.said)
