"""Scores of both sides, and the published tables of observation methods and the lifting equation, `tables.json`.

RULA: tables A (upper arm 1 to 6, lower arm 1 to 3, wrist 1 to 4, wrist twist 1 or 2), B (neck 1 to 6, trunk 1 to 6,
legs 1 or 2) and C (score C 1 to 8 and more, score D 1 to 7 and more), and the greatest score of each action level.
REBA: tables A (neck 1 to 3, trunk 1 to 5, legs 1 to 4), B (upper arm 1 to 6, lower arm 1 or 2, wrist 1 to 3) and C
(score A and score B, 1 to 12), and the greatest score of each action level.
OWAS: words of the code's digits, and action categories by back and arms, in a text by legs and for each by load.
NIOSH: lifts a minute of table 5; rows of the greatest duration in hours and the frequency multipliers with the hands
below 75 cm, and at 75 cm or above; coupling multipliers of table 7, below 75 cm, and at 75 cm or above.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any


@cache
def published(method: str) -> dict[str, Any]:
    """The tables of "rula", "reba", "owas" or "niosh"."""
    tables: dict[str, dict[str, Any]] = json.loads(Path(__file__).with_name("tables.json").read_text("utf-8"))
    return tables[method]


def action(method: str, score: int) -> str:
    """What the paper of "rula" or "reba" says of a score."""
    return str(next(words for greatest, words in published(method)["actions"] if score <= greatest))


@dataclass(frozen=True)
class BothSides:
    """Scores of both sides, of which the worse one counts."""

    left: Any  # the parts of each side
    right: Any

    @property
    def worse(self) -> str:
        """The side with the greater score; "right" where they are equal."""
        return "left" if self.left.score > self.right.score else "right"

    @property
    def score(self) -> int:
        """The greater score of both sides."""
        return int(max(self.left.score, self.right.score))

    @property
    def action(self) -> str:
        """What the paper says of the greater score."""
        return str(getattr(self, self.worse).action)
