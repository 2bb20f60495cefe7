"""Ctrl-C where Python loses the exception."""

import signal

import pytest

from hdvplan.cli.app import interruption_noted


class _Interrupted:
    """Is interrupted while it is destroyed, as compiled libraries are in their callbacks."""

    def __del__(self) -> None:
        signal.raise_signal(signal.SIGINT)


@pytest.mark.skipif(signal.getsignal(signal.SIGINT) is not signal.default_int_handler, reason="SIGINT is ignored here, as behind nohup")
def test_an_interruption_that_python_loses_is_noted_and_not_printed(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[object] = []
    monkeypatch.setattr("sys.unraisablehook", told.append)
    with interruption_noted() as interrupted:
        _Interrupted()
        assert interrupted()
    assert not told
