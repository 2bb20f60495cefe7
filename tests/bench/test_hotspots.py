"""Profiles of both sides: made-up functions, and a real file of cProfile."""

from __future__ import annotations

import sys
from cProfile import Profile
from pathlib import Path

import pytest

from hdvplan.bench.hotspots import functions_in, hotspots, hotspots_json, profile_of
from hdvplan.bench.processes import scratch_folder
from hdvplan.bench.programs import Program, ProgramError, present
from hdvplan.bench.work import CommandWork, SuiteWork

SLOW = """
def fast():
    return sum(range(100))


def slow():
    total = 0
    for i in range({count}):
        total += i
    return total


for _ in range(20):
    fast()
    slow()
"""


def test_what_gained_most_comes_first_and_noise_is_left_out() -> None:
    base = {"a: f": (1.0, 10), "a: gone": (0.5, 1), "a: same": (1.0, 3)}
    new = {"a: f": (1.4, 20), "a: new": (0.9, 1), "a: same": (1.02, 3)}
    found = hotspots(base, new)
    assert [(one.function, one.base_calls, one.new_calls) for one in found] == [("a: new", 0, 1), ("a: f", 10, 20)]
    assert hotspots_json(found)[0] == {"function": "a: new", "base_s": 0.0, "new_s": 0.9, "base_calls": 0, "new_calls": 1}
    assert hotspots({}, {}) == ()
    assert len(hotspots({}, {str(number): (1.0, 1) for number in range(99)})) == 10


def test_two_versions_of_a_script_are_told_apart_by_the_function_that_differs(tmp_path: Path) -> None:
    profiles = []
    for side, count in (("base", 1000), ("new", 20_000)):
        folder = tmp_path / side
        folder.mkdir()
        (folder / "ours.py").write_text(SLOW.format(count=count), encoding="utf-8")
        with scratch_folder() as scratch:
            profiles.append(profile_of(present(side, None, folder), CommandWork((sys.executable, "ours.py")), scratch))
    found = hotspots(*profiles)
    assert found[0].function == "ours.py: slow"


@pytest.mark.parametrize("words", [("planner", "--fast"), ("python",), ("python", "-c", "pass"), ("bash", "-c", "true")])
def test_a_command_that_is_no_script_of_python_has_no_profile(words: tuple[str, ...]) -> None:
    with scratch_folder() as scratch, pytest.raises(ProgramError, match="does not begin with python"):
        profile_of(present("ours", None), CommandWork(words), scratch)


def test_modules_and_suites_are_profiled_in_one_process(tmp_path: Path) -> None:
    program = Program("ours", Path("/env/bin/python"))
    assert CommandWork(("python3", "-m", "ours.bench", "--x")).profiled(program, tmp_path, tmp_path / "p") == [
        "python3", "-m", "cProfile", "-o", str(tmp_path / "p"), "-m", "ours.bench", "--x"
    ]  # fmt: skip
    command = SuiteWork(tmp_path / "suite.toml").profiled(program, tmp_path, tmp_path / "p")
    assert command is not None
    assert command[:2] == ["/env/bin/python", "-P"]
    assert "--in-process" in command


def test_files_are_named_as_both_sides_have_them_and_damage_is_an_error(tmp_path: Path) -> None:
    with pytest.raises(ProgramError, match="cannot be read"):
        functions_in(tmp_path / "missing", [])
    for content in (b"", b"x", b"\xe9"):
        (tmp_path / "damaged").write_bytes(content)
        with pytest.raises(ProgramError, match="cannot be read"):
            functions_in(tmp_path / "damaged", [])


def test_names_of_built_in_functions_have_no_addresses_which_differ_in_every_process(tmp_path: Path) -> None:
    profile = Profile()
    profile.runcall(lambda: tuple.__new__(tuple, ()))
    profile.dump_stats(tmp_path / "profile")
    assert "<built-in method __new__ of type object>" in functions_in(tmp_path / "profile", [])
