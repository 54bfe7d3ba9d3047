"""Programs as files that qpsolvers reads: one .npz each, in the split form with a name for each part.

Beside them stands a test set of qpbenchmark that has them all.

    minimise 1/2 z' P z + q' z    subject to    G z <= h,    A z = b,    lb <= z <= ub

over z = [x, r, s]: the displacement, the residuals of the soft rows and the slacks of the elastic ones. P is diagonal.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from tests.audits.qp_programs.recording import Recorded
from wholebody.base.arrays import Array
from wholebody.base.errors import FileFormatError
from wholebody.base.files import make_folder, read_text, write
from wholebody.methods.qp.quadratic_program import QuadraticProgram

TEST_SET = "wholebody_postures"
"""Name of the test set's file, without its suffix; qpbenchmark derives the name of the class from it."""

KEYS = ("P", "q", "G", "h", "A", "b", "lb", "ub")


def save(programs: list[Recorded], folder: Path) -> None:
    """Write every program as NAME.npz, with the keys that `qpsolvers.Problem.load` reads, and the test set."""
    make_folder(folder)
    write(folder / f"{TEST_SET}.py", read_text(Path(__file__).with_name(f"{TEST_SET}.txt")))
    for one in programs:
        np.savez_compressed(folder / f"{one.name}.npz", **split(one.program))


def split(program: QuadraticProgram) -> dict[str, Array]:
    """A program over its displacement, the residuals of soft rows and the slacks of elastic ones, by `KEYS`."""
    _n, m, k = program.size, len(program.target), len(program.least)
    free = np.full(m + k, np.inf)
    return {
        "P": np.diag(np.concatenate([program.diagonal, program.weight, program.elastic_weight])),
        "q": np.concatenate([program.linear, np.zeros(m + k)]),
        "G": np.hstack([-program.elastic, np.zeros((k, m)), -np.eye(k)]),
        "h": -program.least,
        "A": np.hstack([program.rows, -np.eye(m), np.zeros((m, k))]),
        "b": program.target,
        "lb": np.concatenate([program.lower, -free]),
        "ub": np.concatenate([program.upper, free]),
    }


def load(folder: Path) -> list[Recorded]:
    """Read programs back, in the order of their names.

    Raises:
        FileFormatError: a file is none of ours, or there is none.
    """
    found = []
    for path in sorted(folder.glob("*.npz")):
        parts = path.stem.rsplit("-", 2)
        if len(parts) != 3 or not (parts[1].isdecimal() and parts[2].isdecimal()):
            raise FileFormatError(f"{path}: is not named as a recorded program is; keep other files elsewhere")
        found.append(Recorded(parts[0], int(parts[1]), int(parts[2]), read(path)))
    if not found:
        raise FileFormatError(
            f"{folder}: has no programs; record some with `python -m tests.audits qp --out {folder.parent}`"
        )
    return found


def read(path: Path) -> QuadraticProgram:
    """Read one program: sizes and parts follow from those of A and G.

    Raises:
        FileFormatError: the file is none of ours.
    """
    try:
        with np.load(path, allow_pickle=False) as data:
            P, q, G, h, A, b, lb, ub = (data[key] for key in KEYS)
    except (OSError, KeyError, ValueError) as error:
        raise FileFormatError(f"{path}: is no program ({error}); record it again") from None
    m, k = len(b), len(h)
    n = len(q) - m - k
    weight = np.diag(P)
    return QuadraticProgram(
        diagonal=weight[:n],
        linear=q[:n],
        rows=A[:, :n],
        target=b,
        weight=weight[n : n + m],
        elastic=-G[:, :n],
        least=-h,
        elastic_weight=weight[n + m :],
        lower=lb[:n],
        upper=ub[:n],
    )
