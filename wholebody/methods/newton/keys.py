"""What the members of a batch of equations have in common."""

from __future__ import annotations

from typing import NamedTuple

OBJECTIVE = "objective"
"""Kind of batches whose squares are to be small, in place of holding."""


class Key(NamedTuple):
    """What a batch has in common: its type, whether it may be missed or is one-sided, and its weight."""

    kind: str
    goal: bool
    one_sided: bool
    weight: float
