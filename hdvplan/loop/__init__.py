"""A path in a closed loop: followed by a driver or a controller that sees late and inexactly, and judged by what was driven.

How it is followed is here: light, as the command line reads it for its options.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from hdvplan.settings import POSITIVE, Setting, check

_ERRORS = (-1.0, 0.0, 1.0)  # of the gain, in shares of its error
KM_H = 3.6  # in a metre a second


@dataclass(frozen=True)
class LoopSettings:
    """How late, how inexactly and how fast a path is followed. The defaults are those of a bus with people standing in it.

    Raises:
        OptionError: a value outside its range.

    """

    delay: Annotated[float, Setting("From what is seen to what the wheels do [s] [default: 0.3].", "S", least=0.0)] = 0.3
    gain_error: Annotated[
        float,
        Setting(
            "Share by which the wheels turn too little in a third of the runs, and too much in another [default: 0.1].", "X", least=0.0
        ),
    ] = 0.1
    noise: Annotated[
        float,
        Setting(
            "Times 0.05 m in the offset as seen, 0.3 degrees in heading and wheels: standard deviations, of slow noise [default: 1].",
            "X",
            least=0.0,
        ),
    ] = 1.0
    speed: Annotated[float, Setting("Speed on straights; bends are taken at 1 m/s2 sideways [km/h] [default: 30].", "KM/H", above=0.0)] = (
        30.0
    )
    sideways: Annotated[float, POSITIVE] = 1.0  #: most lateral acceleration [m/s2]
    runs: Annotated[int, Setting("Runs with each of the three gains [default: 4].", "N", least=1)] = 4
    seed: Annotated[int, Setting("Of the noise: another one drives other runs [default: 0].", "N", least=0.0)] = 0

    def __post_init__(self) -> None:
        """Refuse what nobody can drive."""
        check(self)

    @property
    def gains(self) -> tuple[float, ...]:
        """The wheels' angle over the one that is wanted, of every run; more runs come behind these."""
        return tuple(1.0 + self.gain_error * error for error in _ERRORS) * self.runs
