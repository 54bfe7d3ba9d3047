"""The published tables of the observation methods and of the lifting equation, `tables.json`.

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
