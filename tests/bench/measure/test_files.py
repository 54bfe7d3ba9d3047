"""The table of what is read of a folder."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import wholebody as wb
from wholebody.bench.measure.files import read
from wholebody.cli.main import main


def test_every_file_is_read_or_has_its_sentence(tmp_path: Path) -> None:
    human = wb.load("human")
    wb.Clip(human, np.array([human.neutral] * 3), 0.1).write(tmp_path / "a.npz")
    wb.Clip(human, np.array([human.posture("sitting")] * 3), 0.1).write(tmp_path / "b.bvh")
    (tmp_path / "c.bvh").write_text("hello")
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "d.urdf").write_text('<robot name="d"><link name="base"/></robot>')
    (tmp_path / "inner" / "e.stl").write_text("solid\n")
    (tmp_path / "f.txt").write_text("# nothing")
    (tmp_path / "g.pdf").write_text("no file of a body")
    rows = {row.case: row for row in read(tmp_path, 2)}
    assert list(rows) == ["a.npz", "b.bvh", "c.bvh", "f.txt", "inner/d.urdf", "inner/e.stl"]
    said = {name: row["read"] for name, row in rows.items()}
    assert said == {"a.npz": "yes", "b.bvh": "yes", "c.bvh": "refused", "f.txt": "refused",
                    "inner/d.urdf": "yes", "inner/e.stl": "refused"}  # fmt: skip
    assert "its first line is not HIERARCHY" in rows["c.bvh"]["said"]
    assert rows["a.npz"]["frames"] == 3
    assert rows["b.bvh"]["bones worst deg"] < 5.0


def test_the_table_is_written(tmp_path: Path) -> None:
    (tmp_path / "files").mkdir()
    (tmp_path / "files" / "c.bvh").write_text("hello")
    given = [str(tmp_path / "files"), "--out", str(tmp_path / "out")]
    assert main(["bench", "files", *given]) == 0
    assert "| c.bvh | refused |" in (tmp_path / "out/files.md").read_text()
