"""Turn the crank of a four-bar linkage once: a closed loop, compared with its closed-form solution."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
from presenting import DARK, OAK, STEEL, command_line

import wholebody as wb
from wholebody.base.arrays import Array
from wholebody.bench import plot_style as style

GROUND, CRANK, COUPLER, ROCKER = 0.40, 0.12, 0.36, 0.28  # m: a crank-rocker, for 0.12 + 0.40 < 0.36 + 0.28
TRACER = np.array((0.18, 0.0, 0.16))  # m: the point of the coupler whose curve is drawn
STEPS = 90  # of a turn
Y = (0.0, 1.0, 0.0)  # all axes are along y; the linkage moves in the plane of x and z


def closed_form(angle: float) -> tuple[float, float]:
    """Angles of coupler and rocker to x at a crank angle, radians, by the law of cosines; the open branch."""
    joint = CRANK * np.array((np.cos(angle), np.sin(angle)))
    across = np.array((GROUND, 0.0)) - joint
    length = float(np.linalg.norm(across))
    inner = np.arccos((length**2 + COUPLER**2 - ROCKER**2) / (2.0 * length * COUPLER))
    coupler = np.arctan2(across[1], across[0]) + inner
    end = joint + COUPLER * np.array((np.cos(coupler), np.sin(coupler)))
    return float(coupler), float(np.arctan2(end[1], end[0] - GROUND))


def bar(x: float, z: float, angle: float) -> pin.SE3:
    """Placement of a bar whose first end is at (x, z), at an angle to x in the plane; turns about y lower z."""
    return pin.SE3(pin.rpy.rpyToMatrix(0.0, -angle, 0.0), np.array((x, 0.0, z)))


def angle_of(place: pin.SE3) -> float:
    """Angle of a bar to x, radians."""
    return float(np.arctan2(place.rotation[2, 0], place.rotation[0, 0]))


def build() -> wb.Assembly:
    """Three bars with four joints; the crank is driven by a goal for its tip."""
    coupler, rocker = closed_form(0.0)
    assembly = wb.Assembly()
    assembly.body("crank", bar(0.0, 0.0, 0.0), size=CRANK)
    assembly.body("coupler", bar(CRANK, 0.0, coupler), size=COUPLER)
    assembly.body("rocker", bar(GROUND, 0.0, rocker), size=ROCKER)
    assembly.revolute("world", "crank", at=(0.0, 0.0, 0.0), axis=Y)
    assembly.revolute("crank", "coupler", at=(CRANK, 0.0, 0.0), axis=Y)
    tip = assembly.placement("coupler").act(np.array((COUPLER, 0.0, 0.0)))
    assembly.revolute("coupler", "rocker", at=tip, axis=Y)
    return assembly.revolute("world", "rocker", at=(GROUND, 0.0, 0.0), axis=Y)


def turn(assembly: wb.Assembly) -> tuple[Array, list[dict[str, pin.SE3]]]:
    """Turn the crank once: returns crank angles (n,), and the placements of the bars at each."""
    angles, places = np.linspace(0.0, 2.0 * np.pi, STEPS + 1), []
    for angle in angles:
        tip = CRANK * np.array((np.cos(angle), 0.0, np.sin(angle)))
        solution = assembly.drop_goals().point_goal("crank", tip, place=(CRANK, 0.0, 0.0)).solve(tolerance=1e-10)
        if solution.status != "solved":
            raise wb.WholebodyError(f"at {np.degrees(angle):.0f} degrees: {solution.message}")
        places.append(solution.placements)
    return angles, places


def main(out: Path = Path("pictures"), pictures: bool = True) -> list[dict[str, pin.SE3]]:
    """Turn, compare with the closed form, and draw."""
    angles, places = turn(build())
    found = np.unwrap([[angle_of(place[name]) for name in ("coupler", "rocker")] for place in places], axis=0)
    exact = np.unwrap([closed_form(angle) for angle in angles], axis=0)
    curve = np.array([place["coupler"].act(TRACER) for place in places])
    print(f"A four-bar linkage: {STEPS} steps of {360 / STEPS:g} degrees, {len(places[0])} bodies, 4 joints, one loop")
    print(f"  coupler and rocker are off their closed form by {np.abs(found - exact).max():.1e} rad at most")
    print(f"  after a turn the coupler's point is {np.linalg.norm(curve[-1] - curve[0]):.1e} m from where it began")
    print(f"  the rocker swings by {np.degrees(np.ptp(found[:, 1])):.1f} degrees")
    if pictures:
        draw(angles, places, found, exact, curve, out)
    return places


def drawn() -> wb.Assembly:
    """The bars as they are drawn: bodies of the same names without joints, and two posts that represent the ground."""

    def rod(end: Array, y: float, radius: float) -> tuple[wb.Shape, pin.SE3]:
        turn = 0.5 * np.pi - np.arctan2(end[2], end[0])  # the capsule's z along the bar
        middle = pin.SE3(pin.rpy.rpyToMatrix(0.0, turn, 0.0), 0.5 * end + (0.0, y, 0.0))
        return wb.Capsule(radius, float(np.linalg.norm(end))), middle

    x = np.array((1.0, 0.0, 0.0))
    coupler = [rod(COUPLER * x, 0.0, 0.012), rod(TRACER, 0.0, 0.007), (wb.Sphere(0.014), TRACER)]
    made = wb.Assembly().body("crank", shape=[rod(CRANK * x, -0.03, 0.012)], color=DARK)
    made.body("coupler", shape=coupler, color=STEEL).body("rocker", shape=[rod(ROCKER * x, -0.03, 0.012)], color=OAK)
    for name, at in (("left post", 0.0), ("right post", GROUND)):
        made.add(wb.Box((0.06, 0.1, 0.03)), name=name, at=(at, 0.0, -0.03), color=DARK)
    return made


def draw(
    angles: Array, places: list[dict[str, pin.SE3]], found: Array, exact: Array, curve: Array, out: Path
) -> None:  # fmt: skip
    """Write four_bar.html, which plays the turn, and four_bar.png: the coupler's curve and the rocker's angle."""
    out.mkdir(parents=True, exist_ok=True)
    shown = drawn()
    with wb.Viewer(shown, contact_distance=-1.0, title="Four bar") as viewer:  # no contacts: bars overlap at joints
        viewer.look(eye=(0.2, -1.2, 0.35), target=(0.18, 0.0, 0.12))
        postures = [np.concatenate([pin.SE3ToXYZQUAT(place[name]) for name in shown.bodies]) for place in places]
        viewer.play(postures, dt=1 / 30)
        print(f"  {viewer.save(out / 'four_bar.html')}")
    try:
        chart, ((left, right),) = style.figure(1, 2, (9.6, 4.2))
    except wb.MissingPackageError as error:
        print(f"  no picture: {error}")
        return
    for place, shade in zip(places[:-1:15], (0.8, 0.7, 0.6, 0.5, 0.4, 0.3), strict=True):
        joints = [np.zeros(3), place["coupler"].translation, place["coupler"].act(np.array((COUPLER, 0.0, 0.0)))]
        joints.append(np.array((GROUND, 0.0, 0.0)))
        x, _, z = np.array(joints).T
        left.plot(x, z, "-o", color=str(shade), markersize=3, linewidth=1.2)
        x, _, z = np.array([joints[1], place["coupler"].act(TRACER), joints[2]]).T
        left.plot(x, z, color=str(shade), linewidth=0.7)
    left.plot(curve[:, 0], curve[:, 2], color="#d55e00", linewidth=1.8, label="a point of the coupler")
    left.set(aspect="equal", xlabel="x [m]", ylabel="z [m]", title="six positions of the linkage")
    left.legend(loc="lower right", frameon=False)
    right.plot(np.degrees(angles), np.degrees(exact[:, 1]), color="#0072b2", label="closed form")
    right.plot(np.degrees(angles[::5]), np.degrees(found[::5, 1]), "o", color="#d55e00", markersize=4, label="solved")
    right.set(xlabel="crank [degrees]", ylabel="rocker [degrees]", title="angle of the rocker", xlim=(0, 360))
    right.set_xticks(range(0, 361, 90))
    right.legend(frameon=False)
    print(f"  {style.save(chart, out / 'four_bar')[1]}")


if __name__ == "__main__":
    command_line(main, __doc__)
