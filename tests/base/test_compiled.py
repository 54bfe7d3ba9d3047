"""Loops that numba compiles: kept where a folder can be written to, told the first time, and not charged to solves."""

from __future__ import annotations

import gc
import importlib
import json
import os
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba.core.runtime import _nrt_python, rtsys
from numpy.typing import NDArray

from wholebody.base import compiled

LOOP = """
from wholebody.base.compiled import compiled

@compiled()
def twice(x):
    return 2.0 * x

@compiled()
def of_another(x):
    return twice(x) + 1.0

@compiled()
def of_constants(x):
    return twice(2) + twice(3) + x

def compiled_kernel():
    of_constants(1.0)
"""
USE = """
import logging, sys
logging.basicConfig(level=logging.INFO, format="%(message)s")
from wholebody import loop_of_a_test
from wholebody.base.compiled import compile_seconds
print(loop_of_a_test.twice(1.5), compile_seconds() > 0.0, "numba.np.linalg" in sys.modules)
"""


@pytest.fixture
def run(tmp_path: Path, root: Path):
    """Return a function that runs a process that uses a loop.

    It takes more code to run and the folder that numba may keep things in; it returns output and messages.
    """
    place = tmp_path / "wholebody"
    place.mkdir()
    for path in (root / "wholebody").glob("*.py*"):
        (place / path.name).symlink_to(path)
    (place / "base").symlink_to(root / "wholebody" / "base")
    (place / "loop_of_a_test.py").write_text(LOOP)

    def use(more: str = "", **variables: str) -> tuple[list[str], list[str]]:
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), **variables}
        command = [sys.executable, "-c", USE + more]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.split(), done.stderr.splitlines()

    return use


def test_loops_work_where_nothing_can_be_kept(run, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    nowhere = str(tmp_path / "file" / "folder")
    (tmp_path / "wholebody" / "__pycache__").write_text("in the way")
    answers, told = run(NUMBA_CACHE_DIR=nowhere, HOME=nowhere, XDG_CACHE_HOME=nowhere)
    assert answers == ["3.0", "True", "True"]
    assert len(told) == 1


ASKS = """
import sys
from pathlib import Path
from wholebody.base import compiled

compiled.PRECOMPILED = Path(sys.argv[1])
from wholebody import loop_of_a_test

print(loop_of_a_test.of_another(1.5), compiled.compile_seconds() > 0.0)
if not compiled.PRECOMPILED.is_dir():
    compiled.PRECOMPILED.mkdir()
    loop_of_a_test.of_another.copy_kept()
"""


def test_loops_of_a_wheel_are_not_compiled_again(run: object, tmp_path: Path) -> None:
    """By a processor that has what they need, in a cache that is empty, as long as the source is the same."""
    from llvmlite import binding

    has = {f"+{name}" for name, there in binding.get_host_cpu_features().items() if there}
    if not has >= compiled.BASELINE_FEATURES:
        pytest.skip(f"the processor cannot run code for {compiled.BASELINE[0]}")

    def ask(cache: str, **target: str) -> str:
        environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / cache), **target}
        command = [sys.executable, "-c", ASKS, str(tmp_path / "precompiled")]
        done = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=True)
        return done.stdout.strip()

    name, features = compiled.BASELINE
    assert ask("makers", NUMBA_CPU_NAME=name, NUMBA_CPU_FEATURES=features) == "4.0 True"
    assert ask("users") == "4.0 False"
    path = tmp_path / "wholebody" / "loop_of_a_test.py"
    # of another size: by it alone Python tells a source from one that was written in the same second
    path.write_text(path.read_text().replace("+ 1.0", "+ 2.00"))
    assert ask("users") == "5.0 True"


INNER = """
from wholebody.base.compiled import compiled

@compiled(inner=True)
def half(x):
    return 0.5 * x

@compiled(inner=True)
def _own(x):
    return 0.5 * half(x)

@compiled()
def quarter(x):
    return _own(x)
"""


def test_the_first_compilation_is_told_once_and_kept(run, tmp_path: Path) -> None:
    """In the user's cache, which is taken where the package cannot be written to; inner loops refuse Python."""
    (tmp_path / "wholebody" / "__pycache__").write_text("in the way")
    (tmp_path / "wholebody" / "loop_of_another_test.py").write_text(INNER)
    path = tmp_path / "wholebody" / "loop_of_a_test.py"
    path.write_text(
        LOOP.replace("return 2.0 * x", "return 4.0 * half(x)") + "from wholebody.loop_of_another_test import half\n"
    )
    asks = """
from wholebody.loop_of_another_test import half, quarter
print(quarter(6.0))
try:
    half(6.0)
except TypeError as error:
    print(str(error).replace(" ", "_"))
"""
    kept = {"NUMBA_CACHE_DIR": "", "HOME": str(tmp_path / "home"), "XDG_CACHE_HOME": str(tmp_path / "cache")}
    refused = "half_is_compiled_for_calls_from_compiled_functions_only"
    told = ["compiling the inner loops: up to a minute, once on a machine"]
    assert run(asks, **kept) == (["3.0", "True", "True", "1.5", refused], told)
    names = {path.name.split("-")[0] for path in (tmp_path / "cache").rglob("*.nbi")}
    assert {"loop_of_another_test.half", "loop_of_another_test.quarter"} <= names  # a module's own are a part of those
    assert "loop_of_another_test._own" not in names
    # Read back without what numba needs to compile; where this fails, look how numba keeps things now (`_loop_type`).
    assert run(asks, **kept) == (["3.0", "False", "False", "1.5", refused], [])


IN_PROCESSES = """
from wholebody.base import compiled

if __name__ == "__main__":
    for count, names in ((2, ("a", "another")), (1, ("a", "another")), (2, ("dying",))):
        compiled.compile_in_processes(count, [(f"wholebody.loop_of_{name}_test",) for name in names])
        print(compiled.compile_seconds() > 0.0)
"""


class Held(NamedTuple):
    """Arrays in a record in a record, and numbers."""

    inner: tuple[NDArray[np.float64], int]
    outer: NDArray[np.float64]


@compiled.compiled()
def first_and_sum(held, times):
    """A part of an array of a record, and sums over arrays that are made and dropped in a loop."""
    total = 0.0
    for _ in range(times):
        made = np.empty(3)
        made[:] = held.inner[0][:3]
        other = (made, held.outer)
        total += other[0][0] + other[1][held.inner[1]]
    return held.outer[1:], total


def test_references_of_arrays_in_records_are_counted_as_often_as_dropped() -> None:
    """By Python's and numba's own counts, after arrays in tuples were read, made, returned and dropped."""
    first, second = np.arange(3.0) + 1.0, np.arange(4.0)
    held = Held((first, 2), second)
    first_and_sum(held, 1)
    gc.collect()
    _nrt_python.memsys_enable_stats()
    counts, before = (sys.getrefcount(first), sys.getrefcount(second)), rtsys.get_allocation_stats()
    for _ in range(20):
        part, total = first_and_sum(held, 10)
        assert total == 30.0
        assert part.tolist() == [1.0, 2.0, 3.0]
    del part
    after = rtsys.get_allocation_stats()
    _nrt_python.memsys_disable_stats()
    assert (sys.getrefcount(first), sys.getrefcount(second)) == counts
    assert after.mi_alloc - before.mi_alloc == after.mi_free - before.mi_free > 200


def test_processes_compile_beside_each_other_and_what_one_leaves_is_compiled_by_this_one(
    run: object, tmp_path: Path
) -> None:
    """What two compiled one reads back, `twice` of 2 and of 3 is one loop, and one process ends in the middle."""
    (tmp_path / "wholebody" / "loop_of_another_test.py").write_text(LOOP)
    ends = "import os\nif __import__('multiprocessing').parent_process() is not None:\n    os._exit(1)\n"
    dying = ends + INNER + "\ndef compiled_kernel():\n    quarter(1.0)\n"
    (tmp_path / "wholebody" / "loop_of_dying_test.py").write_text(dying)
    (tmp_path / "asks.py").write_text(IN_PROCESSES)
    environment = {**os.environ, "PYTHONPATH": str(tmp_path), "NUMBA_CACHE_DIR": str(tmp_path / "kept")}
    command = [sys.executable, str(tmp_path / "asks.py")]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "False", "True"]
    assert len(list((tmp_path / "kept").rglob("*.twice-*.nbc"))) == 2


def test_all_loops_are_compiled_by_one_call() -> None:
    compiled.compile_all()
    for name in compiled.LOOPS:
        loops = vars(sys.modules[name].compiled_kernel()).values()
        assert any(loop.signatures for loop in loops if hasattr(loop, "signatures")), name


WORK = """
import json, sys
import wholebody as wb
from wholebody.base import compiled

def signatures():
    modules = {name: module for name, module in sys.modules.items() if name.startswith("wholebody.")}
    found = {f"{name}.{key}": value for name, module in modules.items() for key, value in vars(module).items()}
    return {(name, str(kind)) for name, loop in found.items() for kind in getattr(loop, "signatures", ())}

def steps(problem, count):
    tracker, q, near = wb.methods.QP().tracker(problem, 0.02), problem.start, set()
    for _ in range(count):
        q = tracker.step(q).q
        near.add(len(problem.scene.contacts(q, 0.02).distance))
    return near

compiled.compile_all()
print(compiled.compile_seconds(), "scipy.linalg" in sys.modules)
before = signatures()
shelf = wb.read_task("examples/tasks/shelf.toml").problem
for method in (wb.methods.QP(), wb.methods.Newton(iterations=5, restarts=0)):
    wb.solve(shelf, method)
steps(shelf, 20)
wb.solve(wb.read_task("examples/tasks/robot_arm_among_obstacles.toml").problem)
figure = wb.load("hand")
tip = wb.Point("right_index_tip", (0.1, 0.0, 0.1))
free = wb.Scene(figure)
steps(wb.Problem(free, goals=[tip]), 2)
wb.solve(wb.Problem(free, goals=[tip]), wb.methods.CCD(iterations=3, restarts=0))
figure = wb.load(sys.argv[1])
near = set()
for boxes in range(3):
    scene = wb.Scene(figure)
    for number in range(boxes):
        scene.add(wb.Box((0.1, 0.1, 0.1)), name=f"box {number}", at=(0.3, 0.3, 0.06 * number))
    near |= steps(wb.Problem(scene, goals=[wb.Point("moved", (0.0, 0.4, 0.0), offset=(0.4, 0, 0))]), 60)
print(json.dumps(sorted(near)))
for name, kind in sorted(signatures() - before):
    print(name, kind)
"""


ONE_JOINT = """<robot name="one">
<link name="base"/>
<link name="moved"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.3 0.05 0.05"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="moved"/><axis xyz="0 0 1"/>
<limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
</robot>"""


def test_solves_and_steps_compile_nothing_beyond_what_one_call_compiles(root: Path, tmp_path: Path) -> None:
    """Whatever the number of joints, pairs and contacts is: numba takes some arrays of one row for another type.

    And what is kept is read back without scipy: numba's array functions (numba.np.arraymath) load scipy.linalg, a tenth
    of the time that `wholebody pose` needs.
    """
    compiled.compile_all()
    path = tmp_path / "one.urdf"
    path.write_text(ONE_JOINT)
    command = [sys.executable, "-c", WORK, str(path)]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, check=True)
    read, first, *rest = done.stdout.splitlines()
    assert {0, 1, 2} <= set(json.loads(first))  # contacts of a step
    assert rest == []
    seconds, loaded = read.split()
    if float(seconds) == 0.0:  # where no folder can be written to, nothing is kept
        assert loaded == "False"


def test_garbage_is_not_collected_while_numba_compiles_and_a_spoilt_or_changed_loop_is_compiled_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from numba.core import event

    class Look(event.Listener):
        def on_start(self, event: object) -> None:
            seen.append(gc.isenabled())

        on_end = on_start

    path = tmp_path / "loop_of_its_own.py"
    path.write_text("def made(x):\n    return x + 1.0\n")
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("loop_of_its_own")
    for collects, change in ((True, ""), (False, ""), (False, "spoilt"), (True, "loop")):
        if change == "spoilt":  # what cannot be read back is compiled anew
            (file,) = tmp_path.rglob("*.nbc")
            file.write_bytes(file.read_bytes()[: file.stat().st_size // 2])
        elif change == "loop":
            path.write_text("def made(x):\n    return x + 30.0\n")
            importlib.reload(module)
        loop, seen = compiled.compiled()(module.made), list[bool]()
        (gc.enable if collects else gc.disable)()
        event.register("numba:run_pass", look := Look())
        try:
            assert loop(1.0) == (31.0 if change == "loop" else 2.0)
            afterwards = gc.isenabled()
        finally:
            event.unregister("numba:run_pass", look)
            gc.enable()
        assert afterwards == collects
        assert set(seen) == ({False} if collects or change else set())  # the second time it is read back
    sys.modules.pop("loop_of_its_own")


def test_another_process_compiles_the_longest_loop_where_there_are_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[list[str]] = []

    class Child:
        def __init__(self, command: list[str], **_: object) -> None:
            asked.append(command)

        def kill(self) -> None: ...

    monkeypatch.setattr(subprocess, "Popen", Child)
    monkeypatch.setattr("wholebody.base.compiled._beside", [])
    monkeypatch.setattr("wholebody.base.compiled.parent_process", lambda: None)  # a worker of pytest-xdist has one
    for cores, count in ((1, 0), (2, 1)):
        monkeypatch.setattr("wholebody.base.compiled.usable_cores", lambda cores=cores: cores)
        importlib.import_module("wholebody.base.compiled").compile_beside()
        assert len(asked) == count
    assert asked[0][1:] == ["-m", "wholebody.base.compiled", *compiled.BESIDE]


def test_what_both_processes_need_is_compiled_early_by_one_and_called_last_by_the_loop_of_the_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where another process was started, the first compilation here is followed by that of the shared loops, once."""
    from wholebody.terms.kernel import linearise

    called: list[str] = [name for name in linearise.py_func.__code__.co_names if name in ("_measures", "contact_rows")]
    assert called == ["_measures", "contact_rows"]
    assert compiled.SHARED == "wholebody.geometry.contact_rows"

    text = "called = []\ndef compiled_kernel():\n    called.append(1)\ndef made(x):\n    return x + 1.0\n"
    (tmp_path / "shared_of_its_own.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    module = importlib.import_module("shared_of_its_own")
    monkeypatch.setattr("wholebody.base.compiled.SHARED", module.__name__)
    monkeypatch.setitem(compiled._compiling, "shared", False)
    for beside, count in (([], 0), ([None], 1), ([None], 1)):
        monkeypatch.setattr("wholebody.base.compiled._beside", beside)
        (tmp_path / "shared_of_its_own.py").touch()
        assert compiled.compiled()(module.made)(1.0 if count else 1) == 2.0
        assert len(module.called) == count
        for kept in tmp_path.rglob("*.nb[ic]"):
            kept.unlink()
    sys.modules.pop("shared_of_its_own")
