"""The same drops in several engines: what the judge says, and that every engine drops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from wholebody.bench.measure.world import (
    DENSITY,
    ENGINES,
    GRAVITY,
    Judge,
    ball,
    installed,
    measure,
    pile,
    stack,
)
from wholebody.cli.main import main


def test_the_judge_finds_depths_and_energies() -> None:
    judge = Judge(stack(2))
    unit = np.array([0.0, 0.0, 0.0, 1.0])
    poses = np.array([[0.0, 0.0, 0.09, *unit], [0.0, 0.0, 0.285, *unit]])
    assert judge.deepest(poses) == pytest.approx(0.01, abs=1e-6)
    assert judge.deepest(poses + np.array([0.0, 0.0, 0.02, 0, 0, 0, 0])) == pytest.approx(0.005, abs=1e-6)
    mass = DENSITY * 0.2**3
    still = mass * GRAVITY * (0.09 + 0.285)
    velocities = np.zeros((2, 6))
    velocities[0, 0], velocities[1, 5] = 2.0, 3.0
    moving = 0.5 * mass * 4.0 + 0.5 * mass / 6.0 * 0.04 * 9.0
    assert judge.energy(poses, velocities) == pytest.approx(still + moving)


@pytest.mark.parametrize("engine", installed(tuple(ENGINES)))
def test_every_engine_lets_a_ball_fall(engine: str) -> None:
    world = ENGINES[engine](ball())
    for _ in range(12):
        world.frame()
    poses, velocities = world.state()
    # all but wholebody advance by their velocity at the end of a step
    assert poses[0, 2] == pytest.approx(1.0 - 0.5 * GRAVITY * 0.04, abs=0.02)
    assert velocities[0, 2] == pytest.approx(-GRAVITY * 0.2, rel=1e-3)


def test_a_heap_is_measured() -> None:
    row = measure(pile(4, 1 / 60), "wholebody", frames=20)
    assert (row["things"], row["frames"]) == (4, 20)
    assert row["deepest mm"] <= 0.1
    assert row["largest gain of energy"] < 1e-6


def test_the_command_writes_a_table(tmp_path: Path) -> None:
    run = [
        "bench",
        "world",
        "--quick",
        "--only",
        "ball",
        "--engines",
        "wholebody",
        "--out",
        str(tmp_path),
    ]
    assert main(run) == 0
    assert (tmp_path / "world.csv").read_text().count("ball,wholebody") == 1
    assert "| ball | wholebody |" in (tmp_path / "world.md").read_text()
