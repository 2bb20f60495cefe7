"""A manoeuvre driven, measured and compared with the limits of a standard."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.turning.figures import Figures, figures_of
from hdvplan.turning.follow import Followed, follow
from hdvplan.turning.manoeuvre import Manoeuvre
from hdvplan.turning.templates import Limit, Template
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
