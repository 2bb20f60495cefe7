from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from hdvplan.cli import options
from hdvplan.planning.settings import Scheme
from hdvplan.road.scenarios import SCENARIOS
from hdvplan.vehicle.load import preset_names

COMMAND = "import sys; sys.argv[0] = 'hdvplan'; from hdvplan.cli.entry import main; main()"


def completed(*words: str) -> list[str]:
    """Return what bash is offered for the last of ``words``."""
    asked = {"_HDVPLAN_COMPLETE": "complete_bash", "COMP_WORDS": " ".join(words), "COMP_CWORD": str(len(words) - 1)}
    path = os.pathsep.join(path for path in sys.path if path)
    ended = subprocess.run(  # noqa: S603 - our own
        [sys.executable, "-c", COMMAND], env=os.environ | asked | {"PYTHONPATH": path}, capture_output=True, text=True, check=True
    )
    return ended.stdout.split()


@pytest.mark.slow
def test_the_shell_completes_commands_roads_and_the_last_of_a_list() -> None:
    assert completed("hdvplan", "rep") == ["report", "reproduce"]
    assert completed("hdvplan", "plan", "goteborg_ny") == ["goteborg_nya_allen"]
    assert completed("hdvplan", "bench", "--solvers", "riccati,pi") == ["riccati,piqp"]


@pytest.mark.skipif(sys.platform == "win32", reason="bash")
def test_completion_installs_itself(tmp_path: Path) -> None:
    environment = os.environ | {"HOME": str(tmp_path), "_TYPER_COMPLETE_TEST_DISABLE_SHELL_DETECTION": "1"}
    environment |= {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    arguments = [sys.executable, "-c", COMMAND, "--install-completion", "bash"]
    ended = subprocess.run(arguments, env=environment, capture_output=True, text=True, check=True)  # noqa: S603 - our own
    assert "bash completion installed" in ended.stdout
    assert "hdvplan.sh" in (tmp_path / ".bashrc").read_text(encoding="utf-8")


def test_names_are_those_that_the_commands_know() -> None:
    assert set(options.offered_roads("")) > set(SCENARIOS)
    assert options.offered_roads("monaco") == ["monaco_fairmont_hairpin"]
    assert options.offered_vehicles("") == preset_names()
    assert options.listed(options.offered_vehicles)("bus,tractor-trailer-2") == ["bus,tractor-trailer-24m"]
    assert options.listed(options.offered_roads)("uturn,st") == ["uturn,street_corner", "uturn,sturn"]
    assert "riccati" in options.offered_solvers("")
    assert options.offered_objectives("axle") == ["axle-max"]
    assert options.one_of(list(Scheme))("s") == ["sqp"]
    assert options.offered_roads("nowhere") == []
