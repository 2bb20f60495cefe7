"""What the shell offers after TAB. Names come from the same functions as in the commands; the shell completes files itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

Offer = Callable[[str], list[str]]  # returns the names that begin so


def roads(incomplete: str) -> list[str]:
    """Return the shipped roads, examples and scenarios that begin so."""
    from hdvplan.road.scenarios import SCENARIOS, shipped_roads

    return _beginning(incomplete, [*shipped_roads(), *SCENARIOS])


def vehicles(incomplete: str) -> list[str]:
    """Return the preset vehicles that begin so."""
    from hdvplan.vehicle.load import preset_names

    return _beginning(incomplete, preset_names())


def templates(incomplete: str) -> list[str]:
    """Return the shipped templates of manoeuvres that begin so."""
    from hdvplan.turning.reversing.options import Template
    from hdvplan.turning.templates import template_names

    return _beginning(incomplete, [*template_names(), *Template])


def solvers(incomplete: str) -> list[str]:
    """Return the installed solvers that begin so."""
    from hdvplan.solvers.registry import solver_infos

    return _beginning(incomplete, [info.name for info in solver_infos() if info.version is not None])


def objectives(incomplete: str) -> list[str]:
    """Return the objectives that begin so."""
    from hdvplan.planning.objective_names import objective_names

    return _beginning(incomplete, objective_names())


def listed(offer: Offer) -> Offer:
    """Return what completes the last of several names with commas between them."""

    def offered(incomplete: str) -> list[str]:
        given, comma, last = incomplete.rpartition(",")
        return [given + comma + name for name in offer(last)]

    return offered


def one_of(names: Sequence[str]) -> Offer:
    """Return what offers those of fixed names that begin so."""

    def offered(incomplete: str) -> list[str]:
        return _beginning(incomplete, names)

    return offered


def _beginning(incomplete: str, names: Sequence[str]) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
