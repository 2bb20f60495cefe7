"""The GitHub action, whose scripts run here as GitHub would run them; ``gh`` and ``python`` are stand-ins that keep a diary."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ACTION = pytest.importorskip("yaml").safe_load((ROOT / "action.yml").read_text(encoding="utf-8"))
STEPS = {step.get("name", step.get("uses")): step for step in ACTION["runs"]["steps"]}
_VALUE = re.compile(r"\$\{\{ *([\w.-]+) *\}\}")
pytestmark = pytest.mark.skipif(shutil.which("bash") is None or sys.platform == "win32", reason="the action's scripts are bash")

# Makes an environment whose pip and hdvplan say what they were asked.
PYTHON = """#!/bin/sh
if [ "$1" = --version ]; then echo "Python 3.12.1"; exit 0; fi
mkdir -p "$3/bin"
for name in pip hdvplan; do
  printf '#!/bin/sh\\necho "%s: $*" >> "$DIARY"\\nexit "${CODE_OF_HDVPLAN:-0}"\\n' "$name" > "$3/bin/$name"; chmod +x "$3/bin/$name"
done
"""
# Knows one comment once it was posted, and one of a user that looks like ours.
GH = """#!/bin/sh
echo "gh: $*" >> "$DIARY"
case "$*" in
  *FORBIDDEN*) exit 1 ;;
  *POST*) echo 77 > "$DIARY.posted" ;;
  *--paginate*) cat "$DIARY.posted" 2>/dev/null || true ;;
esac
"""


@dataclass(frozen=True)
class Runner:
    """A folder that stands for a runner of GitHub."""

    folder: Path

    def run(self, step: str, values: Mapping[str, str], **variables: str) -> tuple[int, str]:
        """Run a step's script with the values of its expressions; return its exit code and what was asked of others."""
        env = {name: _VALUE.sub(lambda match: values[match[1]], str(value)) for name, value in STEPS[step].get("env", {}).items()}
        diary = self.folder / "diary"
        diary.write_text("", encoding="utf-8")
        own = {"HOME": str(self.folder / "home"), "RUNNER_TEMP": str(self.folder), "GITHUB_OUTPUT": str(self.folder / "output")}
        paths = {"PATH": os.pathsep.join([str(self.folder / "bin"), os.environ["PATH"]]), "DIARY": str(diary)}
        script = ["bash", "--noprofile", "--norc", "-eo", "pipefail", "-c", STEPS[step]["run"]]
        ended = subprocess.run(script, cwd=self.folder, env=os.environ | own | paths | env | variables, check=False)  # noqa: S603 - ours
        return ended.returncode, diary.read_text(encoding="utf-8")


@pytest.fixture
def runner(tmp_path: Path) -> Runner:
    for name, text in (("python", PYTHON), ("gh", GH)):
        file = tmp_path / "bin" / name
        file.parent.mkdir(exist_ok=True)
        file.write_text(text, encoding="utf-8")
        file.chmod(0o755)
    (tmp_path / "source").mkdir()
    (tmp_path / "source" / "pyproject.toml").write_text("one", encoding="utf-8")
    return Runner(tmp_path)


def values(runner: Runner, **inputs: str) -> dict[str, str]:
    usual = {name: str(entry.get("default", "")) for name, entry in ACTION["inputs"].items()}
    return {f"inputs.{name}": value for name, value in (usual | inputs).items()} | {
        "github.action_path": str(runner.folder / "source"), "github.token": "t", "github.repository": "them/theirs",
        "github.event.pull_request.number": "5", "steps.gate.outputs.code": inputs.get("code", "0"),
        "github.job": "planning", "strategy.job-index": "0",
    }  # fmt: skip


def test_no_input_is_written_into_a_script_and_the_comment_is_of_pull_requests_alone() -> None:
    assert not any("${{" in step.get("run", "") for step in STEPS.values())
    assert STEPS["comment"]["if"] == "inputs.comment == 'true' && github.event_name == 'pull_request'"


def test_the_jobs_of_a_matrix_leave_artifacts_of_their_own() -> None:
    """GitHub refuses a second artifact of one name in a run, and names with a slash."""
    (name,) = (step["with"]["name"] for step in ACTION["runs"]["steps"] if step.get("uses", "").startswith("actions/upload-artifact"))
    assert {"${{ github.job }}", "${{ strategy.job-index }}"} <= set(re.findall(r"\$\{\{ [\w.-]+ \}\}", name))
    assert "inputs." not in name


def test_hdvplan_is_installed_once_and_again_when_the_action_is_another_one(runner: Runner) -> None:
    assert runner.run("install", values(runner)) == (0, f"pip: install --quiet --disable-pip-version-check {runner.folder}/source\n")
    assert runner.run("install", values(runner)) == (0, "")
    (runner.folder / "source" / "pyproject.toml").write_text("two", encoding="utf-8")
    assert "pip: install" in runner.run("install", values(runner))[1]


@pytest.mark.parametrize(("ends", "code"), [("0", 0), ("1", 1), ("2", 2), ("3", 0)])
def test_the_gate_is_run_with_the_inputs_as_words_and_its_verdict_is_that_of_the_job(runner: Runner, ends: str, code: int) -> None:
    runner.run("install", values(runner))
    asked = values(runner, command="python -m ours $(touch owned) '`id`'", options="\n--factor 1.2\n  --patience 60\n")
    words = "--against HEAD^1 --format github --out gate --command python -m ours $(touch owned) '`id`' --factor 1.2 --patience 60"
    assert runner.run("measure", asked, CODE_OF_HDVPLAN=ends) == (0, f"hdvplan: bench {words}\n")
    assert (runner.folder / "output").read_text(encoding="utf-8") == f"code={ends}\n"
    assert not (runner.folder / "owned").exists()
    assert runner.run("verdict", values(runner, code=ends))[0] == code
    assert runner.run("verdict", values(runner, code=ends, options="--patience 60\n--strict"))[0] == int(ends)


def test_a_comment_is_posted_once_then_replaced_and_a_fork_that_may_not_is_no_error(runner: Runner) -> None:
    assert runner.run("comment", values(runner))[1] == ""  # nothing was measured
    (runner.folder / "gate").mkdir()
    (runner.folder / "gate" / "summary.md").write_text("**fine**\n", encoding="utf-8")
    posted = runner.run("comment", values(runner))[1].splitlines()[-1]
    assert posted == f"gh: api --silent -X POST repos/them/theirs/issues/5/comments -F body=@{runner.folder}/comment.md"
    assert (runner.folder / "comment.md").read_text(encoding="utf-8") == "<!-- hdvplan timing gate, job planning 0 -->\n**fine**\n"
    replaced = runner.run("comment", values(runner))[1].splitlines()[-1]
    assert replaced == f"gh: api --silent -X PATCH repos/them/theirs/issues/comments/77 -F body=@{runner.folder}/comment.md"
    fork = values(runner) | {"github.repository": "FORBIDDEN"}
    assert runner.run("comment", fork)[0] == 0
