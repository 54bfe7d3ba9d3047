"""Answer published problems by OInK of roboplan, which needs Pinocchio 4.1; nothing of wholebody is imported.

Usage: OMP_NUM_THREADS=1 python oink.py PROBLEMS ANSWERS.json [SET ...]
in an environment of its own, in which `pip install roboplan-oink` was done. With more threads it is many times slower.
"""

import json
import sys
import time
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from roboplan.core import CartesianConfiguration, Scene, loadUrdfSceneDescriptionFromXml
from roboplan.optimal_ik import (
    ConfigurationTask,
    ConfigurationTaskOptions,
    FrameTask,
    FrameTaskOptions,
    Oink,
    OinkSettings,
    PositionLimit,
    SelfCollisionBarrier,
    SelfCollisionBarrierOptions,
    VelocityLimit,
)

PHASES = ((1.0, 20), (0.1, 20), (0.01, 20), (0.0, 140))  # weight of the effort, which fades, and most steps with it
STEP, REST = 0.05, 1e-3  # rad and m: the longest step of a coordinate, and what counts as none
DAMPING, REGULARIZATION = 0.01, 1e-6  # of its examples
PAIRS, GAIN = 20, 0.5  # nearest pairs that its barrier looks at, and the share of their room that a step may use
MARGIN = 5e-4  # m: what pairs keep beyond the clearance
SAFE = 0.001  # safe_displacement_gain, as in its example with two arms
ENOUGH = 2e-4  # m and rad: goals and holds that are met
HELD = 10.0  # cost of holds; that of goals is 1
ROOT = (
    ("prismatic", "1 0 0"), ("prismatic", "0 1 0"), ("prismatic", "0 0 1"),
    ("revolute", "0 0 1"), ("revolute", "0 1 0"), ("revolute", "1 0 0"),
)  # fmt: skip
SLAB = 20.0  # m: edges of the box whose top stands for a half-space


def placement(pose):
    """A placement from a position and a quaternion."""
    return pin.SE3(pin.Quaternion(np.array(pose[3:])).toRotationMatrix(), np.array(pose[:3]))


def text(values):
    """Numbers of an attribute."""
    return " ".join(repr(float(value)) for value in values)


def fixed(robot, name, parent, place):
    """A link that is fixed to another."""
    link = ElementTree.SubElement(robot, "link", name=name)
    joint = ElementTree.SubElement(robot, "joint", name=f"{name} is fixed", type="fixed")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=name)
    ElementTree.SubElement(joint, "origin", xyz=text(place.translation), rpy=text(pin.rpy.matrixToRpy(place.rotation)))
    return link


def piece(robot, folder, one, world):
    """A link with one convex piece."""
    shape, place = one["shape"], placement(one["pose"])
    kind = shape["type"]
    if kind == "half-space":  # the top of a box
        normal = np.array(shape["normal"])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), normal).toRotationMatrix()
        place = place * pin.SE3(turn, (shape["offset"] - SLAB / 2) * normal)
        made = ("box", {"size": text([SLAB] * 3)})
    else:
        made = {
            "box": lambda: ("box", {"size": text(shape["size"])}),
            "sphere": lambda: ("sphere", {"radius": repr(shape["radius"])}),
            "capsule": lambda: ("cylinder", {"radius": repr(shape["radius"]), "length": repr(shape["length"])}),
            "convex": lambda: ("mesh", {"filename": str((folder / shape["mesh"]).resolve())}),
        }[kind]()
    link = fixed(robot, f"piece {one['name']}", one["link"] or world, place)
    collision = ElementTree.SubElement(link, "collision", name="shape")
    ElementTree.SubElement(ElementTree.SubElement(collision, "geometry"), made[0], made[1])
    if kind in ("capsule", "convex"):  # Pinocchio's extension of URDF: which shapes are round, and which are solid
        ElementTree.SubElement(ElementTree.SubElement(link, "collision_checking"), kind, name="shape")


def build(folder, problem, body):
    """The scene with all tested pairs but those that may come nearer than the others."""
    robot = ElementTree.parse(folder / body["urdf"]).getroot()
    for link in robot.iter("link"):
        for child in list(link):
            if child.tag.startswith("collision"):
                link.remove(child)
    children = {joint.find("child").get("link") for joint in robot.iter("joint")}
    root = world = next(link.get("name") for link in robot.iter("link") if link.get("name") not in children)
    for joint in robot.iter("joint"):  # a joint may have the name of a link, and frames are found by name
        joint.set("name", f"joint {joint.get('name')}")
    if body["root"] == "free":  # its PositionLimit does not keep the limits of joints beside a floating one
        world = "the world"
        ElementTree.SubElement(robot, "link", name=world)
        names = [world, *(f"root {k}" for k in range(len(ROOT) - 1)), root]
        for k, (kind, axis) in enumerate(ROOT):
            if k:
                ElementTree.SubElement(robot, "link", name=names[k])
            joint = ElementTree.SubElement(robot, "joint", name=f"the root {k}", type=kind)
            ElementTree.SubElement(joint, "parent", link=names[k])
            ElementTree.SubElement(joint, "child", link=names[k + 1])
            ElementTree.SubElement(joint, "axis", xyz=axis)
            ElementTree.SubElement(joint, "limit", lower="-100", upper="100", effort="1", velocity="1")
    for one in [*body["pieces"], *problem["things"]]:
        piece(robot, folder, one, world)
    scene = Scene("problem", loadUrdfSceneDescriptionFromXml(ElementTree.tostring(robot, encoding="unicode")))

    names = [one["name"] for one in [*body["pieces"], *problem["things"]]]
    carried = {one["name"] for one in problem["things"] if one["link"]}
    tested = {frozenset(pair) for pair in body["pairs"]}
    for k, thing in enumerate(problem["things"]):
        others = [one["name"] for one in problem["things"][:k]]
        mixed = [other for other in others if (other in carried) != (thing["name"] in carried)]
        tested |= {frozenset((a, thing["name"])) for a in [one["name"] for one in body["pieces"]] + mixed}
    tested -= {frozenset(pair) for pair in problem["untested"]}
    tested -= {frozenset(pair[:2]) for pair in problem["clearance"]["except"]}
    for tell in (False, True):
        pairs = [(a, b) for k, a in enumerate(names) for b in names[:k] if (frozenset((a, b)) in tested) == tell]
        scene.setCollisions([(f"piece {a}", f"piece {b}") for a, b in pairs], tell)
    return scene, world


def solve(folder, problem, seed):
    """Steps from a seed, and their seconds; building the scene is not counted."""
    body = json.loads((folder / problem["body"]).read_text())
    scene, world = build(folder, problem, body)
    began = time.perf_counter()
    settings = OinkSettings()
    settings.primal_infeasibility_solving = True
    oink = Oink(scene, settings)
    tasks, asked = [], []
    for terms, cost in ((problem["goals"], 1.0), (problem["holds"], HELD)):
        for term in terms:
            place = placement([*term["position"], *(term["quaternion"] or (0, 0, 0, 1))])
            target = CartesianConfiguration(term["in"] or world, term["frame"], place.homogeneous)
            turn = cost if term["quaternion"] else 0.0
            tasks.append(FrameTask(oink, scene, target, FrameTaskOptions(cost, turn, 1.0, DAMPING)))
            asked.append((term["frame"], term["in"] or world, place, bool(term["quaternion"])))
    weights = np.array([*body["root_effort_weights"], *(body["effort_weights"][name] for name in scalars(body))])
    there, q = there_of(body, problem["effort_from"]), there_of(body, problem["seeds"][seed])
    limits = [PositionLimit(oink, 1.0), VelocityLimit(oink, 1.0, np.full(oink.num_variables, STEP))]
    least = problem["clearance"]["every_pair"] + MARGIN
    barriers = [SelfCollisionBarrier(oink, scene, 1.0, SelfCollisionBarrierOptions(PAIRS, GAIN, SAFE, least))]
    step, best, answer = np.zeros(oink.num_variables), np.inf, q
    for weight, turns in PHASES:
        options, scaled = ConfigurationTaskOptions(1.0, 0.0, 1), weights * weight / weights.max()
        effort = [ConfigurationTask(oink, there, scaled, options)] if weight else []
        for _ in range(turns):
            try:
                oink.solveIk(q, [*tasks, *effort], limits, barriers, step, REGULARIZATION)
            except RuntimeError:  # no solution of its program
                break
            oink.enforceBarriers(q, barriers, step, MARGIN)
            q = scene.integrate(q, step)
            left = worst(scene, asked, q)
            if left < max(best, ENOUGH):
                best, answer = left, q
            if np.abs(step).max() < REST or (not weight and left < ENOUGH):
                break
    return here_of(body, answer), time.perf_counter() - began


def there_of(body, q):
    """A posture with three places and three angles of the root, from one with a quaternion."""
    if body["root"] == "fixed":
        return np.array(q)
    return np.array([*q[:3], *pin.rpy.matrixToRpy(placement(q[:7]).rotation)[::-1], *q[7:]])


def here_of(body, q):
    """The posture of the answer from one of the scene."""
    if body["root"] == "fixed":
        return q
    turn = pin.Quaternion(pin.rpy.rpyToMatrix(*q[5:2:-1]))
    return np.array([*q[:3], *turn.normalized().coeffs(), *q[6:]])


def worst(scene, asked, q):
    """The largest error of goals and holds, m and rad."""
    found = 0.0
    for frame, base, place, turned in asked:
        apart = place.actInv(pin.SE3(scene.forwardKinematics(q, frame, base)))
        found = max(found, np.linalg.norm(apart.translation), turned * np.linalg.norm(pin.log3(apart.rotation)))
    return found


def scalars(body):
    """Names of the joints after the root, in the order of the coordinates."""
    return [name for name in body["coordinates"] if name in body["effort_weights"]]


def refusal(folder, problem):
    """What OInK has no task for, or nothing."""
    if "frames" in problem:
        return "goals that move are not followed"
    if problem["balance"]:
        return "balance is not expressed"
    if json.loads((folder / problem["body"]).read_text())["root"] == "several":
        return "several figures are not expressed"
    if any(goal["type"] == "axis" for goal in problem["goals"]):
        return "an axis that points towards a place is not expressed"
    return ""


def main(folder, out, *sets):
    """Answer every problem of the sets from both seeds."""
    index, answers = json.loads((folder / "index.json").read_text()), []
    for name in [name for family in (sets or index["sets"]) for name in index["sets"][family]["problems"]]:
        problem = json.loads((folder / "problems" / f"{name}.json").read_text())
        for seed in ("near", "far"):
            answer = {"problem": name, "seed": seed}
            if refusal(folder, problem):
                answers.append(answer | {"refused": refusal(folder, problem)})
                continue
            q, seconds = solve(folder, problem, seed)
            answers.append(answer | {"posture": q.tolist(), "seconds": seconds})
    content = {"format": "wholebody answers", "version": "1.0", "method": "OInK", "answers": answers}
    out.write_text(json.dumps(content))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
