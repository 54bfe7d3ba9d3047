"""`wholebody clip info`: what a file of motion holds."""

from __future__ import annotations

import argparse

from wholebody.cli.clip.arguments import ONE_MOTION, clip_of
from wholebody.cli.command import command


@command(
    "info",
    "what a file of motion holds",
    """\
Say what a file of motion holds: figure, frames, time step, duration, and of the joints that move most their range and
greatest speed.""",
    *ONE_MOTION,
)
def run(arguments: argparse.Namespace) -> int:
    """Describe the clip."""
    import numpy as np
    from rich.console import Console
    from rich.markup import escape

    from wholebody.cli.tables import table

    clip = clip_of(arguments)
    figure, console = clip.figure, Console()
    rate = 1.0 / clip.dt
    console.print(
        f"[bold]{escape(clip.name)}[/]: {len(clip)} frames at {rate:.4g} Hz, {clip.duration:.3f} s, "
        f"{escape(figure.name)} with {figure.model.nv} degrees of freedom",
        highlight=False,
    )
    outside = sum(not figure.within_limits(q, 1e-6) for q in clip.q)
    console.print(f"frames beyond joint limits: {outside}", highlight=False)
    speeds = np.abs(clip.velocities()).max(axis=0)
    values = [figure.joint_values(q) for q in clip.q]
    made = table("joints that move most", "from", "to", "greatest speed")
    ranges = {name: [frame[name] for frame in values] for name in values[0]}
    for name in sorted(ranges, key=lambda name: min(ranges[name]) - max(ranges[name]))[:12]:
        slides = figure.model.joints[figure.joint_id(name)].shortname().startswith("JointModelP")
        unit, factor = ("m", 1.0) if slides else ("deg", float(np.degrees(1.0)))
        low, high = (factor * end for end in (min(ranges[name]), max(ranges[name])))
        speed = factor * float(speeds[figure.dofs([name])].max())
        made.add_row(escape(name), f"{low:.4g} {unit}", f"{high:.4g} {unit}", f"{speed:.4g} {unit}/s")
    console.print(made)
    return 0
