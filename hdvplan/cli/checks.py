"""What commands that plan refuse, or warn of, before they plan."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

from hdvplan.cli.console import note, progress, warn
from hdvplan.errors import OptionError, RoadError

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from hdvplan.planning.bias import Bias
    from hdvplan.planning.settings import PlanOptions
    from hdvplan.road.line import Line
    from hdvplan.road.load import Found
    from hdvplan.road.path import ReferencePath
    from hdvplan.road.regions import Region
    from hdvplan.road.road import Road
    from hdvplan.vehicle.model import Vehicle


def vehicle_named(source: str, *, quiet: bool) -> Vehicle:
    """Return a preset or the vehicle of a file, and say what is assumed where the file does not tell how far it turns."""
    from hdvplan.vehicle.load import read_vehicle

    vehicle, remark = read_vehicle(source)
    if remark is not None:
        note(remark, quiet=quiet)
    return vehicle


def names_in(source: str) -> list[str]:
    """Return the names with commas between them, or the one of a file whose name may have some."""
    return [source] if Path(source).is_file() else [name.strip() for name in source.split(",")]


def vehicles_named(source: str, *, quiet: bool) -> list[Vehicle]:
    """Return the vehicles of the names in an option; an ``OptionError`` where two have one name."""
    vehicles = [vehicle_named(name, quiet=quiet) for name in names_in(source)]
    names = [vehicle.name for vehicle in vehicles]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        msg = f"the vehicle {twice} is given twice"
        raise OptionError(msg, hint="vehicles of one command have different names")
    return vehicles


def number_of(option: str, value: str, what: str) -> float:
    """Return the number in an option that takes a word, too, as ``what`` says; an ``OptionError`` where it holds neither."""
    try:
        return float(value)
    except ValueError:
        msg = f"--{option} must be a number of {what}, not {value!r}"
        raise OptionError(msg) from None


def smoothed(
    found: Found, name: str, reaches: tuple[float, float] | None = None, *, told: Sequence[str] | None = None, quiet: bool
) -> Road:
    """Return the road that was found, between limits that options gave [m]; say what was noted, and which regions do not count.

    Where the same road was smoothed for another vehicle before, the notes that were ``told`` then, and the regions, are not said again.
    """
    with progress(f"smoothing {name}", quiet=quiet):
        road = found()
    for remark in road.notes:
        note(remark, quiet=quiet or remark in (told or ()))
    warn_far_regions(road.regions, [road.path], quiet=quiet or told is not None)
    return road if reaches is None else road.with_limits(*reaches)


def check_fits(vehicle: Vehicle, reaches: tuple[float, float] | None, road: Road | None = None) -> None:
    """Refuse what makes planning ``vehicle`` pointless; ``reaches`` are the limits left and right that options gave [m].

    Raises:
        RoadError: the ``road`` is shorter than the vehicle.
        OptionError: the options leave less room than the vehicle is wide.

    """
    length = vehicle.reach_ahead + vehicle.reach_behind
    if road is not None and road.path.length < length:
        msg = f"the road is {road.path.length:.1f} m long, the {vehicle.name} {length:.1f} m"
        raise RoadError(msg, hint="plan along a longer part of the road")
    if reaches is not None and sum(reaches) < vehicle.width:
        msg = f"limits are {sum(reaches):.2f} m apart; the {vehicle.name} is {vehicle.width:.2f} m wide"
        raise OptionError(msg, hint="widen them with --half-width or --left and --right")


def check_bias(bias: Bias, given: str) -> None:
    """Refuse, by an ``OptionError``, a bias that leads off any road: nothing could be seen there."""
    from hdvplan.road.regions import OPEN_M

    largest = float(abs(bias.offset).max())
    if largest > OPEN_M:
        msg = f"--bias {given} leads {largest:g} m off the road's centre; at most {OPEN_M:g} m can be asked for"
        raise OptionError(msg)


def refuse_on(line: Line, asked: Mapping[str, bool]) -> None:
    """Refuse, by an ``OptionError``, options that a drive of several legs, or one of pieces along a long road, does not have."""
    from hdvplan.road.line import LONG_M

    name = next((name for name, given in asked.items() if given), None)
    if name is not None and line.raw.legs:
        msg = f"{name} is not for a drive of several legs, as {line.name} is"
        raise OptionError(msg, hint="plan without that, or choose one line of the file with --name")
    if name is not None:
        msg = f"{name} is not for roads of more than {1e-3 * LONG_M:.0f} km; {line.name} has {1e-3 * line.length:.0f} km"
        raise OptionError(msg, hint="cut the road, and plan the part")


def warn_far_regions(regions: tuple[Region, ...], paths: Sequence[ReferencePath], *, quiet: bool) -> None:
    """Say which regions do not count along a road, or its legs: wrong coordinates would go unnoticed."""
    import numpy as np

    from hdvplan.road.regions import OPEN_M, distances

    apart = np.min([distances(path, regions) for path in paths], axis=0)
    far = apart[apart > OPEN_M]
    if len(far):
        nearest = f"the nearest of them {far.min():.0f} m"
        warn(f"{len(far)} of {len(apart)} regions lie further than {OPEN_M:.0f} m from the road and do not count, {nearest}", quiet=quiet)


def meeting_of(options: PlanOptions) -> tuple[float, float] | None:
    """Return where two vehicles meet [m], None: wherever the other one drives, or nobody; an ``OptionError`` where it is no stretch."""
    if options.meeting is None:
        return None
    if options.beside is None:
        msg = "--meeting needs --beside DIR: whom to meet"
        raise OptionError(msg)
    with suppress(ValueError):
        s_from, s_to = (float(place) for place in options.meeting.split(":"))
        if s_from < s_to:
            return s_from, s_to
    msg = f"--meeting is two places of the road in metres, the first one before the other, such as 20:60, not {options.meeting!r}"
    raise OptionError(msg)
