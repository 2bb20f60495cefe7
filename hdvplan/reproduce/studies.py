"""Every study by the name that users give it, the quick ones first."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from hdvplan.reproduce.bus_uturn import bus_uturn
from hdvplan.reproduce.objectives import objectives
from hdvplan.reproduce.overhang import overhang
from hdvplan.reproduce.planned_turn import planned_turn
from hdvplan.reproduce.roundabout import roundabout
from hdvplan.reproduce.s_turns import s_turns
from hdvplan.reproduce.standards import standards
from hdvplan.reproduce.study import Progress, Study
from hdvplan.reproduce.timing import timing
from hdvplan.reproduce.turn_accuracy import turn_accuracy

STUDIES: Mapping[str, Callable[[Progress], Study]] = MappingProxyType(
    {
        "bus-uturn": bus_uturn,
        "roundabout": roundabout,
        "overhang": overhang,
        "standards": standards,
        "turn-accuracy": turn_accuracy,
        "planned-turn": planned_turn,
        "objectives": objectives,
        "s-turns": s_turns,
        "timing": timing,
    }
)
