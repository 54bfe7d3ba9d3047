"""The least client in MuJoCo: goals and holds by damped least squares; contacts are ignored, and wholebody not used.

Usage: python small_mujoco.py PROBLEMS ANSWERS.json [SET ...]
"""

import json
import sys
import time
from pathlib import Path

import mujoco
import numpy as np


def solve(folder, problem, seed, turns=200):
    """Return the posture that meets goals and holds from a seed, and its seconds. Put your own solver here."""
    body = json.loads((folder / problem["body"]).read_text())
    spec = mujoco.MjSpec.from_file(str(folder / body["urdf"]))
    spec.compiler.fusestatic, root = False, 7 if body["root"] == "free" else 0  # links keep their names
    if root:
        spec.worldbody.first_body().add_freejoint()
    model, joints = spec.compile(), body["coordinates"][root:]
    data, places = mujoco.MjData(model), [model.joint(name).qposadr[0] for name in joints]
    low, high = np.array([body["limits"].get(name, (-np.inf, np.inf)) for name in joints]).T
    data.qpos[[0, 1, 2, 4, 5, 6, 3][:root] + places], began = problem["seeds"][seed], time.perf_counter()
    for _ in range(turns):
        mujoco.mj_fwdPosition(model, data)
        jacobian, error = [], []
        for term in [*problem["goals"], *problem["holds"]]:
            link, move, turn = model.body(term["frame"]).id, np.zeros((6, model.nv)), np.zeros(3)
            mujoco.mj_jacBody(model, data, move[:3], move[3:], link)
            jacobian, error = [*jacobian, move[:3]], [*error, data.xpos[link] - term["position"]]
            if term["quaternion"]:
                mujoco.mju_subQuat(turn, data.xquat[link], np.array(term["quaternion"])[[3, 0, 1, 2]])
                jacobian, error = [*jacobian, move[3:]], [*error, data.xmat[link].reshape(3, 3) @ turn]
        rows, left = np.vstack(jacobian), np.concatenate(error)
        if np.abs(left).max() < 2e-4:
            break
        step = -rows.T @ np.linalg.solve(rows @ rows.T + 1e-4 * np.eye(len(rows)), left)
        mujoco.mj_integratePos(model, data.qpos, step * min(1.0, 0.3 / np.abs(step).max()), 1.0)
        data.qpos[places] = np.clip(data.qpos[places], low, high)
    posture = data.qpos[[0, 1, 2, 4, 5, 6, 3][:root] + places].tolist()
    return {"posture": posture, "seconds": time.perf_counter() - began}


def main(folder, out, *sets):
    """Answer every problem of the sets from both seeds, or say what is not expressed."""
    index, answers = json.loads((folder / "index.json").read_text()), []
    for name in [name for family in (sets or index["sets"]) for name in index["sets"][family]["problems"]]:
        problem = json.loads((folder / "problems" / f"{name}.json").read_text())
        terms = [*problem["goals"], *problem["holds"]]
        other = "frames" in problem or problem["balance"] or any(one["type"] == "axis" or one["in"] for one in terms)
        for seed in problem["seeds"]:
            found = {"refused": "only places in the world are expressed"} if other else solve(folder, problem, seed)
            answers.append({"problem": name, "seed": seed} | found)
    out.write_text(json.dumps({"format": "wholebody answers", "version": "1.0", "method": "small", "answers": answers}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), *sys.argv[3:])
