"""A planner as C files: for a vehicle's own computer, without Python, without allocation, with a budget."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from hdvplan.settings import Setting, check

_ENDLESS = 2**62


@dataclass(frozen=True)
class Budget:
    """The most that one planning step may do; then it ends with the best motion that it has.

    Raises:
        OptionError: less than a step needs to begin with.

    """

    factorisations: Annotated[int, Setting("Most factorisations of a step.", "N", least=1)] = 120
    linearisations: Annotated[int, Setting("Most linearisations of a step, at the motion; it begins with one.", "N", least=3)] = 24

    def __post_init__(self) -> None:
        """Refuse what no step can keep to."""
        check(self)


UNLIMITED = Budget(_ENDLESS, _ENDLESS)
