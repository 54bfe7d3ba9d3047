"""Whether somebody sits: told by `Work`, by what is below pelvis and thighs in a scene, or by the posture."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from typing import NamedTuple

from wholebody.arrays import Array
from wholebody.ergonomics.angles import BodyAngles, body_angles
from wholebody.ergonomics.work import Work, check_work
from wholebody.figures.figure import Figure
from wholebody.scene import Scene

SEATED = ("pelvis", "left_thigh", "right_thigh")
NEAR = 0.005  # m: up to which a body rests on a thing, as the viewer colours contacts
BELOW = 0.5  # upward part of a contact's unit normal, from which the thing is rather below than beside
RECLINED = radians(70.0)  # of the trunk against the vertical: who is beyond lies


class Seen(NamedTuple):
    """What the scores are made of.

    Attributes:
        figure: the person.
        angles: of the body.
        work: with `seated` told.
        seat: words for how it was told.
    """

    figure: Figure
    angles: BodyAngles
    work: Work
    seat: str


def seen(body: Figure | Scene, q: Array, work: Work | None, what: str) -> Seen:
    """A person's angles, and whether the person sits.

    Args:
        body: a person, or a scene with one.
        q: (nq,) posture.
        work: what the posture does not tell; the default if None.
        what: the caller, for messages.

    Raises:
        InputError: no person, no posture, or no work.
    """
    figure = body.figure if isinstance(body, Scene) else body
    angles, asked = body_angles(figure, q), check_work(work, f"{what}: work")
    if asked.seated is not None:
        return Seen(figure, angles, asked, ("sits" if asked.seated else "does not sit") + ", as Work says")
    thing = seat_of(body, q, angles) if isinstance(body, Scene) and not asked.walking else None
    if thing is not None:
        return Seen(figure, angles, replace(asked, seated=True), f"sits on {thing}, which is below pelvis or thighs")
    sits = asked.sits(angles) and not asked.walking
    return Seen(figure, angles, replace(asked, seated=sits), f"{'sits' if sits else 'does not sit'}, by the posture")


def seat_of(scene: Scene, q: Array, angles: BodyAngles) -> str | None:
    """Name of the thing nearest below pelvis or thighs, at most `NEAR` away; None without one, or for who lies."""
    if max(abs(angles.trunk_flexion), abs(angles.trunk_lateral)) > RECLINED:
        return None
    found = scene.contacts(q, within=NEAR)
    for (one, other), normal in zip(found.pair, found.normal, strict=True):
        owners = scene.piece_owner[one], scene.piece_owner[other]
        for thing, segment, up in ((*owners, normal[2]), (*owners[::-1], -normal[2])):
            if thing in scene.objects and segment in SEATED and up > BELOW:
                return thing
    return None
