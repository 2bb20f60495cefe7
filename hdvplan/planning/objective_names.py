"""The public names of objectives. A wrong name is refused here, before planning is loaded."""

from __future__ import annotations

from hdvplan import plugins
from hdvplan.errors import OptionError
from hdvplan.planning.settings import OBJECTIVE_NAMES, WEIGHTED


def check_objective(name: str) -> None:
    """Refuse what ``objective_named`` would; of what is not the user's own nothing is loaded.

    Raises:
        OptionError: there is none of that name, it cannot be loaded, or the weight is not a number from 0 to 1.

    """
    if share_of(name) is None and name not in OBJECTIVE_NAMES and plugins.load(plugins.OBJECTIVE, name) is None:
        raise plugins.unknown(plugins.OBJECTIVE, name, objective_names())


def objective_names() -> list[str]:
    """Return all objectives that have a name: ours, and those that installed packages offer."""
    return list(dict.fromkeys([*OBJECTIVE_NAMES, *plugins.offers(plugins.OBJECTIVE)]))


def share_of(name: str) -> float | None:
    """Return the weight that a name like ``art-weighted:0.45`` gives as a number, None where it gives none.

    Raises:
        OptionError: it is not a number from 0 to 1.

    """
    known, _, text = name.partition(":")
    if known != WEIGHTED or not text:
        return None
    try:
        share = float(text)
    except ValueError:
        share = float("nan")
    if not 0.0 <= share <= 1.0:
        msg = f"the weight of {WEIGHTED!r} must be a number from 0 to 1, not {share:g}"
        raise OptionError(msg)
    return share
