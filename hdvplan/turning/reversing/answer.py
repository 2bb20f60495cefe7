"""A manoeuvre in its site: the one that needs the least room or the fewest legs, driven and judged."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from hdvplan.arrays import FloatArray
from hdvplan.errors import TurnError
from hdvplan.progress import part_of
from hdvplan.turning.follow import passive
from hdvplan.turning.reversing.legs import Draft, DrivenLeg, driven, wheels_at_stop
from hdvplan.turning.reversing.options import SiteOptions, Template
from hdvplan.turning.reversing.polish import polished
from hdvplan.turning.reversing.search import half_turn, half_turns_in, pull_out
from hdvplan.turning.reversing.sites import Block, Site, site_of
from hdvplan.vehicle.kinematics import corners_at
from hdvplan.vehicle.model import Vehicle

STEP_M = 0.05  # to which a size is told, rounded up
POSE_M = 0.05  # between the poses that are judged
_RUN_M = 5.0  # straight before a half turn's first and behind its last arc
_ROUNDING_M = 1e-6
_LEGS = {Template.THREE_POINT: (1, 3, 5), Template.HAMMERHEAD: (3, 5), Template.SIDE_HEAD: (3, 5)}
_OWN_LEGS = 3  # of a half turn that nobody asked to be shorter


@dataclass(frozen=True)
class Tried:
    """What ``starts`` searches for a manoeuvre of so many ``legs`` found: sizes of those that found one, rising [m], and the best.

    ``draft`` is what the best search found, and ``manoeuvre`` how it is driven or, where so ``polished``, what a program made of it.
    """

    legs: int
    starts: int
    sizes: tuple[float, ...]
    manoeuvre: Manoeuvre
    draft: Draft
    polished: bool = False


@dataclass(frozen=True)
class Manoeuvre:
    """A driven manoeuvre: ``reaches`` are how far the ends of its site must be away, one for each; ``size`` is what it needs [m]."""

    vehicle: Vehicle
    site: Site
    legs: tuple[DrivenLeg, ...]
    reaches: FloatArray
    size: float

    @property
    def rounded(self) -> float:
        """The size that it needs, rounded up to what is told [m]."""
        return float(np.ceil((self.size - _ROUNDING_M) / STEP_M)) * STEP_M

    def room(self, walls: tuple[Block, ...] = ()) -> FloatArray:
        """Return every leg's signed room to each block of the site, and to ``walls`` at its ends, shape (legs, blocks) [m].

        No pose in between has less: what bodies bow out there is taken off.
        """
        found = []
        for leg in self.legs:
            gaps = [self.site.gaps(self.vehicle, leg.poses)] if self.site.blocks else []
            gaps += [self.site.gaps_to_ends(self.vehicle, leg.poses, walls)] if walls else []
            found.append(np.concatenate(gaps).min(axis=(1, 2)) - bow(self.vehicle, leg))
        return np.array(found)

    @property
    def lacking(self) -> float:
        """How much room to the blocks of the site is lacking [m]."""
        return max(0.0, self.site.clearance - float(self.room().min())) if self.site.blocks else 0.0

    @property
    def over_kerbs(self) -> float:
        """How far bodies reach over the blocks of the site [m]."""
        bodies = replace(self.site, overhang=0.0)
        return max(0.0, -min((float(bodies.gaps(self.vehicle, leg.poses).min()) for leg in self.legs if self.site.blocks), default=0.0))


@dataclass(frozen=True)
class Answer:
    """Whether a vehicle turns round, or docks, in a site: ``chosen`` of what was tried; ``given`` is the size asked about [m]."""

    template: Template
    vehicle: Vehicle
    options: SiteOptions
    tried: tuple[Tried, ...]
    chosen: Tried

    @property
    def given(self) -> float | None:
        """The size that was asked about, None where the least is sought [m]."""
        return self.options.size(self.template)

    @property
    def size(self) -> float:
        """The size of the site that is drawn and judged: the given one where the manoeuvre fits, else what it needs, rounded up [m]."""
        needed = self.chosen.manoeuvre.rounded
        return needed if self.given is None or not self.fits else self.given

    @property
    def fits(self) -> bool | None:
        """Whether the manoeuvre fits in the given site; None where no size was given."""
        return None if self.given is None else self.chosen.manoeuvre.size <= self.given + _ROUNDING_M

    @property
    def walls(self) -> tuple[Block, ...]:
        """The walls at the ends of the site that is drawn and judged."""
        return self.chosen.manoeuvre.site.closed(self.chosen.manoeuvre.reaches, self.size)

    @property
    def arms(self) -> tuple[float, ...]:
        """How far the tips of that head lie from the road's axis, left and right; none of other sites [m]."""
        return tuple(float(np.hypot(*tip.tips[0])) for tip in self.walls) if self.template is Template.HAMMERHEAD else ()

    @property
    def size_of_equal_arms(self) -> float:
        """The length of a head with equal arms in which the manoeuvre fits, rounded up [m]."""
        return replace(self.chosen.manoeuvre, size=2.0 * float(self.chosen.manoeuvre.reaches.max())).rounded

    @property
    def blocks(self) -> tuple[Block, ...]:
        """All blocks of that site, the walls at its ends last."""
        return (*self.chosen.manoeuvre.site.blocks, *self.walls)

    @property
    def room(self) -> FloatArray:
        """Every leg's signed room to each of ``blocks``, shape (legs, blocks) [m]."""
        return self.chosen.manoeuvre.room(self.walls)


def bow(vehicle: Vehicle, leg: DrivenLeg) -> float:
    """Return by how much bodies may reach further between two poses of a leg than at both [m]: h^2 / 8 times a corner's acceleration.

    That is measured along pieces of constant steering, where it is smooth, from three poses each.
    """
    h = np.diff(leg.s)
    speed = np.diff(corners_at(vehicle, leg.poses), axis=0) / h[:, None, None, None]
    smooth = np.diff(leg.kappa) == 0.0
    if not np.any(smooth):
        return 0.0
    change = np.diff(speed, axis=0)[smooth] / (0.5 * (h[1:] + h[:-1]))[smooth, None, None, None]
    return float(np.hypot(change[..., 0], change[..., 1]).max() * h.max() ** 2 / 8.0)


def reversing(
    vehicle: Vehicle,
    template: Template,
    options: SiteOptions,
    *,
    starts: int,
    all_legs: bool = False,
    polish: bool = True,
    on_progress: Callable[[float], None] | None = None,
) -> Answer:
    """Return the manoeuvre of ``template`` with the fewest legs that fits in the given size or, where none is given, its least size.

    Half turns have three legs unless one or five are needed; ``all_legs`` tries all of these, and names the best of three. Every search is
    made from ``starts`` starts, always the same ones; a dock needs none. With ``polish`` a program begins with the best, and its answer
    is taken where it is better. ``on_progress`` receives the share of the searches that are done.

    Raises:
        TurnError: the vehicle has more trailers than the manoeuvre is made for.
        OptionError: the options describe no site for it.

    """
    vehicle = passive(vehicle)
    _check_trailers(vehicle, template)
    site, size = site_of(template, options, vehicle), options.size(template)

    def finish(tried: Tried) -> Tried:
        return _polished(site, vehicle, tried) if polish else tried

    if template.docks:
        docked = finish(_docked(site, vehicle))
        return Answer(template, vehicle, options, (docked,), docked)
    tried: list[Tried] = []
    errors: list[TurnError] = []
    numbers = _LEGS[template] if size is not None or all_legs else (_OWN_LEGS,)
    taken = np.cumsum([0, *(legs**2 for legs in numbers)])  # about, by those before
    for number, legs in enumerate(numbers):
        part = part_of(on_progress, *(taken[number : number + 2] / taken[-1]).tolist())
        try:
            tried.append(finish(_half_turned(site, vehicle, legs, starts, part)))
        except TurnError as error:  # another number of legs may do
            errors.append(error)
            continue
        if size is not None and tried[-1].manoeuvre.size <= size + _ROUNDING_M and not all_legs:
            return Answer(template, vehicle, options, tuple(tried), tried[-1])
    if not tried:
        raise errors[0]
    least = min(tried, key=lambda one: one.manoeuvre.size)
    own = least if size is not None else next((one for one in tried if one.legs == _OWN_LEGS), least)
    return Answer(template, vehicle, options, tuple(tried), own)


def _check_trailers(vehicle: Vehicle, template: Template) -> None:
    most = 2 if template.docks else 1
    if len(vehicle.units) > most:
        made = "a vehicle with at most one trailer" if template.docks else "a vehicle without trailers"
        msg = f"{template} is made for {made}; the {vehicle.name} has {len(vehicle.units) - 1}"
        raise TurnError(msg, hint=None if template.docks else "dock-90 and dock-45 take one trailer")


def _half_turned(site: Site, vehicle: Vehicle, legs: int, starts: int, on_progress: Callable[[float], None] | None) -> Tried:
    """Return the best half turn of so many legs that keeps off all blocks between its poses, too.

    Raises:
        TurnError: none does.

    """
    found, errors = half_turns_in(site, vehicle, legs, starts, on_progress), list[TurnError]()
    for one in found:
        draft = half_turn(site.template, vehicle, legs).draft(one.parameters, wheels_at_stop(vehicle))
        try:
            manoeuvre = _judged(site, vehicle, _turned(vehicle, draft))
        except TurnError as error:
            errors.append(error)
            continue
        sizes = tuple(other.size for other in found if other.kept and other.size >= one.size) or (one.size,)
        return Tried(legs, starts, sizes, manoeuvre, draft)
    raise errors[0]


def _polished(site: Site, vehicle: Vehicle, tried: Tried) -> Tried:
    """Return what a program made of what was tried, where that is better."""
    last = tried.manoeuvre.legs[-1]
    out = last.reversed() if site.template.docks else last
    end = np.concatenate([[out.lead[-1, 2]], np.zeros(len(vehicle.units) - 1)])
    legs_of = _docking if site.template.docks else _turned

    def made(draft: Draft) -> Manoeuvre:
        return _manoeuvre(site, vehicle, legs_of(vehicle, draft))

    draft = polished(site, vehicle, tried.draft, end, np.abs(out.beta).max(axis=0), lambda one: made(one).lacking)
    if draft is None:
        return tried
    manoeuvre = made(draft)
    return replace(tried, manoeuvre=manoeuvre, polished=True) if manoeuvre.size < tried.manoeuvre.size else tried


def _turned(vehicle: Vehicle, draft: Draft) -> tuple[DrivenLeg, ...]:
    """Return the legs of a half turn, with straights before it and behind it."""
    here, found, legs = draft.start, list[DrivenLeg](), 1 + int(draft.leg[-1])
    for leg in range(legs):
        pieces = draft.pieces(leg)
        if leg == 0:
            here = here - np.array([_RUN_M * np.cos(here[2]), _RUN_M * np.sin(here[2]), 0.0])
            pieces.insert(0, (_RUN_M, 0.0))
        if leg == legs - 1:
            pieces.append((_RUN_M, 0.0))
        found.append(driven(vehicle, here, pieces, POSE_M, backward=leg % 2 == 1))
        here = found[-1].lead[-1]
    return tuple(found)


def _docked(site: Site, vehicle: Vehicle) -> Tried:
    draft = pull_out(vehicle, site, POSE_M)
    manoeuvre = _judged(site, vehicle, _docking(vehicle, draft))
    return Tried(len(manoeuvre.legs), 1, (manoeuvre.size,), manoeuvre, draft)


def _docking(vehicle: Vehicle, draft: Draft) -> tuple[DrivenLeg, ...]:
    """Return the drive past a dock, and back onto it: a pull-out in reverse."""
    out = driven(vehicle, draft.start, draft.pieces(0), POSE_M)
    cusp, run = out.lead[-1], vehicle.reach_ahead + vehicle.reach_behind
    before = cusp - np.array([run * np.cos(cusp[2]), run * np.sin(cusp[2]), 0.0])
    return driven(vehicle, before, [(run, 0.0)], POSE_M), out.reversed()


def _judged(site: Site, vehicle: Vehicle, legs: tuple[DrivenLeg, ...]) -> Manoeuvre:
    """Return a manoeuvre that keeps off all blocks.

    Raises:
        TurnError: it enters one.

    """
    manoeuvre = _manoeuvre(site, vehicle, legs)
    if manoeuvre.lacking > 0.0:
        name, short = site.blocks[int(np.argmin(manoeuvre.room().min(axis=0)))].name, f"{manoeuvre.lacking:.2f} m are lacking"
        msg = f"no way was found for the {vehicle.name} past the {name}, whatever the {site.template.words}: {short}"
        raise TurnError(msg, hint=f"give a larger {' or '.join(site.template.others)}, or less --clearance")
    return manoeuvre


def _manoeuvre(site: Site, vehicle: Vehicle, legs: tuple[DrivenLeg, ...]) -> Manoeuvre:
    """Return a manoeuvre with what it needs; what bows out between poses is added."""
    bowed = max(bow(vehicle, leg) for leg in legs)
    reaches = np.concatenate([site.reaches(vehicle, leg.poses) for leg in legs]).max(axis=0) + bowed
    return Manoeuvre(vehicle, site, legs, reaches, site.base + float(reaches.sum()))
