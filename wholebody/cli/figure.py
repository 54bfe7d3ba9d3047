"""`wholebody figure`: describe a figure, or write a person of given size as a URDF."""

from __future__ import annotations

import argparse
import math
from pathlib import Path
from typing import Any

from rich.markup import escape

from wholebody.base.errors import InputError
from wholebody.base.files import checked_ending
from wholebody.cli.arguments import person_options
from wholebody.cli.tables import console, table
from wholebody.figures import Figure, load
from wholebody.figures.anthropometry import make_person
from wholebody.figures.packaged_urdf import write_human


def run(arguments: argparse.Namespace) -> int:
    """Describe or write."""
    options = person_options(arguments)
    if arguments.out is not None:
        return _write(arguments.name, options, arguments.out)
    show_figure(load(arguments.name, **options))
    return 0


def _write(name: str, options: dict[str, Any], out: Path) -> int:
    if name != "human" or "detail" in options:
        raise InputError("--out writes the person in capsules; write: wholebody figure human --out FILE.urdf")
    checked_ending(out, "--out", "a person", (".urdf",))
    person = make_person(**{name: value for name, value in options.items() if name != "hands"})
    write_human(out, person, options.get("hands", "rigid"))
    print(f"wrote {out}: {person.sex}, {person.stature:.3f} m, {person.mass:.1f} kg")
    return 0


def show_figure(figure: Figure) -> None:
    """Describe a figure: size, names of joints, frames, groups and postures."""
    shown = console()
    model = figure.model
    mass = sum(inertia.mass for inertia in model.inertias)
    shown.print(
        f"[bold]{escape(figure.name)}[/]: {model.nv} degrees of freedom, {mass:.1f} kg, "
        f"{figure.geometry.ngeoms} pieces ({figure.detail}), "
        f"{len(figure.geometry.collisionPairs)} pairs that can touch, {figure.root} root\n",
        highlight=False,
    )
    names = table("names", "")
    names.columns[1].justify = "left"
    listed = {
        "postures": figure.postures,
        "groups": figure.groups,
        "frames": figure.frames,
        "segments": figure.segments,
    }
    for kind, known in listed.items():
        names.add_row(kind, escape(", ".join(known)))
    shown.print(names)
    joints = table("joint", "lowest", "highest")
    limits = figure.limits
    ranges = dict(zip(limits.idx_q.tolist(), zip(limits.lower, limits.upper, strict=True), strict=True))
    for name in figure.joints:
        if name in figure.followers:
            law = figure.followers[name]
            joints.add_row(name, f"{law.slope:g} x {law.joint}", f"+ {law.offset:g}")
            continue
        joint = model.joints[figure.joint_id(name)]
        low, high = ranges.get(joint.idx_q, (-math.inf, math.inf))
        slides = joint.shortname().startswith("JointModelP")
        joints.add_row(
            escape(name), *(f"{end:.3f} m" if slides else f"{math.degrees(end):.1f} deg" for end in (low, high))
        )
    shown.print(joints)
    if figure.notes:
        shown.print("\nnotes", style="dim")
    for note in figure.notes:
        shown.print(f"- {note}", markup=False, highlight=False)
