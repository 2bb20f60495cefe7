"""What the shell offers after TAB. Names come from the same functions as in the commands; the shell completes files itself."""

from __future__ import annotations

from collections.abc import Callable, Sequence

Offer = Callable[[str], list[str]]  # returns the names that begin so


def _offering(names: Callable[[], Sequence[str]]) -> Offer:
    return lambda incomplete: [name for name in names() if name.startswith(incomplete)]


@_offering
def roads() -> list[str]:
    """Return the shipped roads, examples and scenarios."""
    from hdvplan.road.scenarios import SCENARIOS, shipped_roads

    return [*shipped_roads(), *SCENARIOS]


@_offering
def vehicles() -> list[str]:
    """Return the preset vehicles."""
    from hdvplan.vehicle.load import preset_names

    return preset_names()


@_offering
def templates() -> list[str]:
    """Return the shipped templates of manoeuvres."""
    from hdvplan.turning.reversing.options import Template
    from hdvplan.turning.turn import template_names

    return [*template_names(), *Template]


@_offering
def solvers() -> list[str]:
    """Return the installed solvers."""
    from hdvplan.solvers.registry import solver_infos

    return [info.name for info in solver_infos() if info.version is not None]


@_offering
def objectives() -> list[str]:
    """Return the objectives."""
    from hdvplan.planning.settings import objective_names

    return objective_names()


def listed(offer: Offer) -> Offer:
    """Return what completes the last of several names with commas between them."""

    def offered(incomplete: str) -> list[str]:
        given, comma, last = incomplete.rpartition(",")
        return [given + comma + name for name in offer(last)]

    return offered


def one_of(names: Sequence[str]) -> Offer:
    """Return what offers those of fixed names that begin so."""
    return _offering(lambda: names)
