"""Answer published problems by damped least squares in plain Pinocchio; nothing of wholebody is imported.

Usage: python plain_pinocchio.py PROBLEMS ANSWERS.json [SET ...]
"""

import json
import sys
import time
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin


def shape(folder, s):
    """One convex piece; a mesh has corners and outward triangles."""
    if s["type"] != "convex":
        make = {"box": lambda: coal.Box(*s["size"]), "sphere": lambda: coal.Sphere(s["radius"]),
                "capsule": lambda: coal.Capsule(s["radius"], s["length"]),
                "ellipsoid": lambda: coal.Ellipsoid(*s["semi_axes"]),
                "half-space": lambda: coal.Halfspace(np.array(s["normal"]), s["offset"])}  # fmt: skip
        return make[s["type"]]()
    points, faces = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for kind, *v in (line.split() for line in (folder / s["mesh"]).read_text().splitlines()):
        points.append(np.array(v, float)) if kind == "v" else faces.append(coal.Triangle(*(int(k) - 1 for k in v)))
    return coal.Convex(points, faces)


def build(folder, problem):
    """Model, geometry with all tested pairs, their least distances, and the limits."""
    body = json.loads((folder / problem["body"]).read_text())
    root = [pin.JointModelFreeFlyer()] if body["root"] == "free" else []
    model = pin.buildModelFromUrdf(str(folder / body["urdf"]), *root)
    geometry = pin.GeometryModel()
    for piece in [*body["pieces"], *problem["things"]]:
        frame = model.getFrameId(piece["link"], pin.FrameType.BODY) if piece["link"] else 0
        at = model.frames[frame].placement * pin.XYZQUATToSE3(np.array(piece["pose"]))
        joint = model.frames[frame].parentJoint
        geometry.addGeometryObject(pin.GeometryObject(piece["name"], joint, frame, at, shape(folder, piece["shape"])))
    number = {piece.name: k for k, piece in enumerate(geometry.geometryObjects)}
    untested = {frozenset(pair) for pair in problem["untested"]}
    carried = {t["name"] for t in problem["things"] if t["link"]}
    pairs = [tuple(pair) for pair in body["pairs"]]
    for k, thing in enumerate(problem["things"]):
        others = [t["name"] for t in problem["things"][:k] if (t["name"] in carried) != (thing["name"] in carried)]
        pairs += [(a, thing["name"]) for a in [p["name"] for p in body["pieces"]] + others]
    pairs = [pair for pair in pairs if frozenset(pair) not in untested]
    for a, b in pairs:
        geometry.addCollisionPair(pin.CollisionPair(number[a], number[b]))
    other = {frozenset((a, b)): d for a, b, d in problem["clearance"]["except"]}
    least = np.array([other.get(frozenset(pair), problem["clearance"]["every_pair"]) for pair in pairs])
    ends = [body["limits"].get(name, (-np.inf, np.inf)) for name in body["coordinates"]]
    return model, geometry, least, np.array(ends).T


def rows(model, data, geometry, results, least, problem, q):
    """Everything that is violated at q: its Jacobian and its value."""
    pin.computeJointJacobians(model, data, q)
    pin.updateFramePlacements(model, data)
    J, e = [], []
    at = lambda frame: pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)  # noqa: E731
    for term in [*problem["goals"], *problem["holds"]]:
        frame = model.getFrameId(term["frame"], pin.FrameType.BODY)
        place, move = data.oMf[frame], at(frame)
        if term["type"] == "axis":
            axis, way = place.rotation @ term["axis"], np.array(term["toward"]) - place.translation
            turn = np.cross(axis, way / np.linalg.norm(way))
            J, e = [*J, (np.eye(3) - np.outer(axis, axis)) @ move[3:]], [*e, -turn]
            continue
        target = pin.SE3(np.eye(3), np.array(term["position"]))
        if term["quaternion"]:
            target.rotation = pin.Quaternion(np.array(term["quaternion"])).toRotationMatrix()
        if term["in"]:  # the target moves with another link
            base = model.getFrameId(term["in"], pin.FrameType.BODY)
            target, carry = data.oMf[base] * target, at(base)
            move[:3] -= carry[:3] - pin.skew(target.translation - data.oMf[base].translation) @ carry[3:]
            move[3:] -= carry[3:]
        J, e = [*J, move[:3]], [*e, place.translation - target.translation]
        if term["quaternion"]:
            J, e = [*J, move[3:]], [*e, pin.log3(place.rotation @ target.rotation.T)]
    for balance in problem["balance"]:
        normals, centre = np.array(balance["normals"]), pin.centerOfMass(model, data, q)[:2]
        inside = normals @ centre - balance["offsets"] - balance["margin"]  # m, from each edge
        J, e = [*J, (normals @ pin.jacobianCenterOfMass(model, data, q)[:2])[inside < 0]], [*e, inside[inside < 0]]
    pin.updateGeometryPlacements(model, data, geometry, results)
    pin.computeDistances(geometry, results)
    for k, found in enumerate(results.distanceResults):
        if found.min_distance < least[k]:
            row = np.zeros(model.nv)
            pair = geometry.collisionPairs[k]
            for piece, point, sign in (
                (pair.first, found.getNearestPoint1(), -1),
                (pair.second, found.getNearestPoint2(), 1),
            ):
                joint = geometry.geometryObjects[piece].parentJoint
                move = pin.getJointJacobian(model, data, joint, pin.WORLD).reshape(6, -1)
                row += sign * found.normal @ (move[:3] - pin.skew(np.array(point)) @ move[3:])
            J, e = [*J, row[None]], [*e, [found.min_distance - least[k] - 1e-4]]
    return np.vstack(J), np.concatenate(e)


def solve(folder, problem, seed, turns=150):
    """Damped least squares from a seed."""
    model, geometry, least, (low, high) = build(folder, problem)
    data, results, q = model.createData(), pin.GeometryData(geometry), np.array(problem["seeds"][seed])
    began = time.perf_counter()
    for _ in range(turns):
        J, e = rows(model, data, geometry, results, least, problem, q)
        if np.abs(e).max() < 2e-4:
            break
        step = -J.T @ np.linalg.solve(J @ J.T + 1e-4 * np.eye(len(J)), e)
        step *= min(1.0, 0.3 / np.abs(step).max())
        q = np.clip(pin.integrate(model, q, step), low, high)
    return q, time.perf_counter() - began


def main(folder, out, *sets):
    """Answer every problem of the sets from both seeds."""
    index, answers = json.loads((folder / "index.json").read_text()), []
    for name in [name for family in (sets or index["sets"]) for name in index["sets"][family]["problems"]]:
        problem = json.loads((folder / "problems" / f"{name}.json").read_text())
        for seed in ("near", "far"):
            answer = {"problem": name, "seed": seed}
            if "frames" in problem:
                answers.append(answer | {"refused": "goals that move are not followed"})
                continue
            if any("of" in balance for balance in problem["balance"]):
                answers.append(answer | {"refused": "balance of some links is not expressed"})
                continue
            q, seconds = solve(folder, problem, seed)
            answers.append(answer | {"posture": q.tolist(), "seconds": seconds})
    content = {"format": "wholebody answers", "version": "1.0", "method": "plain Pinocchio", "answers": answers}
    out.write_text(json.dumps(content))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
