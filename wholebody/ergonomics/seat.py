"""Whether somebody sits: told by `Work`, by what is below pelvis and thighs in a scene, or by the posture."""

from __future__ import annotations

from dataclasses import replace
from math import radians
from typing import NamedTuple

from wholebody.base.arrays import Array
from wholebody.ergonomics.angles import BodyAngles, body_angles
from wholebody.ergonomics.work import Work, check_work
from wholebody.figures.figure import Figure
from wholebody.scene.scene import Scene

SEATED = ("pelvis", "left_thigh", "right_thigh")
TRUNK = ("thorax", "upper_lumbar", "lower_lumbar")


class Seen(NamedTuple):
    """What the scores are made of.

    Attributes:
        figure: the person.
        angles: of the body.
        work: with `seated` and `back_supported` told.
        seat: words for how they were told.
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
    seat, rest = _bearers(body, q, angles) if isinstance(body, Scene) and not asked.walking else (None, None)
    if asked.seated is not None:
        told, sits = "as Work says", asked.seated
    elif seat is not None:
        told, sits = f"as {seat} is below pelvis or thighs", True
    else:
        told, sits = "by the posture", asked.sits(angles) and not asked.walking
    words = f"{'sits' if sits else 'does not sit'}, {told}"
    if sits and asked.back_supported is None and rest is not None:
        words += f"; the back is at {rest}"
    back = rest is not None if asked.back_supported is None else asked.back_supported
    return Seen(figure, angles, replace(asked, seated=sits, back_supported=back), words)


def _bearers(scene: Scene, q: Array, angles: BodyAngles) -> tuple[str | None, str | None]:
    """Names of the things nearest below pelvis or thighs and at the trunk; no seat for who lies."""
    # of the trunk against the vertical: who is beyond lies
    lies = max(abs(angles.trunk_flexion), abs(angles.trunk_lateral)) > radians(70.0)
    # m: up to which a body rests on a thing, as the viewer colours contacts
    found, seat, rest = scene.contacts(q, within=0.005), None, None
    for (one, other), normal in zip(found.pair, found.normal, strict=True):
        owners = scene.piece_owner[one], scene.piece_owner[other]
        for thing, segment, up in ((*owners, normal[2]), (*owners[::-1], -normal[2])):
            if thing not in scene.objects or scene.objects[thing].segment is not None:
                continue  # what is carried bears nobody
            # upward part of a contact's unit normal, from which the thing is rather below than beside
            if segment in SEATED and up > 0.5 and not lies:
                seat = seat or thing
            if segment in TRUNK:
                rest = rest or thing
    return seat, rest
