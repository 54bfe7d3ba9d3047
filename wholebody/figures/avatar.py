"""The avatar: two arms and two legs of seven joints and a neck of three, on a rigid torso (Schmidl & Lin).

It is the person with spine, shoulder girdle and upper neck fixed.
"""

from __future__ import annotations

from dataclasses import replace

from wholebody.figures.anthropometry import Body, body
from wholebody.figures.blueprint import Blueprint
from wholebody.figures.figure import Figure
from wholebody.figures.human import blueprint
from wholebody.figures.human_figure import figure_of

RIGID = ("spine", "neck2", "left_clavicle", "right_clavicle")
"""Beginnings of the names of the joints that the avatar does not have."""


def avatar_blueprint(person: Body | None = None, detail: str = "capsules") -> Blueprint:
    """Return the blueprint of an avatar; arguments as for the person."""
    person = person or body()
    whole = blueprint(person, detail)
    joints = tuple(joint._replace(axis=None) if joint.name.startswith(RIGID) else joint for joint in whole.joints)
    return replace(whole, name="avatar", joints=joints)


def avatar_figure(
    sex: str = "male", stature: float | None = None, mass: float | None = None, detail: str = "capsules"
) -> Figure:
    """Return the avatar; arguments as for the person."""
    return figure_of(avatar_blueprint(body(sex, stature, mass), detail), detail)
