"""What a count says of a share: an interval, for what was seen in 200 of 200 cases need not be so in the next."""

from __future__ import annotations

import math

NORMAL = 1.959963984540054  # quantile of the normal distribution for 95 %


def wilson(count: int, total: int) -> tuple[float, float]:
    """Return the 95 % interval of a share of which `count` of `total` were seen (Wilson 1927)."""
    if total == 0:
        return 0.0, 1.0
    share, square = count / total, NORMAL**2
    middle = share + square / (2 * total)
    spread = NORMAL * math.sqrt(share * (1.0 - share) / total + square / (4 * total * total))
    scale = 1.0 + square / total
    return max(0.0, (middle - spread) / scale), min(1.0, (middle + spread) / scale)
