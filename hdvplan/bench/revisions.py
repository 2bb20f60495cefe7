"""The commits of a checkout that a comparison names: the current one, and those between it and another."""

from __future__ import annotations

from dataclasses import dataclass

from hdvplan.bench.checkout import Checkout, git
from hdvplan.errors import OptionError
from hdvplan.texts import printable

_SHORT = 9  # letters of a hash


@dataclass(frozen=True)
class Revision:
    """A commit of a checkout; with ``commit`` None what is changed in its working tree."""

    commit: str | None
    subject: str
    committed: str = ""  # ISO 8601

    @property
    def words(self) -> str:
        """Its name in messages: the beginning of its hash, and its subject."""
        return self.subject if self.commit is None else f"{self.commit[:_SHORT]} {self.subject}"


CHANGES = Revision(None, "the changes in the working tree")


def revision_of(here: Checkout, commit: str = "HEAD") -> Revision:
    """Return a commit with its subject; ``commit`` is a hash, or HEAD.

    Raises:
        OptionError: there is none.

    """
    told = git(here.top, "log", "-1", "--no-show-signature", "--no-mailmap", "--format=%H%n%cI%n%s", "--end-of-options", commit, "--")
    if not told:
        msg = f"{here.top} has no commit {commit[:_SHORT]}"
        raise OptionError(msg)
    found, committed, *subject = told.split("\n")
    return Revision(found, printable(" ".join(subject)), committed)


def is_changed(here: Checkout) -> bool:
    """Return whether files that git knows differ from the last commit."""
    return git(here.top, "--no-optional-locks", "status", "--porcelain", "--untracked-files=no") != ""


def revisions_since(here: Checkout, base: str) -> tuple[Revision, ...]:
    """Return the revisions since the commit ``base``, a hash, that could have changed something: the first-parent history, oldest first.

    If ``base`` is no ancestor, the commit at which both histories part comes first, as the difference may be in ``base``. Changes in the
    working tree come last.

    Raises:
        OptionError: the two have no common history here.

    """
    fork = git(here.top, "merge-base", base, "HEAD")
    if not fork:
        msg = f"{base[:_SHORT]} and the working tree have no common history"
        raise OptionError(msg, hint="a shallow clone lacks older commits: fetch them first")
    listed = git(here.top, "rev-list", "--first-parent", "--reverse", f"{fork}..HEAD") or ""
    beside = [] if fork == base else [fork]
    found = [revision_of(here, commit) for commit in (*beside, *listed.split())]
    return (*found, CHANGES) if is_changed(here) else tuple(found)
