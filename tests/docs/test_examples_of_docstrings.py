"""Every public name has an example in its docstring, and what it makes is shown in a few lines."""

from __future__ import annotations

import doctest
import inspect
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import wholebody as wb
import wholebody.tracking

FLAGS = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def public() -> Iterator[tuple[str, Any]]:
    """Public classes and functions by name, each once."""
    seen = set[int]()
    for name in wb.__all__:
        found = getattr(wb, name)
        room = isinstance(found, ModuleType)
        for inner in found.__all__ if room else [""]:
            each = getattr(found, inner) if room else found
            if callable(each) and not inner.startswith("_") and id(each) not in seen:
                seen.add(id(each))
                yield f"{name}.{inner}".rstrip("."), each


PUBLIC = dict(public())


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """Names that the examples use: those of the package's own docstring, and some postures and files."""
    blocks = (wb.__doc__ or "").split("::\n", 1)[1].partition("\n\nWhat")[0]
    names: dict[str, Any] = {"np": np, "wholebody": wholebody}
    exec(inspect.cleandoc(blocks), names)
    human, solution, folder = names["scene"].figure, names["solution"], tmp_path_factory.mktemp("examples")
    standing = human.posture("standing")
    clip = wb.Clip(human, [standing, solution.q], dt=0.5).resampled(0.1)
    task = wb.taskfile.write_task(names["problem"], folder / "task.toml")
    names |= {"human": human, "standing": standing, "clip": clip, "folder": folder, "task_file": task}
    names["result_file"] = wb.taskfile.write_result(wb.read_task(task), solution, folder / "result.json")
    names["recording"] = clip.write(folder / "walk.bvh")
    return names | {"skeleton": wb.motion.read_skeleton(folder / "walk.bvh")}


@pytest.mark.parametrize("name", PUBLIC)
def test_an_example_does_what_it_says(
    name: str, known: dict[str, Any], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    text = PUBLIC[name].__doc__ or ""
    examples = doctest.DocTestParser().get_doctest(inspect.cleandoc(text), {**known}, name, None, None)
    assert examples.examples, f"{name} has no example"
    told: list[str] = []
    doctest.DocTestRunner(optionflags=FLAGS).run(examples, out=told.append, clear_globs=False)
    assert not told, "".join(told)
    for made in examples.globs.keys() - known.keys() - {"__builtins__"}:
        for one in each if isinstance(each := examples.globs[made], (list, tuple)) else [each]:
            if type(one).__module__.startswith("wholebody"):
                shown = repr(one)
                assert max(map(len, shown.splitlines())) < 300, shown
                assert len(shown.splitlines()) < 5, shown
                assert " object at 0x" not in shown
