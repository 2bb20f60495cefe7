"""What the script that kills commands takes for a failure."""

from __future__ import annotations

import signal
from pathlib import Path

import pytest

import hdvplan
from tests.fuzz.kills import before_us

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
