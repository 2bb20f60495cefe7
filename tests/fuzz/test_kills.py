"""What the script that kills commands takes for a failure."""

from __future__ import annotations

import random
import signal
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import HealthCheck, given, settings

import hdvplan
from tests.fuzz import strategies
from tests.fuzz.kills import before_us
from tests.fuzz.mutation import mutated
from tests.fuzz.targets import Target, make_targets, tried

OURS = Path(hdvplan.__file__).parent / "cli" / "app.py"


@pytest.mark.parametrize(
    ("code", "file", "expected"),
    [
        (-signal.SIGINT, "/usr/lib/python3.11/typing.py", True),
        (-signal.SIGINT, str(OURS), False),  # it should have said: interrupted
        (1, "/usr/lib/python3.11/typing.py", False),
    ],
)
def test_an_interruption_of_python_s_own_start_is_nobody_s_failure(code: int, file: str, expected: bool) -> None:
    assert before_us(code, f'Traceback (most recent call last):\n  File "{file}", line 1365, in __init__\nKeyboardInterrupt') is expected


_ROADS = {"road.csv": strategies.road_profiles() | strategies.road_tables(), "road.geojson": strategies.road_documents()}
_EXAMPLES = {"road.csv": 20, "road.geojson": 3}  # obstacles are planned past on either side: a minute an example and more
_SHOWN = 5000  # bytes of a file
_FEW = settings(derandomize=True, suppress_health_check=list(HealthCheck))


def planned(road: str, name: str, vehicle: str) -> None:
    """Assert that a road and a vehicle are planned: exit code 0, or 1 with the place where limits are broken or no plan exists."""
    with TemporaryDirectory() as folder:
        file = Path(folder) / name
        file.write_text("", encoding="utf-8")
        (Path(folder) / "truck.toml").write_text(vehicle, encoding="utf-8")
        target = Target(name, file, ("plan", name, "--vehicle", "truck.toml", "--no-plot", "--no-proof", "--quiet", "--out", "out"))
        outcome = tried(target, road.encode())
    assert outcome.fault == ""
    assert outcome.code in {0, 1}, outcome.error


@pytest.mark.slow
@pytest.mark.parametrize("name", _ROADS)
def test_a_road_that_is_valid_is_planned(name: str) -> None:
    given_both = given(_ROADS[name], strategies.vehicle_files())
    settings(_FEW, max_examples=_EXAMPLES[name])(given_both(lambda road, vehicle: planned(road, name, vehicle)))()


@pytest.mark.slow
def test_damaged_files_are_answered_or_refused_in_a_line() -> None:
    with TemporaryDirectory() as folder:
        targets = make_targets(Path(folder))
        for seed in range(500, 600):  # each by itself, as some files hold times and so are never the same
            rng = random.Random(seed)  # noqa: S311 - no secret
            target = rng.choice(targets)
            outcome = tried(target, content := mutated(target.path.read_bytes(), rng))
            assert outcome.fault == "", f"{outcome.error}\nseed {seed}, {target.name}: {content[:_SHOWN]!r}\n{outcome.trace}"
