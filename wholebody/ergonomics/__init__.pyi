from wholebody.ergonomics.angles import BodyAngles as BodyAngles, body_angles as body_angles
from wholebody.ergonomics.assessment import Ergonomics as Ergonomics, ergonomics_of as ergonomics_of
from wholebody.ergonomics.exertion import (
    Exertion as Exertion,
    StaticTorques as StaticTorques,
    StrengthLimit as StrengthLimit,
    back_compression as back_compression,
    static_torques as static_torques,
)
from wholebody.ergonomics.lifting import Lift as Lift, lift_between as lift_between
from wholebody.ergonomics.vision import Look as Look
from wholebody.ergonomics.observation import (
    Owas as Owas,
    Reba as Reba,
    RebaParts as RebaParts,
    Rula as Rula,
    RulaParts as RulaParts,
    owas as owas,
    reba as reba,
    rula as rula,
)
from wholebody.ergonomics.vision import FieldOfView as FieldOfView, Sight as Sight, sight as sight
from wholebody.ergonomics.work import Work as Work
from wholebody.tasks.forces import LoadedBalance as LoadedBalance
