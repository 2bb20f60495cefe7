"""What the tests of every change are a sample of."""

from __future__ import annotations

import pytest
from _pytest.mark.structures import ParameterSet


def nightly(*values: object) -> ParameterSet:
    """Return values of parameters with which a test runs in ``.ci/nightly`` alone."""
    return pytest.param(*values, marks=pytest.mark.nightly)
