"""Cells that an audit showed to be the fault of our adapters: what the tool makes of the case when it is used alone."""

from __future__ import annotations

from wholebody.bench.stability.verdict import Verdict

ALONE: dict[tuple[str, str], str] = {
    ("inside-obstacle", "mink"): "alone, mink stays outside (0 mm inside)",
    ("edge-on-edge", "mink"): "alone, mink stays outside (0 mm inside)",
    ("narrow-passage", "mink"): "alone, mink solves it with a minimum distance of 0.3 mm",
    ("100-m-scale", "mink"): "alone, mink solves it with its distances scaled by 100",
    ("dt-10-ms", "mink"): "alone, mink solves it",
    ("dt-1-s", "mink"): "alone, mink solves it",
    ("100-m-scale", "pink"): "alone, pink solves it",
    (
        "narrow-passage",
        "pink",
    ): "alone, pink solves it with d_min 0.5 mm; our margin of 1 mm is all the room of the slot",
    ("moving-obstacle", "pink"): "alone, pink solves it with its default d_min of 2 cm and 10 steps a frame",
}
"""What a tool does by itself, by case and method."""


def audited(case: str, method: str, verdict: Verdict) -> Verdict:
    """The verdict, but "adapter" in place of "wrong" where the tool alone does better."""
    if verdict.kind != "wrong" or (case, method) not in ALONE:
        return verdict
    return verdict._replace(kind="adapter", figure=f"{verdict.figure}; {ALONE[case, method]}")
