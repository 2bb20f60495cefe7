"""Studies: every combination of roads, vehicles and settings planned and judged, in parallel, resumably, ending in a ranking on a map.

From Python::

    results = hdvplan.study.run("lines.toml", "out")     # or with engine=hdvplan.study.LocalEngine(workers=8)
    results.cells()                                      # one row a cell, as in cells.parquet

Names load when they are first used: mistakes in a study's file are reported before its tables and engines are loaded.
"""

from importlib import import_module
from typing import TYPE_CHECKING

from hdvplan.errors import OptionError

if TYPE_CHECKING:
    from hdvplan.study.conduct import Results, run
    from hdvplan.study.engine import Engine
    from hdvplan.study.pools import DaskEngine, LocalEngine, connected
    from hdvplan.study.spec import Study, read_study, study_of

__all__ = ["DaskEngine", "Engine", "LocalEngine", "Results", "Study", "connected", "read_study", "run", "study_of"]

if not TYPE_CHECKING:  # else a type checker would believe in any name

    def __dir__() -> list[str]:
        """Tell the public names before they are loaded."""
        return __all__

    def __getattr__(name: str) -> object:
        """Load a name when it is first asked for (PEP 562)."""
        if name not in __all__:
            msg = f"module 'hdvplan.study' has no attribute {name!r}"
            raise AttributeError(msg)
        homes = {"Engine": "engine", "Results": "conduct", "run": "conduct", "Study": "spec", "read_study": "spec", "study_of": "spec"}
        try:
            home = import_module(f"hdvplan.study.{homes.get(name, 'pools')}")
        except ModuleNotFoundError as error:
            if error.name not in {"pebble", "pyarrow"}:  # those of the extra
                raise
            msg = f"a study needs {error.name}, which is not installed"
            raise OptionError(msg, hint="pip install pebble pyarrow") from error
        return getattr(home, name)
