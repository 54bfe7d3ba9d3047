"""Answer published problems by damped least squares in plain MuJoCo; nothing of wholebody is imported.

It refuses what it does not express: goals that move, axes, balance. Half-spaces are planes, hulls are meshes.
Usage: python plain_mujoco.py PROBLEMS ANSWERS.json [SET ...]
"""

import json
import sys
import time
from pathlib import Path

import mujoco
import numpy as np

KINDS = {"box": mujoco.mjtGeom.mjGEOM_BOX, "sphere": mujoco.mjtGeom.mjGEOM_SPHERE,
         "capsule": mujoco.mjtGeom.mjGEOM_CAPSULE, "ellipsoid": mujoco.mjtGeom.mjGEOM_ELLIPSOID,
         "half-space": mujoco.mjtGeom.mjGEOM_PLANE, "convex": mujoco.mjtGeom.mjGEOM_MESH}  # fmt: skip
MARGIN = 0.02  # m: contacts are found within it


def size_of(s):
    """Return MuJoCo's three numbers of a shape."""
    if s["type"] == "box":
        return np.array(s["size"]) / 2
    if s["type"] == "capsule":
        return [s["radius"], s["length"] / 2, 0]
    return s.get("semi_axes") or [s.get("radius", 1), 1, 1]


def build(folder, problem):
    """Return the model, with a pair for every tested pair of pieces, and the body's content."""
    body = json.loads((folder / problem["body"]).read_text())
    spec = mujoco.MjSpec.from_file(str(folder / body["urdf"]))
    spec.compiler.fusestatic, spec.compiler.discardvisual, spec.compiler.degree = False, False, False
    for geom in list(spec.geoms):  # the pieces come from the body's file, with their names
        spec.delete(geom)
    if body["root"] == "free":
        spec.worldbody.first_body().add_freejoint()
    for piece in [*body["pieces"], *problem["things"]]:
        s = piece["shape"]
        x, y, z, qx, qy, qz, qw = piece["pose"]
        more = {"pos": [x, y, z], "quat": [qw, qx, qy, qz]}
        if s["type"] == "half-space":
            more = {"pos": np.array(s["normal"]) * s["offset"]}  # the sets have floors alone: planes that face up
        if s["type"] == "convex":
            spec.add_mesh(name=piece["name"], file=str((folder / s["mesh"]).resolve()))
            more["meshname"] = piece["name"]
        owner = spec.body(piece["link"]) if piece["link"] else spec.worldbody
        owner.add_geom(name=piece["name"], type=KINDS[s["type"]], size=size_of(s), contype=0, conaffinity=0, **more)
    for a, b in pairs(body, problem):
        spec.add_pair(geomname1=a, geomname2=b, margin=MARGIN, gap=MARGIN, condim=1)
    return spec.compile(), body


def pairs(body, problem):
    """Return the pairs that are tested: the body's, and each thing against the body and what is carried."""
    untested, things = {frozenset(pair) for pair in problem["untested"]}, problem["things"]
    found = [tuple(pair) for pair in body["pairs"]]
    for k, thing in enumerate(things):
        others = [t["name"] for t in things[:k] if bool(t["link"]) != bool(thing["link"])]
        found += [(a, thing["name"]) for a in [p["name"] for p in body["pieces"]] + others]
    return [pair for pair in found if frozenset(pair) not in untested]


def rows(model, data, problem, least):
    """Return everything that is violated: its Jacobian and its value."""
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_collision(model, data)
    J, e = [], []

    def jacobian(body, point):
        move = np.zeros((6, model.nv))
        mujoco.mj_jac(model, data, move[:3], move[3:], point, body)
        return move

    for term in [*problem["goals"], *problem["holds"]]:
        link = model.body(term["frame"]).id
        place, turn = data.xpos[link], data.xmat[link].reshape(3, 3)
        target, axes, move = np.array(term["position"]), np.eye(3), jacobian(link, place)
        if term["quaternion"]:
            x, y, z, w = term["quaternion"]
            axes = np.zeros(9)
            mujoco.mju_quat2Mat(axes, np.array([w, x, y, z]))
            axes = axes.reshape(3, 3)
        if term["in"]:  # the target moves with another link
            base = model.body(term["in"]).id
            about = data.xmat[base].reshape(3, 3)
            target, axes = data.xpos[base] + about @ target, about @ axes
            move -= jacobian(base, target)
        J, e = [*J, move[:3]], [*e, place - target]
        if term["quaternion"]:
            quat, error = np.zeros(4), np.zeros(3)
            mujoco.mju_mat2Quat(quat, (turn @ axes.T).ravel())
            mujoco.mju_quat2Vel(error, quat, 1.0)
            J, e = [*J, move[3:]], [*e, error]
    for contact in data.contact[: data.ncon]:
        a, b = (model.geom(g).name for g in contact.geom)
        violation = contact.dist - least.get(frozenset((a, b)), problem["clearance"]["every_pair"])
        if violation < 0:
            first, second = (jacobian(model.geom_bodyid[g], contact.pos)[:3] for g in contact.geom)
            J, e = [*J, (contact.frame[:3] @ (second - first))[None]], [*e, [violation - 1e-4]]
    return np.vstack(J), np.concatenate(e)


def solve(folder, problem, seed, turns=150):
    """Return the answer from a seed, in the order of the files, and the seconds that it took."""
    model, body = build(folder, problem)
    data = mujoco.MjData(model)
    joints = [name for name in body["coordinates"] if not name.startswith("root ")]
    places = np.array([model.joint(name).qposadr[0] for name in joints])
    root, start = len(body["coordinates"]) - len(joints), np.array(problem["seeds"][seed])
    data.qpos[:root] = start[[0, 1, 2, 6, 3, 4, 5][:root]]
    data.qpos[places] = start[root:]
    low, high = np.array([body["limits"].get(name, (-np.inf, np.inf)) for name in joints]).T
    least = {frozenset((a, b)): d for a, b, d in problem["clearance"]["except"]}
    began = time.perf_counter()
    for _ in range(turns):
        J, e = rows(model, data, problem, least)
        if np.abs(e).max() < 2e-4:
            break
        step = -J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(len(J)), e)
        mujoco.mj_integratePos(model, data.qpos, step * min(1.0, 0.3 / np.abs(step).max()), 1.0)
        data.qpos[places] = np.clip(data.qpos[places], low, high)
    return [*data.qpos[[0, 1, 2, 4, 5, 6, 3][:root]], *data.qpos[places]], time.perf_counter() - began


def refusal(folder, problem):
    """Return what this client does not express, if anything."""
    if "frames" in problem:
        return "goals that move are not followed"
    if problem["balance"]:
        return "balance is not expressed"
    if json.loads((folder / problem["body"]).read_text())["root"] == "several":
        return "several figures are not expressed"
    return "axes are not expressed" if any(goal["type"] == "axis" for goal in problem["goals"]) else None


def main(folder, out, *sets):
    """Answer every problem of the sets from both seeds."""
    index, answers = json.loads((folder / "index.json").read_text()), []
    for name in [name for family in (sets or index["sets"]) for name in index["sets"][family]["problems"]]:
        problem = json.loads((folder / "problems" / f"{name}.json").read_text())
        for seed in ("near", "far"):
            answer = {"problem": name, "seed": seed}
            if why := refusal(folder, problem):
                answers.append(answer | {"refused": why})
                continue
            posture, seconds = solve(folder, problem, seed)
            answers.append(answer | {"posture": [float(value) for value in posture], "seconds": seconds})
    content = {"format": "wholebody answers", "version": "1.0", "method": "plain MuJoCo", "answers": answers}
    out.write_text(json.dumps(content))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
