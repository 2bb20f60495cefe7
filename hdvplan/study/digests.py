"""Digests of what decides a cell's row: of any content, and of the code that plans it."""

from __future__ import annotations

import json
from hashlib import sha256

from hdvplan.machine import software
from hdvplan.plugins import OBJECTIVE, SOLVER, identity_of, is_reference, version_of

_DIGITS = 32  # of a digest in hexadecimal: 128 bits


def content_digest(content: object) -> str:
    """Return a digest of what ``json.dumps`` can write; the same in every process."""
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:_DIGITS]


def code_digest(solver: str, objective: str) -> str:
    """Return a digest of hdvplan's source, the libraries' versions, and of what users brought, as it is now."""
    brought = [[*identity_of(name), version_of(kind, name)] for kind, name in ((SOLVER, solver), (OBJECTIVE, objective))]
    named = tuple(name for name in (solver,) if not is_reference(name))
    return content_digest([software(named), brought])
