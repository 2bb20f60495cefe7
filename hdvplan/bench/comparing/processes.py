"""Processes of other programs: started in a separate group, watched for time and memory, and ended with all their children."""

from __future__ import annotations

import json
import os
import select
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from time import monotonic, sleep

from hdvplan.bench import TURNS
from hdvplan.fileio import locked
from hdvplan.process import undisturbed

_IMPORTED = "import time:"  # of -X importtime
_STDERR, _SPENT, _STDOUT = "stderr", "spent.json", "stdout"
_LONGEST_WORDS, _LONGEST_LINE, _TAIL_LINES = 300, 200, 20
_GO = b"!"
_LOOK_S = 0.2  # how often it is looked whether a process has ended whose children still have the descriptor
_SCRATCH = "hdvplan-gate-"  # before the process and a word of chance
_TRIES, _PAUSE_S = 50, 0.05
# Between us and what is measured: the high-water mark of memory that a system reports for a process begins at that of the one which
# started it, and ours has loaded tables and plots.
_BETWEEN = """
import json, os, resource, subprocess, sys, time
if sys.argv[2]:
    os.sched_setaffinity(0, {int(sys.argv[2])})
began = time.monotonic()
try:
    code = subprocess.call(sys.argv[3:], close_fds=False)
except OSError as error:
    print(f"error: {sys.argv[3]} cannot be started: {error.strerror}", file=sys.stderr)
    sys.exit(127)
ran, used = time.monotonic() - began, resource.getrusage(resource.RUSAGE_CHILDREN)
peak = used.ru_maxrss * (1 if sys.platform == "darwin" else 1024)
with open(sys.argv[1], "w") as file:
    json.dump({"peak_bytes": peak, "cpu_s": used.ru_utime + used.ru_stime, "ran_s": ran}, file)
sys.exit(code if code >= 0 else 128 - code)
"""


@dataclass(frozen=True)
class Ended:
    """How a process ended: its code as shells report it, stdout, stderr, and what it took, where known."""

    code: int
    stdout: str
    stderr: str
    spent: Mapping[str, float] = field(default_factory=dict)  # largest memory [bytes], processor, running and start-up time [s]
    expired: bool = False  # it was ended at its time limit

    @property
    def how(self) -> str:
        """The end in a word: the signal's name, else the code."""
        names = {128 + known.value: known.name for known in signal.Signals}
        return names.get(self.code, str(self.code))

    @property
    def words(self) -> str:
        """The last words in one line: an ``error:`` line on stderr, what pytest says on stdout of tests that failed, else stderr's last."""
        lines, printed = ([" ".join(line.split()) for line in text.splitlines() if line.strip()] for text in (self.stderr, self.stdout))
        told = [line[7:] for line in lines if line.startswith("error: ")]
        told += [line for line in printed if line.startswith(("FAILED ", "ERROR "))]
        plain = [line for line in printed if not line.startswith("{")]  # its times are no words
        return (told or lines[-1:] or plain[-1:] or ["nothing"])[0][:_LONGEST_WORDS]

    @property
    def tail(self) -> str:
        """The end of stdout and of stderr, as long as a traceback; of lines that may be kilobytes of numbers what they begin with."""
        lines = [line for text in (self.stdout, self.stderr) for line in text.strip().splitlines()[-_TAIL_LINES:]]
        return "\n".join(line if len(line) <= _LONGEST_LINE else f"{line[:_LONGEST_LINE]} ..." for line in lines)


@dataclass(frozen=True)
class Turns:
    """How a process is started that takes turns with another: on a ``core`` that they share; None: on any."""

    core: int | None


@dataclass
class Started:
    """A process that runs, the folder for what it says, and our end of the sockets by which it has its turns."""

    process: subprocess.Popen[bytes]
    folder: Path
    turns: socket.socket | None = None
    limit: float | None = None  # for as long it may run, without waiting for turns [s]
    ran: list[float] = field(default_factory=list)  # until its first turn, and in every turn [s]
    expired: bool = False

    def left(self) -> float | None:
        """Return for how long it may still run [s]; None: for ever."""
        return None if self.limit is None else max(self.limit - sum(self.ran), 0.0)


@dataclass(frozen=True)
class Scratch:
    """A temporary folder, and the processes that were started in it: both end with the block that has them."""

    folder: Path
    started: list[Started]


def start(
    command: Sequence[str], variables: Mapping[str, str], scratch: Scratch, cwd: Path | None = None, turns: Turns | None = None,
    limit: float | None = None,
) -> Started:  # fmt: skip
    """Start a command in a separate process group; with ``turns``, if it knows of them and the system has them, it waits for its first.

    Raises:
        OSError: it cannot be started.

    """
    folder = Path(tempfile.mkdtemp(dir=scratch.folder))
    posix, variables = os.name == "posix", dict(variables)
    core = "" if turns is None or turns.core is None else str(turns.core)
    measured = [sys.executable, "-I", "-S", "-c", _BETWEEN, str(folder / _SPENT), core, *command] if posix else list(command)
    with ExitStack() as stack, undisturbed():
        stderr, stdout = (stack.enter_context((folder / name).open("wb")) for name in (_STDERR, _STDOUT))
        ours = None
        if turns is not None and posix:
            ours, theirs = socket.socketpair()
            stack.enter_context(theirs)
            variables[TURNS] = str(theirs.fileno())
        process = subprocess.Popen(  # noqa: S603 - no shell; what runs is the caller's
            measured, env=variables, stdin=subprocess.DEVNULL, stdout=stdout, stderr=stderr, cwd=cwd, start_new_session=True,
            pass_fds=[theirs.fileno()] if ours else [],
        )  # fmt: skip
        scratch.started.append(Started(process, folder, ours, limit))
    return scratch.started[-1]


def finish(started: Started) -> Ended:
    """Wait for a process and return how it ended; whatever interrupts the waiting ends its whole group."""
    try:
        code = started.process.wait(started.left())
    except subprocess.TimeoutExpired:
        started.expired, code = True, 128 + signal.SIGTERM
    finally:
        end(started)
    stderr, stdout = ((started.folder / name).read_text(encoding="utf-8", errors="replace") for name in (_STDERR, _STDOUT))
    stderr, imported = without_imports(stderr)
    spent = {} if imported is None else {"import_s": imported}
    if (file := started.folder / _SPENT).is_file():
        spent |= json.loads(file.read_text(encoding="utf-8"))
    if len(started.ran) > 1:  # it took turns
        spent |= {"ran_s": sum(started.ran), "start_s": started.ran[0]}
    shutil.rmtree(started.folder, ignore_errors=True)
    return Ended(code if code >= 0 else 128 - code, stdout, stderr, spent, started.expired)


def without_imports(stderr: str) -> tuple[str, float | None]:
    """Return stderr without what Python says of imports, and their time [s]; None where it says nothing."""
    lines = stderr.splitlines(keepends=True)
    imports = [line for line in lines if line.startswith(_IMPORTED)]
    times = [int(words[0]) for line in imports if (words := line[len(_IMPORTED) :].split()) and words[0].isdecimal()]
    return "".join(line for line in lines if not line.startswith(_IMPORTED)), 1e-6 * sum(times) if times else None


def end(started: Started) -> None:
    """End a process and all that it has started; does nothing to those that have ended."""
    with undisturbed():
        if hasattr(os, "killpg"):
            with suppress(ProcessLookupError, PermissionError):
                os.killpg(started.process.pid, signal.SIGKILL)
        else:
            started.process.kill()
        started.process.wait()
    if started.turns is not None:
        started.turns.close()


def run(command: Sequence[str], variables: Mapping[str, str], scratch: Scratch, cwd: Path | None = None) -> Ended:
    """Run a command to its end; see ``start`` and ``finish``."""
    return finish(start(command, variables, scratch, cwd))


@contextmanager
def scratch_folder() -> Iterator[Scratch]:
    """Provide a temporary folder; it goes afterwards with all processes that were started in it, whatever ends the block.

    After SIGKILL it stays, and the next one removes it.
    """
    made: list[Scratch] = []
    try:
        with undisturbed():
            made.append(Scratch(Path(tempfile.mkdtemp(prefix=f"{_SCRATCH}{os.getpid()}-")), []))
        with locked(made[0].folder):
            _remove_killed()
            yield made[0]
    finally:
        with undisturbed():
            for scratch in made:
                for started in scratch.started:
                    if started.process.returncode is None:  # the number of one that has been waited for may be another's by now
                        end(started)
                    elif started.turns is not None:
                        started.turns.close()
                remove(scratch.folder)


def _remove_killed() -> None:
    """Remove scratch folders whose process was killed: it is gone, and with it its lock, which processes in other containers keep too."""
    if os.name != "posix":
        return
    for folder in Path(tempfile.gettempdir()).glob(f"{_SCRATCH}*-*"):
        with suppress(OSError, ValueError, OverflowError):
            if folder.lstat().st_uid != os.getuid():
                continue
            try:
                os.kill(int(folder.name.removeprefix(_SCRATCH).partition("-")[0]), 0)
            except ProcessLookupError:
                with locked(folder, wait=False) as is_left:
                    if is_left:
                        shutil.rmtree(folder, ignore_errors=True)


def remove(folder: Path) -> None:
    """Remove a folder; processes that were killed a moment ago may still finish what they write."""
    for _ in range(_TRIES):
        shutil.rmtree(folder, ignore_errors=True)
        if not folder.exists():
            return
        sleep(_PAUSE_S)


def in_turn(starting: Iterable[Started]) -> None:
    """Let processes take turns until none asks for one any more.

    Each is started when the one before waits for its first turn, or has ended: so what loads the next does not disturb it, and
    programs that know nothing of turns run one after the other.
    """
    waiting = deque(one for one in starting if _asks(one))
    while waiting:
        one = waiting.popleft()
        if one.turns is None:
            continue
        with suppress(OSError):  # it has ended
            one.turns.send(_GO)
            if _asks(one):
                waiting.append(one)


def shared_cores(*, one_is_enough: bool) -> Sequence[int | None]:
    """Return the cores that pairs of processes use one after the other; None: any, where one is too little or the system gives no choice.

    Cores differ in speed too, if others use their other half.
    """
    return sorted(os.sched_getaffinity(0)) if one_is_enough and hasattr(os, "sched_getaffinity") else [None]


def _asks(one: Started) -> bool:
    """Wait until a process asks for a turn, or does not any more; tell which. One that takes too long is ended."""
    began, asked, left = monotonic(), False, one.left()
    while one.turns is not None:
        ready, _, _ = select.select([one.turns], [], [], _LOOK_S if left is None else min(_LOOK_S, left))
        if ready:
            with suppress(OSError):
                asked = bool(one.turns.recv(1))
            break
        if one.process.poll() is not None:
            break
        if left is not None and monotonic() - began >= left:
            one.expired = True
            end(one)
            break
    one.ran.append(monotonic() - began)
    return asked
