"""Random MJCF files: trees with joints of every kind, references, ranges, sites, a table, and an equality."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator


def mjcf(seed: int) -> str:
    """The text of a file."""
    rng = np.random.default_rng(seed)
    degrees, free = rng.random() < 0.5, rng.random() < 0.4
    joints: list[str] = []
    tree = _body(rng, 0, degrees, free, [0], joints)
    hinges = [name for name in joints if name.startswith("hinge")]
    equality = ""
    if len(hinges) > 1 and rng.random() < 0.5:
        first, second = hinges[:2] if rng.random() < 0.5 else hinges[1::-1]
        slope = rng.choice([-1.5, 0.5, 1.0])
        equality = f'<joint joint1="{first}" joint2="{second}" polycoef="0.1 {slope} 0 0 0"/>'
    return (
        f'<mujoco model="m{seed}"><compiler angle="{"degree" if degrees else "radian"}"/>'
        f'<worldbody><geom type="plane" size="1 1 .1"/></worldbody><worldbody>{tree}'
        '<body name="table" pos="2 0 0"><geom type="box" size=".1 .1 .1"/></body></worldbody>'
        f"<equality>{equality}</equality></mujoco>"
    )


def _body(rng: Generator, depth: int, degrees: bool, free: bool, count: list[int], joints: list[str]) -> str:
    number = count[0]
    count[0] += 1
    name = f'name="b{number}"' if rng.random() < 0.8 else ""
    turn = rng.choice(["", f'quat="{_numbers(rng, 4, 1.0)}"', f'euler="{_numbers(rng, 3, 40.0 if degrees else 0.7)}"'])
    text = f'<body {name} pos="{_numbers(rng)}" {turn}>'
    if depth == 0 and free:
        text += str(rng.choice(["<freejoint/>", '<joint type="free" name="away"/>']))
    elif depth < 2 or rng.random() < 0.85:
        kinds = rng.choice(["hinge", "slide"], 1 if rng.random() < 0.7 else 2, p=[0.7, 0.3]).tolist()
        kinds = ["ball"] if rng.random() < 0.1 else kinds
        text += "".join(_joint(rng, kind, f"{kind}{number}_{k}", degrees, joints) for k, kind in enumerate(kinds))
    for _ in range(rng.integers(1, 3)):
        kind = rng.choice(["box", "sphere", "capsule", "cylinder", "ellipsoid"])
        size = _text(rng.uniform(0.01, 0.06, {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3)))
        text += f'<geom type="{kind}" size="{size}" pos="{_numbers(rng, 3, 0.05)}" quat="{_numbers(rng, 4, 1.0)}"/>'
    if rng.random() < 0.4:
        text += f'<site name="s{number}" pos="{_numbers(rng)}" euler="{_numbers(rng, 3, 20.0)}"/>'
    for _ in range(rng.integers(0 if depth else 1, 3) if depth < 4 else 0):
        text += _body(rng, depth + 1, degrees, free, count, joints)
    return text + "</body>"


def _joint(rng: Generator, kind: str, name: str, degrees: bool, joints: list[str]) -> str:
    unit = 180.0 / np.pi if degrees and kind != "slide" else 1.0
    low, high = (0.0, rng.uniform(0.3, 2.0)) if kind == "ball" else (rng.uniform(-2.0, -0.1), rng.uniform(0.1, 2.0))
    limits = rng.choice(["", 'limited="true"', 'limited="false"'])
    limits = f'range="{_text([low * unit, high * unit])}" {limits}' if rng.random() < 0.6 else ""
    named = rng.random() < 0.9
    if named:
        joints.append(name)
    axis = rng.choice(["1 0 0", "0 1 0", "0 0 1", "0 0 -1", _numbers(rng, 3, 1.0)])
    anchor = f'pos="{_numbers(rng)}"' if rng.random() < 0.4 else ""
    reference = f'ref="{rng.uniform(-0.5, 0.5) * unit:.4f}"' if kind != "ball" and rng.random() < 0.3 else ""
    label = f'name="{name}"' if named else ""
    return f'<joint {label} type="{kind}" axis="{axis}" {anchor} {limits} {reference}/>'


def _numbers(rng: Generator, count: int = 3, size: float = 0.2) -> str:
    return _text(rng.normal(0.0, size, count))


def _text(values: object) -> str:
    return " ".join(f"{value:.5f}" for value in np.asarray(values))
