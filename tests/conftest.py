"""What holds for all tests."""

from __future__ import annotations

import gc
import math
import os
import sys
from collections.abc import Iterator

import pytest
from hypothesis import settings

from hdvplan.cli import console

# The tests start many processes: each would translate all modules again. Workers of pytest-xdist have it from here, too.
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
sys.dont_write_bytecode = False

# Random examples: with every change a sample of those of ``.ci/nightly``.
settings.register_profile("changes", max_examples=25, deadline=None)
settings.register_profile("nightly", max_examples=150, deadline=None)
settings.load_profile("nightly" if os.environ.get("HDVPLAN_NIGHTLY") else "changes")


def pytest_collection_finish() -> None:
    """Let Python pass over what is there by now whenever it looks for garbage: libraries and tests, which stay to the end."""
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session", autouse=True)
def _what_is_passed_over_stays_so() -> Iterator[None]:
    """Keep benchmarks in this process, which look for garbage before every drive, from letting Python look at all of it again."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(gc, "unfreeze", lambda: None)
        yield


@pytest.fixture(scope="session", autouse=True)
def _no_line_of_progress() -> Iterator[None]:
    """Keep commands quiet on a machine so busy that they take long: tests hold what stderr says."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(console, "_TELL_S", math.inf)
        yield
