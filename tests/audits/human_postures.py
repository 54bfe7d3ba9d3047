"""Postures of people as publications have them, beside those of the median man in the same tasks.

The table `postures.csv` has mean angles and how people differ. Each task is stated as people were asked to do it: what
hands, feet and seat are at. Sizes of things that a source does not state are estimates, and written here.
"""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from tests.audits.human_tasks import DOWN, FRONT, LEFT, RIGHT, UP, add_seat
from wholebody.base.arrays import Array

if TYPE_CHECKING:
    from wholebody.figures.figure import Figure
    from wholebody.problem import Problem

TABLE = Path(__file__).with_name("postures.csv")
SIDES = (("left", 1.0), ("right", -1.0))
PITCH = 0.01905  # m between keys
KEYS = {"index": 1.5, "middle": 2.5, "ring": 3.5, "little": 4.5}  # of the home row from between F and J, pitches
LUMBAR = ("spine1_flexion", "spine2_flexion", "spine3_flexion")
STOOP, RANGE = 35.9, 64.0
"""Lordosis that people lose in a stoop (von Arx et al. 2021), and what the lumbar joints bend by at most, degrees."""

THORACIC = ("spine3_flexion", "spine4_flexion")
STRAIGHT = {"wrist_flexion": 0.0, "wrist_deviation": 0.0}  # so that no target depends on how a wrist rests
STRUCK, COLUMN = 3.0, 10.0
"""Weights of each finger's meeting its key between tip and pad, and of its bending in the plane of its column, where
the keys above and below its own are: of 1, 3, 10, 30 and 100 for either those with the least error of the half "fit".
"""
HIGH = 1000.0  # weight of raised fingertips' height: from 300 to 10,000 the thorax is extended by 6 to 10 degrees
SOLE = np.radians(25.0)  # of pedals from level: those of examples/driver.py


@dataclass(frozen=True)
class PostureRow:
    """One angle of people and ours.

    Attributes:
        half: "fit" if weights are fitted to it, "kept" if they are judged by it.
        posture, angle: what is measured.
        mean, sd: of people, degrees.
        spread: "sd", "range" where the source has a range alone, or "class" where it has the class of most people.
        source: the publication.
        ours: the median man's, degrees.
        status: of the solution.
    """

    half: str
    posture: str
    angle: str
    mean: float
    sd: float
    spread: str
    source: str
    ours: float
    status: str

    @property
    def off(self) -> float:
        """How far ours is from the mean, in standard deviations of people."""
        return abs(self.ours - self.mean) / self.sd


def median_man() -> dict[str, Figure]:
    """The median man with hands of both kinds."""
    import wholebody as wb

    return {"rigid": wb.load("human"), "fingers": wb.load("human", hands="fingers")}


def summary(rows: Sequence[PostureRow]) -> str:
    """How many angles of each half are within a standard deviation of people, and the mean distance.

    An angle of a posture that is not solved is not within one.
    """
    told = []
    for half in dict.fromkeys(row.half for row in rows):
        off = np.array([row.off if row.status == "solved" else max(row.off, 1.0) for row in rows if row.half == half])
        told.append(f"{half} {int((off < 1.0).sum())} of {len(off)} angles within one, {off.mean():.2f} on average")
    return "; ".join(told)


def published() -> list[dict[str, str]]:
    """The rows of the table."""
    with TABLE.open(encoding="utf-8") as file:
        return list(csv.DictReader(line for line in file if not line.startswith("#")))


def measure(figures: Mapping[str, Figure], half: str | None = None) -> Iterator[PostureRow]:
    """Solve the tasks and compare their angles.

    Args:
        figures: "rigid" and "fingers": the median man with hands of both kinds.
        half: "fit" or "kept" for one half of the data alone.
    """
    import wholebody as wb

    answers: dict[str, tuple[Figure, Array, str]] = {}
    for row in published():
        if half not in (None, row["half"]):
            continue
        name = row["posture"]
        if name not in answers:
            figure = figures["fingers" if name == "typing" else "rigid"]
            problem = TASKS[name](figure)
            solution = wb.solve(problem)
            answers[name] = figure, _own(figure, problem, solution.q), str(solution.status)
        figure, q, status = answers[name]
        numbers = {"mean": float(row["mean"]), "sd": float(row["sd"])}
        yield PostureRow(**{**row, **numbers}, ours=angle(figure, q, row["angle"]), status=status)  # type: ignore[arg-type]


def _own(figure: Figure, problem: Problem, q: Array) -> Array:
    """The posture of a person alone, who may be one of several figures named "one"."""
    joined: Any = problem.scene.figure
    if joined is figure:
        return q
    values = joined.joint_values(q)
    own = figure.with_joints(figure.neutral, {name: values[f"one/{name}"] for name in figure.joints})
    root = joined.model.joints[joined.roots["one/root"]].idx_q
    own[:7] = q[root : root + 7]
    return own


def angle(figure: Figure, q: Array, name: str) -> float:
    """An angle of a posture by its name in the table, degrees; of trunk and hips from those of upright people."""
    import wholebody as wb

    angles = wb.ergonomics.body_angles(figure, q)
    side = angles.left if name.startswith("left") else angles.right
    values = figure.joint_values(q)

    def bent(*joints: str) -> float:
        return sum(values[joint] for joint in joints)

    arm = np.arccos(np.cos(side.shoulder_abduction) * np.cos(side.shoulder_flexion))
    found: dict[str, Callable[[], float]] = {
        "wrist extension": lambda: -side.wrist_flexion,
        "wrist ulnar deviation": lambda: -side.wrist_deviation,
        "forearm pronation": lambda: side.forearm_twist,
        "elbow flexion": lambda: side.elbow_flexion,
        "elbow angle": lambda: np.pi - side.elbow_flexion,
        "arm elevation": lambda: float(arm),
        "arm to trunk": lambda: side.shoulder_flexion,
        "knee angle": lambda: np.pi - side.knee_flexion,
        "foot to shank": lambda: 0.5 * np.pi - values["right_ankle_dorsiflexion"],
        "trunk to thigh": lambda: np.pi - values["right_hip_flexion"] - bent(*LUMBAR),
        "trunk to vertical": lambda: -angles.trunk_flexion,
        "pelvis on the thighs": lambda: bent("right_hip_flexion"),
        "hip flexion": lambda: bent("right_hip_flexion"),
        "lordosis lost": lambda: bent(*LUMBAR) * STOOP / RANGE,
        "thoracic extension": lambda: -bent(*THORACIC),
    }
    return float(np.degrees(found[name.removeprefix("left ").removeprefix("right ")]()))


def typing(figure: Figure) -> Problem:
    """Eight fingertips on the home row of a keyboard at the height of the elbow, where forearms are level."""
    import wholebody as wb

    q = figure.posture("sitting")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    add_seat(scene, figure, q)
    elbow = figure.placement(q, "right_elbow").translation
    goals: list[Any] = []
    struck: list[Any] = []
    constraints: list[Any] = [wb.Hold("pelvis"), wb.Hold("left_foot"), wb.Hold("right_foot")]
    bent = {"shoulder_flexion": 0.0, "elbow_flexion": np.pi / 2, "elbow_pronation": np.pi / 2 - 0.2, **STRAIGHT}
    level = figure.with_joints(q, {f"right_{joint}": value for joint, value in bent.items()})
    row = float(figure.placement(level, "right_middle_tip").translation[0])
    for side, sign in SIDES:
        for finger, keys in KEYS.items():
            tip = f"{side}_{finger}_tip"
            goals.append(wb.Point(tip, (row, sign * keys * PITCH, float(elbow[2]))))
            struck.append(wb.tasks.Soft(wb.Axis(tip, (1, 0, 1), direction=DOWN), weight=STRUCK))
            struck.append(wb.tasks.Soft(wb.Axis(tip, (0, 1, 0), direction=RIGHT), weight=COLUMN))
    goals.append(wb.Axis("gaze", FRONT, toward=(elbow[0] + 0.75, 0.0, elbow[2] + 0.3), weight=0.02))
    measures = [wb.Effort(), wb.tasks.Rhythm(), *struck]
    return wb.Problem(scene, q, goals=goals, constraints=constraints, measures=measures)


def _seated(figure: Figure, goals: Callable[[Array], list[Any]]) -> Problem:
    """A task of the hands at the head, seated."""
    import wholebody as wb

    q = figure.posture("sitting")
    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    add_seat(scene, figure, q)
    held = [wb.Hold("pelvis"), wb.Hold("left_foot"), wb.Hold("right_foot")]
    return wb.Problem(scene, start=q, goals=goals(q), constraints=held)


def _at_head(figure: Figure, q: Array, frame: str, place: tuple[float, float, float]) -> Any:
    """Bring a frame to a place that is given from between the eyes: ahead, left, up, metres."""
    import wholebody as wb

    eyes, head = figure.placement(q, "gaze"), figure.placement(q, "head")
    at = head.actInv(eyes.translation + np.array(place))
    return wb.Relative(frame, "head", at, orientation=False)


def face(figure: Figure) -> Problem:
    """Both palms at the cheeks."""
    import wholebody as wb

    def goals(q: Array) -> list[Any]:
        found: list[Any] = []
        for side, sign in SIDES:
            found += [
                _at_head(figure, q, f"{side}_palm", (0.01, 0.05 * sign, -0.04)),
                wb.Axis(f"{side}_palm", UP, direction=(-1, 0, 0), weight=0.02),
            ]
        return found

    return _seated(figure, goals)


def hair(figure: Figure) -> Problem:
    """Both hands at the back of the head."""
    return _seated(
        figure, lambda q: [_at_head(figure, q, f"{side}_index_tip", (-0.2, 0.03 * sign, 0.0)) for side, sign in SIDES]
    )


def eating(figure: Figure, tool: float) -> Problem:
    """The thumb's tip holds a spoon or chopsticks as far before the mouth as the tool reaches."""
    return _seated(figure, lambda q: [_at_head(figure, q, "right_thumb_tip", (0.02 + tool, -0.02, -0.07))])


def telephone(figure: Figure) -> Problem:
    """The palm of the right hand at the ear, facing it."""
    import wholebody as wb

    def goals(q: Array) -> list[Any]:
        ear = _at_head(figure, q, "right_palm", (-0.10, -0.10, -0.02))
        return [ear, wb.Axis("right_palm", UP, direction=LEFT, weight=0.02)]

    return _seated(figure, goals)


def toes(figure: Figure) -> Problem:
    """Both middle fingers as low before the toes as they come with straight knees."""
    import wholebody as wb

    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    q = figure.posture("standing")
    tip = figure.placement(q, "left_toe_tip").translation
    goals = [wb.Point(f"{side}_middle_tip", (tip[0], 0.08 * sign, 0.0)) for side, sign in SIDES]
    held = [wb.Hold("left_foot"), wb.Hold("right_foot"), wb.Freeze("left_knee_flexion", "right_knee_flexion")]
    return wb.Problem(scene, start=q, goals=goals, constraints=held)


def box(figure: Figure) -> Problem:
    """A box of 30 cm is taken from the floor by its sides; the feet stand where they like before it."""
    import wholebody as wb

    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    scene.add(wb.Box((0.30, 0.40, 0.30)), name="box", at=(0.45, 0.0, 0.151))
    goals: list[Any] = []
    for side, sign in SIDES:
        goals += [
            wb.Point(f"{side}_palm", (0.45, 0.2005 * sign, 0.15)),
            wb.Axis(f"{side}_palm", UP, direction=RIGHT if sign > 0 else LEFT, weight=0.1),
        ]
    return wb.Problem(scene, goals=goals, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])


def overhead(figure: Figure) -> Problem:
    """Both arms as high as they come: fingertips are drawn to where nobody's are."""
    import wholebody as wb

    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    drawn = [wb.tasks.Soft(wb.Point(f"{side}_middle_tip", (0.0, 0.18 * sign, 2.6)), HIGH) for side, sign in SIDES]
    measures = [wb.Effort(), wb.tasks.Rhythm(), *drawn]
    return wb.Problem(scene, measures=measures, constraints=[wb.Hold("left_foot"), wb.Hold("right_foot")])


def squat(figure: Figure) -> Problem:
    """The pelvis as low as a thigh upon its calf lets it, on flat soles."""
    import wholebody as wb

    scene = wb.Scene(figure).add(wb.HalfSpace(), name="floor")
    height = 0.17 * float(figure.placement(figure.posture("standing"), "head_top").translation[2])
    held: list[Any] = [wb.Stand("floor"), wb.Plane("right_hip", UP, point=(0.0, 0.0, height))]
    return wb.Problem(scene, start="squatting", constraints=held)


def drive(figure: Figure) -> Problem:
    """A seat that slides, with a backrest of 20 degrees; hands at the sides of a wheel, soles on pedals (estimates)."""
    import wholebody as wb

    cushion = wb.Box((0.46, 0.50, 0.06)), (0.15, 0.0, -0.03)
    slope = np.radians(20.0)
    turn = (0.0, -np.sin(slope / 2.0), 0.0, np.cos(slope / 2.0))
    middle = np.array((-0.10, 0.0, 0.0)) + 0.36 * np.array((-np.sin(slope), 0.0, np.cos(slope)))
    back = wb.Box((0.06, 0.46, 0.60)), (*middle, *turn)
    seat = wb.figures.adjustable({"cushion": cushion, "back": back}, slide=(-1.1, -0.5))
    scene = wb.Scene({"one": figure, "seat": (seat, (0.0, 0.0, 0.20))}).add(wb.HalfSpace(), name="floor")
    start = scene.figure.posture({"one": "sitting"})
    goals: list[Any] = [wb.Sit("seat/cushion", back="seat/back", pelvis="one/pelvis", trunk="one/thorax")]
    goals.append(wb.Axis("one/gaze", FRONT, direction=FRONT, weight=0.05))
    goals.append(wb.Point("one/right_heel", (0.0, -0.12, 0.0)))
    goals.append(wb.Point("one/left_heel", (-0.02, 0.12, 0.0)))
    goals += [wb.Point(f"one/{side}_grip", (-0.40, 0.17 * sign, 0.66)) for side, sign in SIDES]
    along = np.cos(SOLE), 0.0, np.sin(SOLE)
    goals += [wb.Axis(f"one/{side}_foot", FRONT, direction=along, weight=0.02) for side, _ in SIDES]
    return wb.Problem(scene, start=start, goals=goals)


TASKS: dict[str, Callable[[Any], Problem]] = {
    "typing": typing,
    "washing the face": face,
    "washing the hair behind": hair,
    "eating with chopsticks": lambda figure: eating(figure, 0.14),
    "eating with a spoon": lambda figure: eating(figure, 0.10),
    "telephone at the ear": telephone,
    "touching the toes": toes,
    "a box from the floor": box,
    "both arms overhead": overhead,
    "squatting on flat heels": squat,
    "driving": drive,
}
"""Tasks by the name of the posture."""
