"""BVH as programs write it: static roots above moving hips, channels of positions, text of every kind."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import wholebody as wb
from wholebody.motion.reading import read_skeleton
from wholebody.motion.skeleton import SkeletonMotion

LIMB = """JOINT Spine {{ OFFSET 0 20 0 CHANNELS {spine}
JOINT Head {{ OFFSET 0 40 0 CHANNELS 3 Zrotation Xrotation Yrotation
End Site {{ OFFSET 0 20 0 }} }} }}
JOINT LeftLeg {{ OFFSET 10 -5 0 CHANNELS 3 Zrotation Xrotation Yrotation
End Site {{ OFFSET 0 -80 0 }} }}"""
SIX = "6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
PLAIN = "3 Zrotation Xrotation Yrotation"


def text(body: str, rows: np.ndarray, motion: str = "MOTION\nFrames: {n}\nFrame Time: 0.01\n") -> str:
    broken = body.replace("{", "\n{\n").replace("}", "\n}\n").replace(" CHANNELS", "\nCHANNELS")
    return f"HIERARCHY\n{broken}\n{motion.format(n=len(rows))}" + "\n".join(
        " ".join(map(repr, row)) for row in rows.tolist()
    )


def hips(spine: str = PLAIN) -> str:
    limb = LIMB.format(spine=spine)
    return f"ROOT Hips {{ OFFSET 0 0 0 CHANNELS {SIX}\n{limb} }}"


@pytest.fixture
def rows() -> np.ndarray:
    rng = np.random.default_rng(0)
    places = np.cumsum(rng.normal(0.0, 2.0, (8, 3)), axis=0) + (0.0, 90.0, 0.0)
    return np.hstack([places, rng.uniform(-40.0, 40.0, (8, 12))])


def read(folder: Path, content: str | bytes) -> SkeletonMotion:
    path = folder / "a.bvh"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_skeleton(path, unit="centimetres", up="y")


def test_hips_that_move_below_a_still_root_move_the_skeleton(tmp_path: Path, rows: np.ndarray) -> None:
    plain = read(tmp_path, text(hips(), rows))
    limb = hips().replace("ROOT Hips", "JOINT Hips").replace("OFFSET 0 0 0", "OFFSET 0 90 0")
    for angle in (0.0, 30.0):
        above = f"ROOT Reference {{ OFFSET 0 0 0 CHANNELS {SIX}\n{limb} }}"
        still = np.tile([1.0, 2.0, 3.0, 0.0, 0.0, angle], (8, 1))
        found = read(tmp_path, text(above, np.hstack([still, rows])))
        assert found.names == plain.names
        assert "Hips moves below Reference, which is left out" in found.notes
        turn = Rotation.from_euler("z", angle, degrees=True).as_matrix()  # y of the file is up: z of the motion
        np.testing.assert_allclose(found.positions, plain.positions @ turn.T + (0.03, 0.01, 0.02), atol=1e-12)


def test_positions_of_joints_are_offsets_or_added_to_them(tmp_path: Path, rows: np.ndarray) -> None:
    plain = read(tmp_path, text(hips(), rows))
    for there in ((0.0, 20.0, 0.0), (0.0, 0.0, 0.0)):
        given = np.hstack([rows[:, :6], np.tile(there, (8, 1)), rows[:, 6:]])
        np.testing.assert_allclose(read(tmp_path, text(hips(SIX), given)).positions, plain.positions, atol=1e-12)
    lengths = 20.0 + 3.0 * np.arange(8.0)
    stretched = read(
        tmp_path, text(hips(SIX), np.hstack([rows[:, :6], np.outer(lengths, (0.0, 1.0, 0.0)), rows[:, 6:]]))
    )
    at = [stretched.positions[:, stretched.names.index(name)] for name in ("Hips", "Spine", "Head")]
    np.testing.assert_allclose(np.linalg.norm(at[1] - at[0], axis=1), 0.01 * lengths, atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(at[2] - at[1], axis=1), 0.4, atol=1e-12)


def test_text_of_every_kind_is_read(tmp_path: Path, rows: np.ndarray) -> None:
    usual = text(hips(), rows)
    plain = read(tmp_path, usual)
    header, numbers = usual.rsplit("0.01\n", 1)
    wrapped = header + "0.01\n" + "\n".join(" ".join(numbers.split()[k : k + 7]) for k in range(0, 120, 7))
    variants: dict[str, str | bytes] = {
        "tabs": usual.replace("OFFSET ", "OFFSET\t").replace("CHANNELS ", "CHANNELS\t ").replace("ROOT ", "ROOT\t"),
        "blanks": usual.replace("Frames:", "Frames :").replace("Frame Time:", "Frame Time :\t").replace("\n", "  \n"),
        "UTF-16": usual.encode("utf-16"),
        "Latin-1": usual.replace("Hips", "Hüfte").encode("latin-1"),
        "lines of DOS and its end": usual.replace("\n", "\r\n").encode() + b"\r\n\x1a",
        "wrapped frames": wrapped,
    }
    for name, content in variants.items():
        np.testing.assert_allclose(read(tmp_path, content).positions, plain.positions, atol=1e-12, err_msg=name)
    twice = read(tmp_path, usual.replace("JOINT Head", "JOINT Spine"))
    assert "a second joint is called 'Spine'; it is 'Spine_2' here" in twice.notes
    still = read(tmp_path, text(hips().replace(SIX, PLAIN), rows[:, 3:]))
    assert np.ptp(still.positions[:, 0]) == 0.0


def skeleton_of_a_person(size: float) -> str:
    """A text in which nothing but lengths says that it is a person: legs, trunk, arms, head."""
    plain, count = "CHANNELS 3 Zrotation Xrotation Yrotation", iter(range(99))

    def chain(*places: tuple[float, float, float], below: str = "") -> str:
        (x, y, z), rest = places[0], places[1:]
        offset = f"OFFSET {size * x} {size * y} {size * z}"
        if not rest and not below:
            return f"End Site {{ {offset} }}"
        inside = chain(*rest, below=below) if rest else below
        return f"JOINT b{next(count)} {{ {offset} {plain}\n{inside} }}"

    legs = ((0.09, -0.05, 0), (0, -0.42, 0), (0, -0.41, 0), (0, -0.08, 0.13), (0, 0, 0.07))
    arms = ((0.03, 0.1, 0), (0.15, 0, 0), (0.29, 0, 0), (0.25, 0, 0), (0.1, 0, 0))
    lower, upper = ([chain(*((side * x, y, z) for x, y, z in limb)) for side in (1, -1)] for limb in (legs, arms))
    head = chain((0, 0.15, 0), (0, 0.1, 0), (0, 0.15, 0))
    trunk = chain((0, 0.2, 0), (0, 0.2, 0), below=" ".join([*upper, head]))
    return f"ROOT b{next(count)} {{ OFFSET 0 0 0 CHANNELS {SIX}\n{' '.join([*lower, trunk])} }}"


@pytest.mark.parametrize(("unit", "metres"), [("metres", 1.0), ("centimetres", 0.01), ("inches", 0.0254)])
def test_units_are_those_that_make_a_person_of_a_persons_proportions(unit: str, metres: float, tmp_path: Path) -> None:
    body = skeleton_of_a_person(1.0 / metres)
    rows = np.zeros((2, 6 + 3 * (body.count("JOINT"))))
    path = tmp_path / "a.bvh"
    path.write_text(text(body, rows))
    found = read_skeleton(path)
    assert f"lengths are in {unit}" in found.notes
    assert np.linalg.norm(found.offsets, axis=1).max() == pytest.approx(0.42)
    # a hand of 18 cm, of which the size alone says nothing
    path.write_text(text(f"ROOT h {{ OFFSET 0 0 0 CHANNELS {SIX}\nJOINT f {{ OFFSET 0 10 0 CHANNELS {PLAIN}\nEnd Site "
                         "{ OFFSET 0 8 0 } } }", np.zeros((2, 9))))  # fmt: skip
    assert "lengths are in centimetres" in read_skeleton(path).notes


def test_a_person_whose_root_is_turned_stands_along_the_axis_that_is_up_in_the_motion(tmp_path: Path) -> None:
    body, path = skeleton_of_a_person(1.0), tmp_path / "a.bvh"
    rows = np.zeros((4, 6 + 3 * body.count("JOINT")))
    rows[:, :6] = [[0.1 * k, 0.2 * k, 0.96, 0.0, 90.0, 5.0 * k] for k in range(4)]  # about x, which lifts y to z
    path.write_text(text(body, rows))
    found = read_skeleton(path)
    assert "z is up in the motion, though y is in the rest posture" in found.notes
    assert found.positions[:, :, 2].min() == pytest.approx(0.0, abs=0.1)
    assert np.allclose(np.ptp(found.positions[:, :, 2], axis=1), 0.96 + 0.8, atol=0.1)
    np.testing.assert_allclose(found.positions[:, 0], rows[:, :3], atol=1e-12)
    rows[:, 4] = 0.0
    rows[:, :3] = [0.0, 0.96, 0.0]
    path.write_text(text(body, rows))
    assert read_skeleton(path).notes[0] == "y is up"


def test_a_stated_unit_or_axis_that_makes_no_person_is_told(tmp_path: Path) -> None:
    body, path = skeleton_of_a_person(100.0), tmp_path / "a.bvh"
    rows = np.zeros((4, 6 + 3 * body.count("JOINT")))
    rows[:, 1] = 96.0
    path.write_text(text(body, rows))
    with pytest.warns(UserWarning, match=r"^a\.bvh: in metres the person is \d+ m long, .* leave the unit out"):
        far = read_skeleton(path, unit="metres")
    assert np.linalg.norm(far.offsets, axis=1).max() == pytest.approx(42.0)  # it is followed all the same
    with pytest.warns(UserWarning, match=r"^a\.bvh: with z up the person lies, and with y up stands"):
        lying = read_skeleton(path, up="z")
    np.testing.assert_allclose(lying.positions[:, 0], [[0.0, 0.96, 0.0]] * 4, atol=1e-12)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        read_skeleton(path, unit="centimetres", up="y")
        turned = np.array(rows)
        turned[:, :6] = 0.0, 0.0, 96.0, 0.0, 90.0, 0.0
        path.write_text(text(body, turned))
        read_skeleton(path, unit="centimetres", up="z")
    with pytest.warns(UserWarning, match=r"with y up the person lies, and with z up stands"):
        read_skeleton(path, up="y")


def test_bones_without_length_make_no_limbs(tmp_path: Path) -> None:
    inner = f"JOINT t {{ OFFSET 0 0 0 CHANNELS {PLAIN}\nEnd Site {{ OFFSET 0 8 0 }} }}"
    stub = f"JOINT s {{ OFFSET 10 0 0 CHANNELS {PLAIN}\n{inner} }}"
    body, path = f"ROOT b {{ OFFSET 0 0 0 CHANNELS {SIX}\n{' '.join([stub] * 4)} }}", tmp_path / "a.bvh"
    path.write_text(text(body, np.zeros((2, 6 + 4 * 6))))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert "lengths are in centimetres" in read_skeleton(path).notes


def test_a_written_person_who_lies_with_the_feet_at_the_origin_lies_when_read(tmp_path: Path, human: wb.Figure) -> None:
    lying = np.array(human.neutral)
    lying[:7] = 0.95, 0.0, 0.1, 0.0, np.sqrt(0.5), 0.0, np.sqrt(0.5)  # on the front, the head along x
    clip = wb.Clip(human, np.array([lying, lying]), dt=0.02)
    again = wb.read_clip(clip.write(tmp_path / "lying.bvh"), human)
    for frame in range(2):
        for name in ("head_top", "left_foot"):
            there = human.placement(again.q[frame], name).translation
            assert there == pytest.approx(human.placement(lying, name).translation, abs=1e-5)


@pytest.mark.parametrize(("step", "told"), [("1", True), ("0.05", False)])
def test_frames_that_are_a_second_apart_are_told(step: str, told: bool, tmp_path: Path, rows: np.ndarray) -> None:
    """Some writers leave the time of a frame at 1; speeds, and so rests, are wrong then."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        read(tmp_path, text(hips(), rows, f"MOTION\nFrames: {{n}}\nFrame Time: {step}\n"))
    assert any("its frames are 1 s apart" in str(each.message) for each in said) == told


@pytest.mark.parametrize(("far", "told"), [(80.0, True), (8.0, False)])
def test_a_body_that_jumps_as_none_can_is_told(far: float, told: bool, tmp_path: Path, rows: np.ndarray) -> None:
    """8 m/s of a body of 1 m in its recording, and ten times that where two were joined."""
    rows[:, :3] = np.where(np.arange(8)[:, None] < 5, 0.0, far) * (1.0, 0.0, 0.0)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        read(tmp_path, text(hips(), rows))
    sentence = "Hips jumps by 0.8 m from frame 4 to the next; if recordings were joined there, take them apart by"
    assert any(f"{sentence} motion.part(0, 5) and motion.part(5, 8)" in str(each.message) for each in said) == told


@pytest.mark.parametrize(("name", "told"), [("02_01_60fps", True), ("walk 100Hz", False), ("take_2", False)])
def test_a_name_that_says_another_rate_of_frames_is_told(
    name: str, told: bool, tmp_path: Path, rows: np.ndarray
) -> None:
    """A published set of walks at 60 frames a second says in each file that its frames are 0.0667 s apart."""
    rows[:, :3] = 0.0
    (tmp_path / f"{name}.bvh").write_text(text(hips(), rows))  # 0.01 s
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        read_skeleton(tmp_path / f"{name}.bvh")
    sentence = "its name says 60 frames a second, and its frames are 0.01 s apart"
    assert any(sentence in str(each.message) for each in said) == told
    assert told or not any("its name says" in str(each.message) for each in said)
