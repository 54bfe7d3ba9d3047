"""Paths to drag along."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import wholebody as wb
from wholebody.tracking.path_following import circle, read_path, spread


def test_a_circle_is_round_flat_and_closed() -> None:
    places = circle((0.4, -0.2, 1.1), 0.15, (1.0, 2.0, 0.5))
    way = places - np.array((0.4, -0.2, 1.1))
    np.testing.assert_allclose(np.linalg.norm(way, axis=1), 0.15, rtol=1e-12)
    np.testing.assert_allclose(way @ np.array((1.0, 2.0, 0.5)), 0.0, atol=1e-15)
    np.testing.assert_allclose(places[0], places[-1], atol=1e-15)
    assert places[:, 2].argmin() in (0, len(places) - 1)
    assert np.ptp(circle((0.0, 0.0, 1.0), 0.1, (0.0, 0.0, 1.0))[:, 2]) < 1e-15


def test_places_are_spread_evenly_and_end_at_the_end() -> None:
    corners = [(0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (0.3, 0.1, 0.0)]
    places = spread(corners, 8)
    np.testing.assert_allclose(places[-1], corners[-1])
    np.testing.assert_allclose(places[5], (0.3, 0.0, 0.0), atol=1e-15)
    np.testing.assert_allclose(np.linalg.norm(np.diff(places, axis=0), axis=1), 0.05)
    assert len(spread(corners, dt=0.02)) == 40  # half a metre a second
    np.testing.assert_allclose(spread([(1.0, 2.0, 3.0)] * 2, 3), [(1.0, 2.0, 3.0)] * 3)


def test_a_file_of_places(tmp_path: Path) -> None:
    file = tmp_path / "way.csv"
    file.write_text("x, y, z\n# a remark\n0.1, 0.2, 0.3  # here\n\n0.4 0.5 0.6\n1e-1;2;3\n")
    np.testing.assert_allclose(read_path(file), [(0.1, 0.2, 0.3), (0.4, 0.5, 0.6), (0.1, 2.0, 3.0)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("0 0 0\n0 0\n", "way.csv, line 2: '0 0' is not a place; give x y z"),
        ("0 0 up\n", "line 1: '0 0 up' is not a place"),
        ("0 0 0\n\n# that\nx y z\n", "line 4: 'x y z' is not a place"),
        ("0 0 nan\n", "line 1: '0 0 nan' is not within 100 m"),
        ("450 0 900\n", "line 1: '450 0 900' is not within 100 m of the origin; give metres"),
        ("x y z\n", "it holds no places"),
        ("", "it holds no places"),
    ],
)
def test_a_bad_file_is_named_with_its_line(text: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "way.csv"
    file.write_text(text)
    with pytest.raises(wb.FileFormatError, match="way") as caught:
        read_path(file)
    assert message in str(caught.value)
