"""A case of the attack written out: by the module of its kind, from its seed and number and from nothing else."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from wholebody.bench.attack import arguments, files, solves, streams, sweeps
from wholebody.bench.attack.case import KINDS, Case, Written
from wholebody.errors import UnknownNameError


def write(case: Case) -> Written:
    """Write a case.

    Raises:
        UnknownNameError: there is no such kind.
    """
    writers: dict[str, Callable[[np.random.Generator], Written]] = {
        "argument": arguments.written,
        "file": files.written,
        "solve": solves.written,
        "stream": streams.written,
        "sweep": sweeps.written,
    }
    if case.kind not in writers:
        raise UnknownNameError("kind of case", case.kind, KINDS)
    return writers[case.kind](case.rng())
