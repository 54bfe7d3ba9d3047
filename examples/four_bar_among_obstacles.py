"""Turn a four-bar linkage among obstacles: it pushes a slider aside, and stops at a post; both as geometry says."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
from four_bar import COUPLER, CRANK, GROUND, ROCKER, Y, angle_of, bar, closed_form
from presenting import CARDBOARD, DARK, OAK, STEEL, command_line, play

import wholebody as wb
from wholebody.base.arrays import Array

RADIUS = 0.012  # m: of the bars
SLIDER = (0.08, 0.03, 0.06)  # m
SLIDER_FACE = 0.372  # m: where its face begins
POST, POST_RADIUS = (0.40 + 0.20 * np.cos(np.radians(140.0)), 0.20 * np.sin(np.radians(140.0))), 0.015  # m: in x and z
AWAY = (0.0, 0.5, 0.0)  # the post's place in the first turn
STEPS = 120  # of a turn
PLANE = -0.03  # m: y of crank, rocker, slider and post; the coupler moves in front of them
ALONG_X = (0.0, 0.5**0.5, 0.0, 0.5**0.5)  # a capsule's z along a bar's x
ALONG_Y = (0.5**0.5, 0.0, 0.0, 0.5**0.5)


def slider_end() -> float:
    """Where the slider's face ends: its lower edge on the rocker, when crank and coupler are in one line."""
    reach = CRANK + COUPLER
    inner = np.arccos((GROUND**2 + ROCKER**2 - reach**2) / (2.0 * GROUND * ROCKER))
    height, angle = ROCKER - 0.5 * SLIDER[2], np.pi - inner
    return GROUND + float(height / np.tan(angle) + RADIUS / np.sin(angle))


def rocker_at_post() -> float:
    """Angle of the rocker to x when it touches the post, radians."""
    away = np.array(POST) - (GROUND, 0.0)
    return float(np.arctan2(away[1], away[0]) - np.arcsin((RADIUS + POST_RADIUS) / np.linalg.norm(away)))


def build() -> wb.Assembly:
    """Three bars with four joints, a slider on a rail, a post; the crank is driven by a goal for its tip."""
    coupler, rocker = closed_form(0.0)

    def rod(length: float, y: float) -> list[tuple[wb.Shape, tuple[float, ...]]]:
        return [(wb.Capsule(RADIUS, length), (0.5 * length, y, 0.0, *ALONG_X))]

    made = wb.Assembly()
    made.body("crank", bar(0.0, 0.0, 0.0), shape=rod(CRANK, PLANE), color=DARK)
    made.body("coupler", bar(CRANK, 0.0, coupler), shape=rod(COUPLER, 0.0), color=STEEL)
    made.body("rocker", bar(GROUND, 0.0, rocker), shape=rod(ROCKER, PLANE), color=OAK)
    slider = SLIDER_FACE + 0.5 * SLIDER[0], PLANE, ROCKER
    made.body("slider", slider, shape=wb.Box(SLIDER), color=CARDBOARD)
    made.add(wb.Capsule(POST_RADIUS, 0.02), name="post", at=(*AWAY, *ALONG_Y), color=DARK)
    made.revolute("world", "crank", at=(0.0, 0.0, 0.0), axis=Y)
    made.revolute("crank", "coupler", at=(CRANK, 0.0, 0.0), axis=Y)
    made.revolute("coupler", "rocker", at=made.placement("coupler").act(np.array((COUPLER, 0.0, 0.0))), axis=Y)
    made.revolute("world", "rocker", at=(GROUND, 0.0, 0.0), axis=Y)
    made.prismatic("world", "slider", axis=(1.0, 0.0, 0.0))
    return made.point_goal("crank", (CRANK, 0.0, 0.0), place=(CRANK, 0.0, 0.0))


def turn(assembly: wb.Assembly, angles: Array) -> list[Array]:
    """Drag the crank's tip through angles until something stops it; the states, the first one included."""
    drag, states = wb.tracking.Drag(assembly), [assembly.q]
    for angle in angles:
        frame = drag.to(CRANK * np.array((np.cos(angle), 0.0, np.sin(angle))))
        states.append(frame.q)
        if frame.error > 1e-3:
            break
    drag.finish()
    return [*states, drag.q]


def free(assembly: wb.Assembly, states: list[Array]) -> bool:
    """Whether nothing touches deeper than a tenth of a millimetre on the way, by a continuous sweep."""
    return all(assembly.scene.sweep(a, b) is None for a, b in pairwise(states) if not (a == b).all())


def main(out: Path = Path("pictures"), pictures: bool = True) -> tuple[wb.Assembly, list[Array]]:
    """Turn once with the post away, then against the post; compare with the closed forms, and draw."""
    made = build()
    before = made.q
    states = turn(made, np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[1:])
    face = made.placement("slider").translation[0] - 0.5 * SLIDER[0]
    print(f"A four-bar linkage among obstacles: {len(states) - 2} frames of a turn")
    print(f"  the slider is pushed to {1e3 * face:.3f} mm, off its closed form by {abs(face - slider_end()):.1e} m")
    print(f"  nothing passes through anything: {free(made, states)}")
    made.move("post", at=(POST[0], PLANE - 0.01, POST[1], *ALONG_Y))
    against = turn(made, np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[1:])
    stopped = angle_of(made.placement("rocker"))
    print(f"  the post stops the rocker at {np.degrees(stopped):.3f} degrees,", end=" ")
    print(f"off its closed form by {abs(stopped - rocker_at_post()):.1e} rad; {made.structures} patterns analysed")
    print(f"  nothing passes through anything: {free(made, against)}")
    if pictures:
        draw(made, before, states, against, out)
    return made, [*states, *against]


def draw(made: wb.Assembly, before: Array, states: list[Array], against: list[Array], out: Path) -> None:
    """Write four_bar_among_obstacles.html, which plays the second turn, and .png: start, after a turn, at the post."""
    chosen = [before, states[-1], against[-1]]
    play(
        "four_bar_among_obstacles",
        made,
        against,
        chosen,
        out,
        eye=(0.12, -1.15, 0.33),
        target=(0.14, 0.0, 0.13),
        size=(480, 420),
        dt=1 / 30,
    )


if __name__ == "__main__":
    command_line(main, __doc__)
