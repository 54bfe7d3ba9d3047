"""A person raises the arms under a ball that is thrown, catches it and holds it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from presenting import CARDBOARD, command_line

import wholebody as wb
from wholebody.view.side_by_side import write_filmstrip
from wholebody.view.viewed_scene import ViewedWorld

DT = 1.0 / 60.0  # s
MASS = 0.4  # kg
FLIGHT = 0.6  # s: from the throw to the arms
FROM, TO = np.array([2.4, 0.0, 1.0]), np.array([0.38, 0.0, 1.3])  # m
LOWERED, HOLDING = (-1.2, 0.6), (-0.75, 0.9)  # rad: of shoulders and elbows, beside arms that point ahead


def arms(person: wb.Figure, turns: tuple[float, float]) -> np.ndarray:
    """A posture whose shoulders and elbows are flexed by these angles beside arms that point ahead."""
    start = person.posture("arms_forward")
    now = person.joint_values(start)
    names = zip(("shoulder_flexion", "elbow_flexion"), turns, strict=True)
    moved = {f"{side}_{name}": turn for name, turn in names for side in ("left", "right")}
    return person.with_joints(start, {name: now[name] + turn for name, turn in moved.items()})


def build() -> tuple[wb.World, list[np.ndarray]]:
    """The person and the ball, and the tracker's way of the arms."""
    person = wb.load("avatar")
    low, high = arms(person, LOWERED), arms(person, HOLDING)
    scene = wb.Scene(person).add(wb.HalfSpace(), name="floor")
    velocity = (TO - FROM) / FLIGHT + [0.0, 0.0, 0.5 * 9.81 * FLIGHT]
    ball = wb.Body(mass=MASS, material="human", velocity=tuple(velocity))
    scene.add(wb.Sphere(0.15), name="ball", at=tuple(FROM), color=CARDBOARD, body=ball)
    shares = np.clip((DT * np.arange(120) - 0.17) / 0.43, 0.0, 1.0)  # raised from 0.17 s to the end of the flight
    way = [low + share**2 * (3.0 - 2.0 * share) * (high - low) for share in shares]
    return wb.World(scene, low, dt=DT, spring=wb.Actuated(person)), way


def main(out: Path = Path("pictures"), pictures: bool = True) -> float:
    """Run, report and draw; return how fast the ball is at the end, m/s."""
    world, way = build()
    frames = [world.step(q) for q in way]
    places = [frame.placements["ball"].translation for frame in frames]
    speed = float(np.linalg.norm(places[-1] - places[-2])) / DT
    borne = frames[-1].impulses["ball"][2] / (MASS * 9.81 * DT)
    print(f"Catch: at the end the ball moves by {1e3 * speed:.2f} mm/s, and the person bears {borne:.3f} of its weight")
    if pictures:
        viewed = ViewedWorld(world.scene, frames[-1].placements)
        motion = [viewed.configuration(frame.q, frame.placements) for frame in frames]
        out.mkdir(parents=True, exist_ok=True)
        with wb.Viewer(viewed, contact_distance=0.0, title="Catch") as viewer:
            viewer.look(eye=(1.6, -5.6, 1.7), target=(0.5, 0.0, 1.0))
            viewer.play(motion, DT)
            print(f"  {viewer.save(out / 'catch_a_ball.html')}")
            try:
                print(f"  {write_filmstrip(viewer, [motion[k] for k in (5, 22, 34, 110)], out / 'catch_a_ball.png')}")
            except wb.MissingPackageError as error:
                print(f"  no picture: {error}")
    return speed


if __name__ == "__main__":
    command_line(main, __doc__)
