"""Every study by the name that users give it, the quick ones first."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from hdvplan.reproduce.bus_uturn import bus_uturn
from hdvplan.reproduce.objectives import objectives
from hdvplan.reproduce.overhang import overhang
from hdvplan.reproduce.roundabout import roundabout
from hdvplan.reproduce.s_turns import s_turns
from hdvplan.reproduce.study import Progress, Study
from hdvplan.reproduce.timing import timing

STUDIES: Mapping[str, Callable[[Progress], Study]] = MappingProxyType(
    {"bus-uturn": bus_uturn, "roundabout": roundabout, "overhang": overhang, "objectives": objectives, "s-turns": s_turns, "timing": timing}
)
