"""The command line as its users start it: a process with its own streams."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from hdvplan.vehicle.load import vehicle_text
from tests.nightly import nightly

HEAVY = ("numpy", "scipy", "pandas", "matplotlib", "shapely", "pyproj", "pyogrio", "rich.table")
COMMAND = (sys.executable, "-m", "hdvplan")
_PATIENCE_S = 120.0  # takes 1 s; a machine with other work has taken 15


def hdvplan(folder: Path, *arguments: str, **variables: str) -> subprocess.CompletedProcess[str]:
    environment = _environment() | variables
    return subprocess.run([*COMMAND, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False)  # noqa: S603 - our own


def loaded(folder: Path, modules: Sequence[str], *commands: str) -> list[str]:
    """Run commands in one process; return a line for each: the command, its exit code, and those of the modules that are loaded then."""
    script = (
        "import sys; from hdvplan.cli.app import run\n"
        f"for words in {commands}:\n"
        f"    print('>', words, run(words.split()), [module for module in {modules} if module in sys.modules])"
    )
    arguments = [sys.executable, "-c", script]
    ended = subprocess.run(arguments, cwd=folder, env=_environment(), capture_output=True, text=True, check=True)  # noqa: S603 - our own
    return [line.removeprefix("> ") for line in ended.stdout.splitlines() if line.startswith("> ")]


def _environment() -> dict[str, str]:
    return os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}


SLOW = ("scipy.interpolate", "scipy.ndimage", "scipy.optimize", "pandas", "matplotlib", "qpsolvers", "pyproj.crs")
LIGHT = [
    ("roads list", 0),
    ("vehicles list", 0),
    ("solvers", 0),
    ("plan nowhere.csv --vehicle bus", 2),
    ("plan nowhere --vehicle bus", 2),
    ("plan uturn --vehicle bsu", 2),
    ("plan uturn --vehicle bus --solver ricatti", 2),
    ("plan uturn --vehicle bus --objective geometrical", 2),
    ("plan uturn --vehicle bus --objective art-weighted:2", 2),
    ("plan header.csv --vehicle bus", 2),
    ("plan text.geojson --vehicle bus", 2),
    ("roads info header.csv", 2),
    ("bench --solvers ricatti", 2),
    ("study text.geojson --out out", 2),
    ("bench --objective geometrical", 2),
]


def test_lists_and_refusals_wait_for_nothing_that_is_slow_to_load(tmp_path: Path) -> None:
    """One process runs them all: what any of them loads stays loaded."""
    (tmp_path / "header.csv").write_text("easting,northing\n1,2\n", encoding="utf-8")
    (tmp_path / "text.geojson").write_text("no JSON", encoding="utf-8")
    said = loaded(tmp_path, SLOW, *(words for words, _ in LIGHT))
    assert said == [f"{words} {code} []" for words, code in LIGHT]


@pytest.mark.parametrize(
    ("command", "modules"),
    [
        ("--help", HEAVY),
        ("roads list", ("numpy",)),
        ("plan uturn --vehicle bus --no-plot", (*SLOW, "scipy.sparse", "scipy.spatial", "clarabel", "piqp")),
    ],
)
def test_no_library_is_loaded_that_a_command_has_no_use_for(tmp_path: Path, command: str, modules: tuple[str, ...]) -> None:
    assert loaded(tmp_path, modules, command) == [f"{command} 0 []"]


def test_help_is_there_at_once(tmp_path: Path) -> None:
    def seconds() -> float:
        """Return the processor's time: what else the machine does must not count."""
        before = os.times()
        assert hdvplan(tmp_path, "--help").returncode == 0
        after = os.times()
        return after.children_user + after.children_system - before.children_user - before.children_system

    assert any(seconds() < 0.4 for _ in range(3))  # caches may be cold once, not three times


def test_without_a_command_the_help_is_shown_and_nothing_is_claimed_to_be_done(tmp_path: Path) -> None:
    ended = hdvplan(tmp_path)
    assert ended.returncode == 2
    assert ended.stdout.startswith("Usage: hdvplan")


def test_the_version_is_the_package_s(tmp_path: Path) -> None:
    from hdvplan import __version__  # noqa: PLC0415 - the process under test must not profit

    assert hdvplan(tmp_path, "--version").stdout == f"hdvplan {__version__}\n"


def test_a_plan_ends_in_0_with_tables_on_stdout_and_silence_on_stderr(tmp_path: Path) -> None:
    ended = hdvplan(tmp_path, "plan", "sturn", "--vehicle", "bus", "--no-plot", "--horizon", "50")
    assert ended.returncode == 0
    assert "expected half width" in ended.stdout
    assert "\x1b" not in ended.stdout  # no colour codes outside a terminal
    assert ended.stderr == ""


@pytest.mark.slow
def test_a_picture_needs_nothing_of_what_the_user_has_set_up_for_others(tmp_path: Path) -> None:
    (tmp_path / "matplotlibrc").write_text("text.usetex: True\n", encoding="utf-8")
    ended = hdvplan(tmp_path, "vehicles", "show", "bus", "--plot", MPLBACKEND="nonsense")
    assert (ended.returncode, ended.stdout, ended.stderr) == (0, "", "wrote bus.png\n")


def test_signs_that_the_encoding_of_stdout_lacks_are_escaped(tmp_path: Path) -> None:
    (tmp_path / "ours.toml").write_text(f"# Länge\n{vehicle_text('bus')}", encoding="utf-8")
    ended = hdvplan(tmp_path, "vehicles", "show", "ours.toml", PYTHONIOENCODING="ascii")
    assert (ended.returncode, ended.stderr) == (0, "")
    assert ended.stdout.startswith("# L\\xe4nge\n")


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs a shell of Unix")
@pytest.mark.parametrize(
    ("streams", "code", "said"),
    [
        (">&-", 0, ""),
        ("2>&-", 0, ""),
        ("<&- >&- 2>&-", 0, ""),
        (">/dev/full", 2, "No space left on device\n"),
        ("| true", 0, ""),
    ],
)
@pytest.mark.parametrize("command", ["vehicles list", *map(nightly, ("vehicles list --json", "roads make uturn"))])
def test_streams_that_cannot_be_written_are_no_bug(tmp_path: Path, command: str, streams: str, code: int, said: str) -> None:
    if streams == ">/dev/full" and (command.startswith("roads") or not Path("/dev/full").exists()):
        pytest.skip("nothing is written to stdout, or there is no such device")
    script = f'set -o pipefail; "$0" -m hdvplan {command} {streams}'
    ended = subprocess.run(  # noqa: S603 - our own
        ["/bin/bash", "-c", script, sys.executable], cwd=tmp_path, env=_environment(), capture_output=True, text=True, check=False
    )
    assert ended.returncode in ({code, 141} if "true" in streams else {code})  # 141: it came to the end of the pipe while it wrote
    lines = [line for line in ended.stderr.splitlines(keepends=True) if not line.startswith("wrote uturn.csv: ")]
    assert len(lines) == bool(said)
    assert all(line.startswith("error: ") and line.endswith(said) for line in lines)
    assert command.startswith("vehicles") or (tmp_path / "uturn.csv").read_text(encoding="utf-8").startswith("s,kappa\n0.0,0.0\n")


OWN = """import ctypes, os
from hdvplan.planning.objectives import geometric

def loud(stations, vehicle):
    print("a line of one's own")
    os.write(1, b"and one of a library\\n")
    return geometric(stations, vehicle)

def ending(stations, vehicle):
    ctypes.CDLL(None).exit(0)
"""


@pytest.mark.skipif(sys.platform == "win32", reason="its C library has another name")
def test_what_is_of_one_s_own_neither_writes_into_json_nor_ends_a_command_as_if_it_had_answered(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(OWN, encoding="utf-8")
    plan = ("plan", "uturn", "--vehicle", "bus", "--no-plot", "--json", "--objective")
    loud, ending = hdvplan(tmp_path, *plan, "own.py:loud"), hdvplan(tmp_path, *plan, "own.py:ending")
    assert (loud.returncode, json.loads(loud.stdout)["status"]) == (0, "ok")
    assert {"a line of one's own", "and one of a library"} <= set(loud.stderr.splitlines())
    assert (ending.returncode, ending.stdout) == (70, "")
    assert "error: the process was ended by C's exit()" in ending.stderr
    assert hdvplan(tmp_path, *plan, "own:ending", PYTHONPATH=os.pathsep.join([str(tmp_path), *filter(None, sys.path)])).returncode == 70


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals and named pipes")
def test_an_interrupted_command_ends_as_shells_expect(tmp_path: Path) -> None:
    pipe = tmp_path / "endless.toml"
    os.mkfifo(pipe)
    as_at_a_shell = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"  # ignored where pytest runs in the background
    arguments = [
        sys.executable,
        "-c",
        f"{as_at_a_shell}; from hdvplan.cli.entry import main; main()",
        "plan",
        "uturn",
        "--vehicle",
        str(pipe),
    ]
    single = _environment() | {"OPENBLAS_NUM_THREADS": "1"}  # with one thread only it is the reader that the signal reaches
    with subprocess.Popen(arguments, env=single, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:  # noqa: S603
        writer = _opened(pipe)  # from now on the command waits for its vehicle
        process.send_signal(signal.SIGINT)
        os.close(writer)  # a read that began after the signal ends here, and the signal counts
        out, err = process.communicate(timeout=_PATIENCE_S)
    assert process.returncode == 130
    assert out == ""
    assert err == "error: interrupted\n"


@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize("end", [ImportError("half of a library"), SystemError("returned a result with an exception set"), None])
def test_an_interruption_that_a_library_turns_into_something_else_still_ends_as_one(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], end: Exception | None
) -> None:
    from hdvplan.cli import app  # noqa: PLC0415 - the other tests' processes must not profit

    def interrupted(**_: object) -> int:
        with suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        if end is not None:
            raise end
        return 0

    monkeypatch.setattr(app, "command_line", lambda: interrupted)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored where pytest runs in the background
    try:
        assert app.run(["roads", "list"]) == 130
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert capsys.readouterr() == ("", "error: interrupted\n")


@pytest.mark.parametrize(
    ("error", "said"),
    [
        (MemoryError(), "error: there is not enough memory"),
        (
            MemoryError("Unable to allocate 29.8 GiB\nfor an array"),
            "error: there is not enough memory; Unable to allocate 29.8 GiB for an array",
        ),
    ],
)
def test_too_little_memory_is_no_bug(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: MemoryError, said: str
) -> None:
    from hdvplan.cli import app  # noqa: PLC0415 - the other tests' processes must not profit

    def without_memory(**_: object) -> int:
        raise error

    monkeypatch.setattr(app, "command_line", lambda: without_memory)
    assert app.run(["roads", "list"]) == 2
    assert capsys.readouterr().err.splitlines()[0] == said


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="needs signals")
@pytest.mark.parametrize(
    ("number", "codes"),
    [(signal.SIGINT, {130, -signal.SIGINT, 0}), nightly(signal.SIGTERM, {-signal.SIGTERM, 0})],
)
def test_a_signal_at_any_moment_ends_the_command_as_shells_expect(tmp_path: Path, number: signal.Signals, codes: set[int]) -> None:
    """A shell reports -2 as 130, -15 as 143; -2 is Python's own end before it has come to hdvplan, and 0 that the signal was late."""
    for _ in range(2):  # the first may have modules to translate
        begun = time.monotonic()
        assert hdvplan(tmp_path, "plan", "uturn", "--vehicle", "bus", "--quiet").returncode == 0
        whole = time.monotonic() - begun
    as_at_a_shell = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    arguments = [sys.executable, "-c", f"{as_at_a_shell}; from hdvplan.cli.entry import main; main()", "plan", "uturn", "--vehicle", "bus"]
    ended = []
    for share in np.linspace(0.01, 0.97, 13):
        with subprocess.Popen(  # noqa: S603 - our own
            arguments, cwd=tmp_path, env=_environment(), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as process:
            time.sleep(share * whole)
            process.send_signal(number)
            _, err = process.communicate(timeout=_PATIENCE_S)
        ended.append((process.returncode, err))
    ours = [(code, err) for code, err in ended if "<frozen site>" not in err]  # Python, before it has come to hdvplan, ends so with 1
    assert {code for code, _ in ours} <= codes, [err for code, err in ours if code not in codes]
    assert {err for code, err in ended if code == 130} <= {"error: interrupted\n"}
    assert sum(code != 0 for code, _ in ended) > 6  # most came in time


def _opened(pipe: Path) -> int:
    """Return a descriptor for writing into a pipe once somebody reads it."""
    deadline = time.monotonic() + _PATIENCE_S
    while time.monotonic() < deadline:
        try:
            return os.open(pipe, os.O_WRONLY | os.O_NONBLOCK)
        except OSError:  # nobody reads yet
            time.sleep(0.05)
    pytest.fail("the command did not open its vehicle file")
