"""The least client: goals and holds by damped least squares, without contacts; nothing of wholebody is imported.

Usage: python small_pinocchio.py PROBLEMS ANSWERS.json [SET ...]
"""

import json
import sys
import time
from pathlib import Path

import numpy as np
import pinocchio as pin


def solve(folder, problem, seed, turns=200):
    """The posture that meets goals and holds from a seed, and its seconds. Put your own solver here."""
    body = json.loads((folder / problem["body"]).read_text())
    root = [pin.JointModelFreeFlyer()] if body["root"] == "free" else []
    model = pin.buildModelFromUrdf(str(folder / body["urdf"]), *root)
    low, high = np.array([body["limits"].get(name, (-np.inf, np.inf)) for name in body["coordinates"]]).T
    data, q, began = model.createData(), np.array(problem["seeds"][seed]), time.perf_counter()
    for _ in range(turns):
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        jacobian, error = [], []
        for term in [*problem["goals"], *problem["holds"]]:
            frame = model.getFrameId(term["frame"], pin.FrameType.BODY)
            place, move = data.oMf[frame], pin.getFrameJacobian(model, data, frame, pin.LOCAL_WORLD_ALIGNED)
            jacobian, error = [*jacobian, move[:3]], [*error, place.translation - term["position"]]
            if term["quaternion"]:
                wanted = pin.Quaternion(np.array(term["quaternion"])).toRotationMatrix()
                jacobian, error = [*jacobian, move[3:]], [*error, pin.log3(place.rotation @ wanted.T)]
        rows, left = np.vstack(jacobian), np.concatenate(error)
        if np.abs(left).max() < 2e-4:
            break
        step = -rows.T @ np.linalg.solve(rows @ rows.T + 1e-4 * np.eye(len(rows)), left)
        q = np.clip(pin.integrate(model, q, step * min(1.0, 0.3 / np.abs(step).max())), low, high)
    return q, time.perf_counter() - began


def main(folder, out, *sets):
    """Answer every problem of the sets from both seeds, or say what is not expressed."""
    index, answers = json.loads((folder / "index.json").read_text()), []
    for name in [name for family in (sets or index["sets"]) for name in index["sets"][family]["problems"]]:
        problem = json.loads((folder / "problems" / f"{name}.json").read_text())
        terms = [*problem["goals"], *problem["holds"]]
        other = "frames" in problem or problem["balance"] or any(one["type"] == "axis" or one["in"] for one in terms)
        for seed in ("near", "far"):
            answer = {"problem": name, "seed": seed, "refused": "only places in the world are expressed"}
            if not other:
                q, seconds = solve(folder, problem, seed)
                answer = {"problem": name, "seed": seed, "posture": q.tolist(), "seconds": seconds}
            answers.append(answer)
    out.write_text(json.dumps({"format": "wholebody answers", "version": "1.0", "method": "small", "answers": answers}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
