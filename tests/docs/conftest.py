"""What several tests of the documents share."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="session")
def site(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Build the site; any warning of Sphinx, such as a link that leads nowhere, is an error."""
    pytest.importorskip("sphinx", reason="needs pip install '.[docs]'")
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", str(folder / "trees"), "-c", str(ROOT / "docs" / "site")]
    built = subprocess.run([*command, str(ROOT), str(folder / "html")], capture_output=True, text=True, check=False)  # noqa: S603 - our own
    assert built.returncode == 0, built.stderr
    return folder / "html"
