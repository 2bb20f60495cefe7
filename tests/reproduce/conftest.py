"""Studies that several tests look at, each run once."""

from __future__ import annotations

import pytest

from hdvplan.reproduce.bus import bus_uturn
from hdvplan.reproduce.roundabout import roundabout
from hdvplan.reproduce.study import Row, Study


def by_name(study: Study) -> dict[str, Row]:
    """Return the rows of a study by their quantities."""
    rows = {row.quantity: row for row in study.rows}
    assert len(rows) == len(study.rows)
    return rows


def silent(_share: float) -> None:
    """Take no notice of progress."""


@pytest.fixture(scope="session")
def uturn_study() -> Study:
    return bus_uturn(silent)


@pytest.fixture(scope="session")
def roundabout_study() -> Study:
    return roundabout(silent)
