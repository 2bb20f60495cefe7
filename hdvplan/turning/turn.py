"""A manoeuvre driven, measured and compared with the limits of a standard."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from hdvplan.answers import NEEDS, room_text, word_of, worded
from hdvplan.turning.follow import Followed, follow
from hdvplan.turning.manoeuvre import Manoeuvre
from hdvplan.turning.swept import Figures, figures_of
from hdvplan.turning.templates import Limit, Template, figure
from hdvplan.vehicle.model import Vehicle


@dataclass(frozen=True)
class Turn:
    """A driven manoeuvre with its figures; ``template`` is the standard that it follows, if it does."""

    driven: Followed
    figures: Figures
    template: Template | None

    @property
    def limits(self) -> tuple[Limit, ...]:
        """What the standard demands."""
        return () if self.template is None else self.template.limits

    @property
    def circles(self) -> tuple[Limit, ...]:
        """The demands that are circles about the arc's centre."""
        return tuple(limit for limit in self.limits if limit.name.endswith("radius"))

    @property
    def complies(self) -> bool | None:
        """Whether all demands are met; None where there are none."""
        return all(limit.kept(self.figures) for limit in self.limits) if self.limits else None


def turn(vehicle: Vehicle, manoeuvre: Manoeuvre | Template) -> Turn:
    """Drive ``vehicle`` through a manoeuvre, or a standard's, and measure it.

    Raises:
        TurnError: the vehicle cannot drive it, or reaches around the centre of a full circle.
        OptionError: the standard's ramps are too long for the vehicle's radius.

    """
    template = manoeuvre if isinstance(manoeuvre, Template) else None
    driven = follow(vehicle, manoeuvre.manoeuvre(vehicle) if isinstance(manoeuvre, Template) else manoeuvre)
    return Turn(driven, figures_of(driven), template)


def verdict(turn: Turn) -> str:
    """Return one line: whether the vehicle complies, or what width the turn needs."""
    name, words = turn.driven.vehicle.name, manoeuvre_words(turn)
    if turn.template is None or not turn.limits:
        return worded(NEEDS, f"{turn.figures.swept_width:.2f} m of width: {name}, {words}")
    demands = "; ".join(_demand_words(limit, turn) for limit in turn.limits)
    complies = "complies" if turn.complies else "does not comply"
    return worded(word_of(turn.complies), f"{name} {complies} with {turn.template.name}: {demands}")


def broken_words(limit: Limit, turn: Turn) -> str:
    """Return which demand is not met, and by how much."""
    found, which = figure(limit.name, turn.figures), "below" if limit.least else "above"
    off = f"{-limit.spare(turn.figures):.3f} m {which} {limit.value:.3f} m"
    return f"the {limit.words} of the {turn.driven.vehicle.name} is {found:.3f} m, {off}"


def manoeuvre_words(turn: Turn) -> str:
    """Return angle, guided point, radius and ramps of a turn."""
    manoeuvre = turn.driven.manoeuvre
    angle = "full circle" if manoeuvre.angle is None else f"{np.rad2deg(manoeuvre.angle):g} degrees"
    ramp = f", ramps of {manoeuvre.ramp:g} m" if manoeuvre.ramp > 0.0 else ""
    return f"{angle}, {manoeuvre.point.words} on a radius of {manoeuvre.radius:.2f} m{ramp}"


def _demand_words(limit: Limit, turn: Turn) -> str:
    spare = limit.spare(turn.figures)
    over = f"{-spare:.3f} m {'short' if limit.least else 'too much'}"
    kept = room_text(spare, fits=True, digits=3) if limit.kept(turn.figures) else over
    return f"{limit.words} {figure(limit.name, turn.figures):.3f} m ({'at least' if limit.least else 'at most'} {limit.value:.2f}), {kept}"
