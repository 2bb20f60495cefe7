"""The two programs of a comparison: what ``--against`` names, and what is here, each in the environment that it asks for.

What a user names is data. Git is asked for a commit and goes on with its hash, pip is given a version or the address of a file that
exists, and nothing else is run. A revision is exported into a folder of the user's cache with its environment and its C core, where
the next comparison finds it: no worktree is registered, and the checkout is only read. But for the core of hdvplan's own working tree: that
is built where it is not that of the sources.
"""

from __future__ import annotations

import os
import re
import shutil
import sys
import tomllib
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from hdvplan.bench.comparing.checkout import Checkout, copy_tree, export, git
from hdvplan.bench.comparing.processes import Scratch, remove, run
from hdvplan.bench.comparing.programs import PYTHON, Program, ProgramError, environment, install, is_unreached, pip, reason
from hdvplan.errors import OptionError
from hdvplan.fileio import locked
from hdvplan.process import is_closed, undisturbed

PACKAGE = Path(__file__).parents[2]
_RELEASE = re.compile(  # a version of PEP 440
    r"hdvplan==v?(?:\d+!)?\d+(?:\.\d+)*(?:[-_.]?(?:a|b|c|rc|alpha|beta|pre|preview)[-_.]?\d*)?(?:-\d+|[-_.]?(?:post|rev|r)[-_.]?\d*)?"
    r"(?:[-_.]?dev[-_.]?\d*)?(?:\+[a-z0-9]+(?:[-_.][a-z0-9]+)*)?",
    re.ASCII | re.IGNORECASE,
)
_HASH = re.compile(r"[0-9a-f]{40}(?:[0-9a-f]{24})?")
_ASKED_FOR = ("pyproject.toml", "setup.py", "setup.cfg", "requirements.txt")
_KEPT = 4  # environments of revisions; one takes up to 0.7 GB where it has separate packages
_READY = "ready"
_BUILD = "hatch_build.py"  # compiles the core of a source tree of hdvplan, in place


@dataclass(frozen=True)
class Base:
    """What ``--against`` names, without anything having been run of it: an interpreter, something to install, or a commit."""

    words: str
    python: Path | None = None
    install: str | None = None
    commit: str | None = None


def base_named(against: str, here: Checkout | None) -> Base:
    """Return what ``against`` names; nothing of it runs.

    It is the path of a Python interpreter (with a separator), a release ``hdvplan==X``, a wheel or source distribution that exists, or a
    revision of the checkout.

    Raises:
        OptionError: it names nothing of these.

    """
    if _RELEASE.fullmatch(against):
        return Base(against, install=against)
    path = Path(against) if "\0" not in against else Path()
    separators = [sign for sign in (os.sep, os.altsep) if sign]
    if (
        any(sign in against for sign in separators)
        and path.name.lower().startswith("python")
        and path.is_file()
        and os.access(path, os.X_OK)
    ):
        return Base(against, python=path.absolute())  # its own path: the target of a link is an interpreter without packages
    if against.endswith((".whl", ".tar.gz")) and path.is_file():
        return Base(against, install=path.resolve().as_uri())
    if here is None:
        msg = f"{against!r} names a revision, but this is not a git checkout"
        raise OptionError(msg, hint="name a release (hdvplan==0.1.0), or the path of a Python that has one")
    found = git(here.top, "rev-parse", "--verify", "--quiet", "--end-of-options", f"{against}^{{commit}}") if "\0" not in against else None
    if found is None or not _HASH.fullmatch(found):
        msg = f"no revision {against!r} in {here.top}" if against else "--against is empty"
        raise OptionError(msg, hint=_missing(here) if against else "is the variable set that shall name the base?")
    return Base(against, commit=found)


def _missing(here: Checkout) -> str:
    if git(here.top, "rev-parse", "--is-shallow-repository") == "true":
        return "this clone is shallow: without older commits and other branches (GitHub: fetch-depth: 0, GitLab: GIT_DEPTH: 0)"
    return "git branch --all and git tag list the names; git fetch brings what was pushed since"


def base_program(base: Base, here: Checkout | None, scratch: Scratch, cache: Path, on_step: Callable[[str], None]) -> Program:
    """Make what ``--against`` names ready to run; ``on_step`` receives what is being done, in words.

    A revision of hdvplan with the dependencies of the working tree uses the present packages. That of another project, and
    anything to install, has an environment of its own. A revision of what pip cannot install runs by the present interpreter.
    What is installed is the project nearest to the folder in which the comparison starts.

    Raises:
        OptionError: a release or file that cannot be installed, or no build tool for a core.
        ProgramError: a revision that cannot be installed, or whose core cannot be compiled, or no package index answers.

    """
    if base.python is not None:
        return Program(base.words, base.python)
    if base.install is not None:
        on_step(f"installing {base.words}")
        python = environment(scratch.folder / "base", scratch)
        ended = pip(python, scratch, base.install)
        if ended.code != 0:
            if is_unreached(ended):
                msg = f"{base.words} cannot be installed: no package index answers"
                raise ProgramError(msg, tail=ended.tail, code=ended.code)
            msg = f"{base.words} cannot be installed: {reason(ended)}"
            raise OptionError(msg)
        return Program(base.words, python)
    assert here is not None  # noqa: S101 - a commit is one of a checkout
    assert base.commit is not None  # noqa: S101 - what else there is was dealt with
    name = f"{base.words} ({base.commit[:9]})" if not base.commit.startswith(base.words) else base.commit[:9]
    package = here.package
    with _kept(cache, f"{base.commit}-{_request(here)}") as (folder, ready):
        source, python = folder / "source", Path(sys.executable)
        if not ready:
            on_step(f"checking out {name}")
            export(here.top, base.commit, source, folder)
        own = Checkout(source, here.below)
        if package is not None and (not here.is_ours or _dependencies(source) not in {None, _dependencies(here.top)}):
            python = folder / "venv" / PYTHON
            if not ready:
                on_step(f"installing {name}, once for this revision")
                install(source / package, folder / "venv", name, scratch, extras=here.extras)
        below = source / here.below if (source / here.below).is_dir() else source
        program = Program(name, python, source if own.is_ours and python == Path(sys.executable) else None, below)
        if not ready:
            _build_core(program, scratch, on_step)
    return program


def new_program(base: Base, here: Checkout | None, scratch: Scratch, cache: Path, on_step: Callable[[str], None], out: Path) -> Program:
    """Make the other side ready: the working tree with all that is changed in it; outside of a checkout the hdvplan that is running.

    So it is in another project beside an interpreter as ``base``: who names that compares it with the one that was started.
    The working tree of another project is installed into an environment that is kept for its requirements, without the results in the
    folder ``out``.

    Raises:
        ProgramError: it cannot be installed, or its core cannot be compiled.

    """
    if here is None or (base.python is not None and not here.is_ours):
        return Program("the running hdvplan", source=PACKAGE.parent)
    if here.is_ours:
        program = Program("the working tree", source=here.top)
        _build_core(program, scratch, on_step)
        return program
    package = here.package
    if package is None:
        return Program("the working tree", folder=here.top / here.below)
    name = "the working tree"
    with _kept(cache, f"new-{_digest(os.fsencode(here.top))}-{_request(here)}") as (folder, ready):
        on_step(f"installing {name}")
        source = scratch.folder / "working-tree"  # building leaves files beside the sources
        copy_tree(here.top, source, (out, cache))
        install(source / package, folder / "venv", name, scratch, extras=here.extras, again=ready)
    return Program(name, folder / "venv" / PYTHON, None, here.top / here.below)


def _build_core(program: Program, scratch: Scratch, on_step: Callable[[str], None]) -> None:
    """Compile the C core of a source tree of hdvplan in place, if it has one and that is missing or of other sources."""
    if program.source is None or not (program.source / _BUILD).is_file():
        return
    python, variables = str(program.python), program.environment()
    if run([python, "-P", "-c", "import hdvplan.core"], variables, scratch, program.source).code == 0:
        return
    on_step(f"compiling the core of {program.name}")
    ended = run([python, "-P", _BUILD], variables, scratch, program.source)
    if ended.code == 0:
        return
    if missing := re.search(r"No module named '(\w+)", ended.words):
        msg = f"the core of {program.name} cannot be compiled: {missing[1]} is not installed"
        raise OptionError(msg, hint=f"pip install {missing[1]}, for {python}")
    msg = f"the core of {program.name} cannot be compiled: {ended.words}"
    raise ProgramError(msg, tail=ended.tail, code=ended.code, hint=f"run `python {_BUILD}` there: it needs hatchling and a C compiler")


def cache_folder(scratch: Scratch) -> Path:
    """Return where environments of revisions are kept, whose code runs; a temporary folder where others could write to the user's place."""
    with suppress(OSError, RuntimeError):
        home = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache").absolute() / "hdvplan" / "gate"
        home.mkdir(mode=0o755, parents=True, exist_ok=True)
        if os.access(home, os.W_OK) and is_closed(home):
            return home
    temporary = scratch.folder / "cache"
    temporary.mkdir(exist_ok=True)
    return temporary


@contextmanager
def _kept(cache: Path, key: str) -> Iterator[tuple[Path, bool]]:
    """Provide a folder of the cache and whether it is complete; one whose making fails or is interrupted goes. One user at a time."""
    folder = cache / key
    with locked(cache / f"{key}.lock"):
        ready = (folder / _READY).is_file()
        if not ready:
            shutil.rmtree(folder, ignore_errors=True)
        try:
            folder.mkdir(exist_ok=True)
            yield folder, ready
            (folder / _READY).write_text("", encoding="utf-8")  # anew, as the time of its last use
        except BaseException:
            with undisturbed():
                remove(folder)
            raise
    old = sorted(cache.glob(f"*/{_READY}"), key=lambda file: file.stat().st_mtime)[:-_KEPT]
    for file in old:
        shutil.rmtree(file.parent, ignore_errors=True)


def _dependencies(source: Path) -> str | None:
    """Return what an hdvplan needs; None where it does not say."""
    try:
        project = tomllib.loads((source / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    except (OSError, ValueError, KeyError):
        return None
    return repr((project.get("dependencies", []), project.get("requires-python")))


def _request(here: Checkout) -> str:
    """Return a digest of the interpreter, of the project's folder and extras, and of the files that say what else is needed."""
    package = here.package
    folder = here.top / (package or ".")
    files = [(folder / name).read_bytes() for name in _ASKED_FOR if (folder / name).is_file()]
    asked = [sys.executable, sys.version, os.fspath(package or ""), *here.extras]
    return _digest(b"\0".join([*map(os.fsencode, asked), *files]))


def _digest(content: bytes) -> str:
    return sha256(content).hexdigest()[:16]
