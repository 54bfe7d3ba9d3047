"""Ergonomics of postures: RULA, REBA, OWAS, the NIOSH lifting equation, torques against strength, the field of view."""

from __future__ import annotations

from typing import TYPE_CHECKING

from wholebody.base.imports import exported

if TYPE_CHECKING:
    from wholebody.ergonomics.angles import BodyAngles, body_angles
    from wholebody.ergonomics.assessment import Ergonomics, ergonomics_of
    from wholebody.ergonomics.exertion import Exertion, StrengthLimit, back_compression
    from wholebody.ergonomics.lifting import Lift, lift_between
    from wholebody.ergonomics.looking import Look
    from wholebody.ergonomics.owas_score import Owas, owas
    from wholebody.ergonomics.posture_torques import StaticTorques, static_torques
    from wholebody.ergonomics.reba_score import Reba, RebaParts, reba
    from wholebody.ergonomics.rula_score import Rula, RulaParts, rula
    from wholebody.ergonomics.vision import FieldOfView, Sight, sight
    from wholebody.ergonomics.work import Work
    from wholebody.tasks.forces import LoadedBalance

__all__ = [
    "BodyAngles",
    "Ergonomics",
    "Exertion",
    "FieldOfView",
    "Lift",
    "LoadedBalance",
    "Look",
    "Owas",
    "Reba",
    "RebaParts",
    "Rula",
    "RulaParts",
    "Sight",
    "StaticTorques",
    "StrengthLimit",
    "Work",
    "back_compression",
    "body_angles",
    "ergonomics_of",
    "lift_between",
    "owas",
    "reba",
    "rula",
    "sight",
    "static_torques",
]

__getattr__, __dir__ = exported(
    __name__,
    {
        "wholebody.ergonomics.angles": "BodyAngles body_angles",
        "wholebody.ergonomics.assessment": "Ergonomics ergonomics_of",
        "wholebody.ergonomics.exertion": "Exertion StrengthLimit back_compression",
        "wholebody.ergonomics.lifting": "Lift lift_between",
        "wholebody.ergonomics.looking": "Look",
        "wholebody.ergonomics.owas_score": "Owas owas",
        "wholebody.ergonomics.reba_score": "Reba RebaParts reba",
        "wholebody.ergonomics.rula_score": "Rula RulaParts rula",
        "wholebody.ergonomics.posture_torques": "StaticTorques static_torques",
        "wholebody.ergonomics.vision": "FieldOfView Sight sight",
        "wholebody.ergonomics.work": "Work",
        "wholebody.tasks.forces": "LoadedBalance",
    },
)
