"""Lower and raise a scissor lift: its cylinder's load limit and a beam above stop it, both where formulas say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import CARDBOARD, DARK, OAK, STEEL, command_line, play

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.methods.newton import quaternions as quat

BAR, STAGES = 0.80, 2  # m: length of a bar; crossed pairs one above the other
START = np.radians(35.0)  # rad: of the bars to the horizontal
THICK = 0.03  # m: of the platform
CRATE = (0.30, 0.30, 0.30)  # m
BEAM = 1.60  # m: underside of the beam
STRONGEST = 2500.0  # N: of the cylinder, which pushes the lowest bar's sliding end along the floor
GRAVITY = 9.81
FRAMES = 60  # of a drag
Y = (0.0, 1.0, 0.0)
SIDE = 0.04  # m: the crossed bars are this far in front of and behind the middle
FLAT = (0.0, 0.5**0.5, 0.0, 0.5**0.5)  # a capsule's z along a bar's x


class CylinderLimit(wb.methods.AssemblyConstraint):
    """The horizontal cylinder at the foot of a scissor lift is strong enough for the load.

    With n stages of bars at the angle a, the load W rises by n L sin a while the cylinder moves by L cos a. So, by
    virtual work, its force is n W cos a / sin a, and at most F if sin a - (n W / F) cos a >= 0. The bar's axis
    (cos a, 0, sin a) is R(e) x, which is a polynomial of the quaternion.
    """

    one_sided = True

    def __init__(self, bar: str, ratio: float) -> None:
        """Take the name of the bar, and n W / F."""
        self.bodies, self.ratio = (bar,), ratio

    def residual(self, x: Array) -> Array:
        """(1,) sin a - (n W / F) cos a."""
        axis = quat.rotate(x[:, 3:], np.array([[1.0, 0.0, 0.0]]))
        return axis[:, 2] - self.ratio * axis[:, 0]

    def jacobian(self, x: Array) -> Array:
        """(1, 1, 7)."""
        result = np.zeros((1, 1, 7))
        slope = quat.rotate_derivative(x[:, 3:], np.array([[1.0, 0.0, 0.0]]))
        result[0, :, 3:] = slope[:, 2] - self.ratio * slope[:, 0]
        return result


def ratio(load: float) -> float:
    """Of n times the weight of a load [kg] to the cylinder's force."""
    return STAGES * load * GRAVITY / STRONGEST


def lowest(load: float) -> float:
    """Height of the platform's underside where the cylinder is just strong enough for a load [kg], metres."""
    return STAGES * BAR * float(np.sin(np.arctan(ratio(load))))


def highest() -> float:
    """Height of the platform's underside where the crate touches the beam, metres."""
    return BEAM - CRATE[2] - THICK


def build(load: float) -> wb.Assembly:
    """Bars, platform and crate; the platform's middle is driven by a goal."""
    wide, high = BAR * np.cos(START), BAR * np.sin(START)
    made = wb.Assembly()
    for stage in range(STAGES):
        for name, x, angle, y in (("rising", 0.0, START, SIDE), ("falling", wide, np.pi - START, -SIDE)):
            place = pin.SE3(pin.rpy.rpyToMatrix(0.0, -angle, 0.0), np.array((x, 0.0, stage * high)))
            rod = [(wb.Capsule(0.012, BAR), (0.5 * BAR, y, 0.0, *FLAT))]
            made.body(f"{name} {stage + 1}", place, shape=rod, color=STEEL if name == "rising" else DARK)
    top = STAGES * high
    plate = [(wb.Box((BAR + 0.1, 0.3, THICK)), (0.5 * BAR, 0.0, 0.5 * THICK))]
    made.body("platform", (0.0, 0.0, top), shape=plate, color=OAK)
    made.body("crate", (0.5 * BAR, 0.0, top + THICK + 0.5 * CRATE[2]), shape=wb.Box(CRATE), color=CARDBOARD)
    made.add(wb.Box((1.2, 0.1, 0.1)), name="beam", at=(0.4, 0.0, BEAM + 0.05), color=DARK)

    ends = np.array((BAR, 0.0, 0.0))
    made.revolute("world", "rising 1", at=(0.0, 0.0, 0.0), axis=Y)
    made.on_plane("falling 1", (0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), through=(0.0, 0.0, 0.0))
    for stage in range(1, STAGES + 1):
        rising, falling = f"rising {stage}", f"falling {stage}"
        made.revolute(rising, falling, at=made.placement(rising).act(0.5 * ends), axis=Y)
        if stage < STAGES:
            made.revolute(falling, f"rising {stage + 1}", at=made.placement(falling).act(ends), axis=Y)
            made.revolute(rising, f"falling {stage + 1}", at=made.placement(rising).act(ends), axis=Y)
    made.revolute(f"falling {STAGES}", "platform", at=(0.0, 0.0, top), axis=Y)
    made.on_plane(f"rising {STAGES}", ends, normal=(0.0, 0.0, 1.0), through=(0.0, 0.0, 0.0), of="platform")
    made.ignore(f"rising {STAGES}", "platform")  # the bars' round ends reach into the plate, where their rollers run
    made.fixed("platform", "crate")
    made.constrain(CylinderLimit("rising 1", ratio(load)))
    return made.point_goal("platform", (0.0, 0.0, top))


def drive(made: wb.Assembly, height: float) -> list[Array]:
    """Drag the platform to a height, or as far as it goes; the states."""
    begin, drag = made.placement("platform").translation[2], wb.tracking.Drag(made)
    states = [drag.to((0.0, 0.0, z)).q for z in np.linspace(begin, height, FRAMES + 1)[1:]]
    drag.finish()
    return [*states, drag.q]


def main(out: Path = Path("pictures"), pictures: bool = True) -> dict[float, tuple[float, float]]:
    """Lower and raise with two loads, compare with the formulas, and draw; returns both ends for each load [kg]."""
    found, chosen, states = {}, [], []
    for load in (30.0, 60.0):
        made = build(load)
        down = drive(made, 0.05)
        low = float(made.placement("platform").translation[2])
        up = drive(made, 1.6)
        high = float(made.placement("platform").translation[2])
        found[load] = low, high
        print(f"A scissor lift of {STAGES} stages under {load:.0f} kg: {len(made.bodies)} bodies")
        print(f"  the load limit stops it at {1e3 * low:.2f} mm, off the formula by {abs(low - lowest(load)):.1e} m")
        print(f"  the beam stops it at {1e3 * high:.2f} mm, off by {abs(high - highest()):.1e} m")
        states += [*down, *up]
        chosen += [down[-1]]
    if pictures:
        draw(made, [chosen[0], chosen[1], states[-1]], states, out)
    return found


def draw(made: wb.Assembly, chosen: list[Array], states: list[Array], out: Path) -> None:
    """Write scissor_lift.html, which plays both loads, and scissor_lift.png: lowest with either load, and highest."""
    play(
        "scissor_lift",
        made,
        states[::2],
        chosen,
        out,
        eye=(1.0, -3.5, 1.2),
        target=(0.4, 0.0, 0.8),
        size=(440, 560),
        dt=1 / 30,
    )


if __name__ == "__main__":
    command_line(main, __doc__)
