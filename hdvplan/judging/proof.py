"""A proof that no drive keeps the limits, as part of verdicts and needs."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Proof:
    """That no driving keeps a road's limits.

    ``kind`` is "place" where one body alone, ``unit``, fits between the limits at ``s_to`` in no pose; "motion" where the vehicle, up to
    ``unit``, fits everywhere from ``s_from`` to ``s_to`` [m], but nothing that fits at ``s_from`` can be driven to ``s_to``.
    """

    kind: str
    s_from: float
    s_to: float
    unit: int
