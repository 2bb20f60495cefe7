"""``hdvplan warm-up``: compile what first plans need, once for all users of an installation."""

from __future__ import annotations

import logging
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING, Annotated

import typer

from hdvplan.cli import completion
from hdvplan.cli.compiling import note_compiling
from hdvplan.cli.console import ExitCode, print_line, progress
from hdvplan.cli.help import VEHICLE
from hdvplan.cli.options import QuietOption
from hdvplan.errors import OptionError, PlanError, RoadError

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from hdvplan.vehicle.model import Vehicle

_ROADS = ("uturn", "sturn", "street_corner", "parked_van")  # with limits, without, with edges, with an obstacle
_TIGHT_M = 1.4  # half width: every vehicle breaks it, and what comes then is compiled too


def warm_up(
    vehicle: Annotated[
        list[str] | None,
        typer.Option(
            "--vehicle",
            metavar="NAME|FILE.toml",
            help="Compile only for vehicles of this kind; may be repeated [default: every kind that ships].",
            autocompletion=completion.vehicles,
            rich_help_panel=VEHICLE,
        ),
    ] = None,
    quiet: QuietOption = False,
) -> int:
    """Compile the code of first plans, for all users.

    The code for every kind of vehicle goes into a cache that other users can read: NUMBA_CACHE_DIR/hdvplan, else ~/.cache/hdvplan. Others
    read it if their NUMBA_CACHE_DIR names the same folder; they need no permission to write there.

    Exit code 2: the code cannot be stored there.
    """
    from hdvplan.vehicle.load import load_vehicle, preset_names

    vehicles = _one_of_each_kind(map(load_vehicle, vehicle or preset_names()))
    from hdvplan.cachefolders import readable_by_all
    from hdvplan.jit import cache_folders

    folders = cache_folders()
    if folders.write is None or folders.note:
        raise OptionError(folders.note, hint="warm-up needs a lasting folder into which no other user can write")
    note_compiling(quiet=quiet)
    with progress("compiling", quiet=quiet) as on_progress, _heard() as warnings:
        for done, driven in enumerate(vehicles):
            on_progress(done / len(vehicles))
            _compile(driven)
    if warnings:
        raise OptionError(warnings[0], hint="make room there, and warm up again")
    readable_by_all(folders.write)
    if not quiet:
        names = ", ".join(driven.name for driven in vehicles)
        print_line(f"compiled for vehicles like {names}; other users read it with NUMBA_CACHE_DIR={folders.write.parent.parent}")
    return ExitCode.OK


def _one_of_each_kind(vehicles: Iterable[Vehicle]) -> list[Vehicle]:
    """Return a vehicle of every kind that has machine code of its own: of as many units and axles that the plan steers."""
    return list({(len(driven.units), len(driven.active)): driven for driven in vehicles}.values())


@contextmanager
def _heard() -> Iterator[list[str]]:
    """Yield what the library logs while the block runs: it plans without a cache, too, and merely says so."""
    said: list[str] = []

    class Heard(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            said.append(record.getMessage())

    library, handler = logging.getLogger("hdvplan"), Heard(logging.WARNING)
    library.addHandler(handler)
    try:
        yield said
    finally:
        library.removeHandler(handler)


def _compile(driven: Vehicle) -> None:
    """Plan, judge and prove once in every way that a first plan may take."""
    from hdvplan import api
    from hdvplan.case import Case
    from hdvplan.road.load import load_road

    for road, half_width in (*((name, None) for name in _ROADS), (_ROADS[0], _TIGHT_M)):
        track = load_road(road)
        with suppress(PlanError, RoadError):  # too long for this road: it has compiled by then
            result = api.plan(Case(track if half_width is None else track.with_limits(half_width, half_width), driven))
            api.prove(result)
