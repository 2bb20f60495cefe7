"""Where something began: made-up revisions and comparisons, and a small repository from end to end."""

from __future__ import annotations

import json
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from hdvplan.bench.bisect import Symptom, clearest_symptom, most_trials, origin_of, shows
from hdvplan.bench.checkout import checkout
from hdvplan.bench.compare import CellTimes, Comparison, failed
from hdvplan.bench.counters import Change
from hdvplan.bench.gate import Decision, Rule, Verdict
from hdvplan.bench.origin import origin_words
from hdvplan.bench.revisions import CHANGES, Revision, is_changed, revision_of, revisions_since
from hdvplan.bench.statistics import Found, statistics
from hdvplan.errors import OptionError
from tests.bench.conftest import Cli

CELL = ("bend", "bus", "rti", "riccati", "as set")
FINE, RED, UNCLEAR = Verdict.FINE, Verdict.REGRESSED, Verdict.UNMEASURABLE


def compared(
    verdict: Verdict, ratio: float = 1.3, detectable: float = 1.1, typical: Verdict = FINE, changes: tuple[Change, ...] = ()
) -> Comparison:
    """Return a comparison of one cell and one statistic."""
    cell = CellTimes(CELL, Decision(verdict, 10, 1e-3, ratio * 1e-3, ratio, ratio, ratio, 1.02), 0.001, detectable)
    one = next(one for one in statistics(Rule()) if one.name == "typical")
    found = Found(one, 1.0, 1.5 if typical is RED else 1.0, 1.5 if typical is RED else 1.0, 10, 0.001, 1.2, typical)
    return Comparison(changes, (cell,), RED if RED in {verdict, typical} or changes else verdict, 10, (found,))


def revisions(count: int) -> list[Revision]:
    return [Revision(f"{number:040x}", f"change {number}") for number in range(count)]


@pytest.mark.parametrize("count", [1, 2, 3, 7, 20, 100])
def test_halving_finds_every_first_bad_revision_in_a_logarithm_of_steps(count: int) -> None:
    every = revisions(count)
    for first in range(count):
        asked: list[Revision] = []

        def measure(revision: Revision, first: int = first, asked: list[Revision] = asked) -> Comparison:
            asked.append(revision)
            return compared(RED if every.index(revision) >= first else FINE, 1.3 if every.index(revision) >= first else 1.0)

        origin = origin_of(Symptom("a", CELL, ratio=1.3), every, measure)
        assert origin.suspects == (every[first],)
        assert len(asked) == len(set(asked)) <= max(count - 1, 0).bit_length()
        assert every[-1] not in asked  # that it is bad is known
    assert most_trials(count) <= max(count - 1, 0).bit_length() + 3


def test_revisions_that_cannot_be_judged_stay_under_suspicion() -> None:
    every = revisions(8)
    broken = {3, 4}

    def measure(revision: Revision) -> Comparison:
        at = every.index(revision)
        if at in broken:
            return failed("new", "it cannot be installed", "")
        return compared(RED if at >= 4 else FINE, 1.3 if at >= 4 else 1.0)

    origin = origin_of(Symptom("mean step", CELL, ratio=1.3), every, measure)
    assert origin.suspects == tuple(every[3:6])
    assert {trial.revision.subject for trial in origin.trials if trial.shows is None} == {"change 3", "change 4"}
    words = origin_words(origin)
    assert words.startswith("mean step: first in 000000000 change 5, or in one that could not be judged: ")
    assert "change 3, 000000000 change 4" in words


def test_it_ends_even_where_nothing_can_be_judged() -> None:
    every = revisions(1000)
    origin = origin_of(Symptom("a", CELL), every, lambda _: compared(UNCLEAR))
    assert len(origin.trials) == most_trials(1000) == 13
    assert len(origin.suspects) == 1000


def test_the_symptom_is_the_clearest_and_a_failure_before_all() -> None:
    assert clearest_symptom(failed("new", "it crashes", "")).is_failure
    lost, other = Change(CELL, "status", "ok", "crashed"), Change(CELL, "iterations", "3", "4")
    assert clearest_symptom(compared(RED, typical=RED, changes=(other, lost))).counter == "status"
    assert clearest_symptom(compared(FINE, changes=(other,))).counter == "iterations"
    assert clearest_symptom(compared(RED, 1.3, 1.05, RED)).cell == CELL  # 1.3 where 1.05 is visible, against 1.5 where 1.2 is
    assert clearest_symptom(compared(RED, 1.3, 1.2, RED)).statistic == "typical"
    assert clearest_symptom(compared(RED, 1.3, 1.0, RED)).cell == CELL  # without any noise


@pytest.mark.parametrize(
    ("comparison", "shown"),
    [
        (compared(RED), True),
        (compared(FINE, 1.0), False),
        (compared(UNCLEAR), None),
        (compared(FINE, 1.0, 1.5), None),  # 1.3 could not have been seen
        (compared(FINE, 1.2), None),  # more than half of it is there
        (failed("new", "it crashes", ""), None),  # something else
        (failed("base", "no network", ""), None),
        (replace(compared(RED), times=()), None),
    ],
)
def test_fine_is_believed_only_where_the_symptom_could_have_been_seen(comparison: Comparison, shown: bool | None) -> None:
    assert shows(comparison, Symptom("a", CELL, ratio=1.3)) is shown


def test_statistics_counters_and_failures_are_symptoms_as_well() -> None:
    of_all = Symptom("typical", statistic="typical", ratio=1.5)
    assert shows(compared(FINE, 1.0, typical=RED), of_all) is True
    assert shows(compared(FINE, 1.0), of_all) is False
    counter = Symptom("a", CELL, "iterations")
    assert shows(compared(FINE, changes=(Change(CELL, "iterations", "3", "4"),)), counter) is True
    assert shows(compared(RED), counter) is False
    fails = Symptom("the program fails")
    assert shows(failed("new", "it crashes", ""), fails) is True
    assert shows(failed("base", "no network", ""), fails) is None
    assert shows(compared(RED), fails) is False
    assert np.isinf(fails.ratio)


OURS = """
import json, random
random.seed()
print(json.dumps({{"cells": {{"depot": {{"steps_s": [[{slow} * random.uniform(1e-3, 1.002e-3) for _ in range(20)] for _ in range(2)]}}}}}}))
"""


def git(folder: Path, *arguments: str) -> str:
    command = ["git", "-C", str(folder), "-c", "user.name=a", "-c", "user.email=a@example.org", *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()  # noqa: S603 - fixed


@pytest.fixture
def theirs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a repository of six commits whose program is slower since the fourth, and cannot run in the third."""
    top = tmp_path / "theirs"
    git(tmp_path, "init", "--quiet", "--initial-branch", "main", str(top))
    for number in range(1, 7):
        code = "raise SystemExit('half a commit')" if number == 3 else OURS.format(slow=1.3 if number >= 4 else 1.0)
        (top / "ours.py").write_text(f"{code}\n# {number}\n", encoding="utf-8")
        git(top, "add", ".")
        git(top, "commit", "--quiet", "--message", f"change {number}\x1b[31m")
        git(top, "tag", f"v{number}")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return top


@pytest.mark.slow
def test_the_first_slower_commit_is_named_and_nothing_is_left(
    theirs: Path, cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(theirs)
    temporary = tmp_path / "temporary"
    temporary.mkdir()
    monkeypatch.setenv("TMPDIR", str(temporary))
    monkeypatch.setattr("tempfile.tempdir", None)
    outcome = cli("bench", "--against", "v1", "--command", "python ours.py", "--bisect", "--out", "../out")
    assert outcome.code == 1, outcome.err
    commits = {number: git(theirs, "rev-parse", f"v{number}") for number in range(1, 7)}
    line = next(line for line in outcome.out.splitlines() if ": first in" in line)
    assert f"first in {commits[4][:9]} change 4\\x1b[31m, or in one that could not be judged: {commits[3][:9]} change 3" in line
    told = json.loads((tmp_path / "out" / "comparison.json").read_text(encoding="utf-8"))["bisect"]
    assert [one["commit"] for one in told["suspects"]] == [commits[3], commits[4]]
    assert {one["commit"]: one["shows"] for one in told["tried"]} == {commits[2]: False, commits[3]: None, commits[4]: True}
    assert not list(temporary.iterdir())
    assert not git(theirs, "status", "--porcelain")


def test_a_green_comparison_is_not_bisected(theirs: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(theirs)
    monkeypatch.setattr("hdvplan.bench.guard.origin_of", lambda *_: pytest.fail("bisected"))
    assert cli("bench", "--against", "v4", "--command", "python ours.py", "--bisect", "--quiet", "--out", "../out").code == 0


@pytest.mark.parametrize("against", ["v6", "hdvplan==0.1.0"])
def test_what_cannot_be_bisected_is_said_before_anything_is_measured(
    theirs: Path, cli: Cli, monkeypatch: pytest.MonkeyPatch, against: str
) -> None:
    monkeypatch.chdir(theirs)
    monkeypatch.setattr("hdvplan.bench.processes.start", lambda *_: pytest.fail("something was started"))
    outcome = cli("bench", "--against", against, "--command", "python ours.py", "--bisect", "--quiet", "--out", "../out")
    assert outcome.code == 2
    assert outcome.err.startswith("error: there is no revision between" if against == "v6" else "error: --bisect needs a revision")


def test_revisions_follow_the_first_parents_from_the_fork_to_the_working_tree(theirs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(theirs)
    here = checkout()
    assert here is not None
    git(theirs, "switch", "--quiet", "--create", "side", "v2")
    (theirs / "side.txt").write_text("side", encoding="utf-8")
    git(theirs, "add", ".")
    git(theirs, "commit", "--quiet", "--message", "beside")
    side = git(theirs, "rev-parse", "HEAD")
    git(theirs, "switch", "--quiet", "main")
    commits = [git(theirs, "rev-parse", f"v{number}") for number in range(1, 7)]
    assert [one.commit for one in revisions_since(here, commits[3])] == commits[4:]
    assert [one.commit for one in revisions_since(here, side)] == commits[1:]  # the fork first: what differs may be in ``side``
    git(theirs, "merge", "--quiet", "--no-ff", "--message", "merge", "side")
    merge = git(theirs, "rev-parse", "HEAD")
    assert [one.commit for one in revisions_since(here, commits[4])] == [commits[5], merge]  # not what came with the merge
    assert not is_changed(here)
    (theirs / "new.txt").write_text("not known to git", encoding="utf-8")
    assert not is_changed(here)
    (theirs / "ours.py").write_text("pass\n", encoding="utf-8")
    assert is_changed(here)
    assert revisions_since(here, merge) == (CHANGES,)
    assert revision_of(here).words == f"{merge[:9]} merge"
    git(theirs, "switch", "--quiet", "--discard-changes", "--orphan", "empty")
    with pytest.raises(OptionError, match="has no commit HEAD"):
        revision_of(here)
    with pytest.raises(OptionError, match="no common history"):
        revisions_since(here, merge)
