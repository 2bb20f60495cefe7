"""The command line in a folder of the test's own."""

from __future__ import annotations

from tests.cli.conftest import Cli, cli

__all__ = ["Cli", "cli"]
