"""Fields are checked by their annotations, and the range that a class states is the one that others read."""

from __future__ import annotations

from dataclasses import MISSING, dataclass, fields
from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import pinocchio as pin
import pytest

import wholebody as wb
from wholebody import InputError, tasks
from wholebody.base.fields import Checked, Names, Range, Vector, check_of
from wholebody.scene.matter.body import Body


@dataclass(frozen=True)
class Bench(Checked):
    """A record with a field of every kind."""

    name: str
    height: Annotated[float, Range(0.2, 1.2, "m")] = 0.45
    slats: Annotated[int, Range(1, 20, whole=True)] = 4
    load: Annotated[float, Range(0.0, 500.0, "kg", endless=True)] | None = None
    tilt: Annotated[float, Range(-0.5, 0.5, "rad")] = 0.0
    wood: Literal["oak", "pine"] = "oak"
    fixed: bool = False
    size: Annotated[tuple[float, float], Vector(2, Range(0.1, 3.0, "m"))] = (1.2, 0.4)
    seats: Annotated[tuple[str, ...], Names("['left']")] = ("left",)


@pytest.mark.parametrize(
    ("given", "told"),
    [
        (
            {"height": 450},
            "Bench('park'): height is 450; give a number between 0.2 and 1.2 m; write 0.45 if",
        ),
        ({"height": float("nan")}, "height is nan; give a finite number between 0.2 and 1.2 m"),
        ({"height": True}, "height is True"),
        ({"slats": 4.5}, "slats is 4.5; give a whole number between 1 and 20"),
        ({"load": -1.0}, "load is -1.0; give a number between 0 and 500 kg, or math.inf for no limit"),
        ({"tilt": 20}, "tilt is 20; give a number between -0.5 and 0.5 rad; write 0.349066 if it is in degrees"),
        ({"wood": "elm"}, "wood is 'elm'; give 'oak' or 'pine'"),
        ({"fixed": 1}, "fixed is 1; give True or False"),
        ({"size": (1.0, 4.0)}, "size is 4.0; give a number between 0.1 and 3 m"),
        ({"seats": []}, "seats is empty; give a list of names, such as ['left']"),
    ],
)
def test_a_value_out_of_its_field_is_refused_in_one_sentence(given: dict[str, object], told: str) -> None:
    with pytest.raises(InputError) as refused:
        Bench("park", **given)  # type: ignore[arg-type]
    assert told in str(refused.value)


def test_a_module_without_texts_for_annotations_is_read_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Python 3.14 keeps no annotations beside the fields of a class, unless its module asks for texts."""
    (tmp_path / "plain_module.py").write_text(
        "from dataclasses import dataclass\nfrom typing import Annotated\nimport wholebody as wb\n"
        "from wholebody.base.fields import Range\n@dataclass(frozen=True)\nclass Low(wb.Point):\n"
        "    depth: Annotated[float, Range(0.0, 2.0, 'm')] = 0.5\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    kind = import_module("plain_module").Low
    assert kind("right_palm", (0.0, 0.0, 0.0)).depth == 0.5
    for wrong, told in (({"depth": 3.0}, "a number between 0 and 2 m"), ({"weight": "much"}, "weight is 'much'")):
        with pytest.raises(InputError, match=told):
            kind("right_palm", (0.0, 0.0, 0.0), **wrong)


def test_values_are_kept_in_the_form_in_which_they_are_used() -> None:
    made = Bench("park", height=1, load=float("inf"), size=[1, 2], seats=["left", "right"])  # type: ignore[arg-type]
    assert type(made.height) is float
    assert (made.load, made.size, made.seats) == (float("inf"), (1.0, 2.0), ("left", "right"))


def test_a_term_keeps_what_it_was_given_and_not_the_callers_array() -> None:
    place = np.array([0.1, 0.2, 0.3])
    for term in (
        wb.Point("right_palm", place),
        wb.CenterOfMass(place),
        wb.Frame("right_palm", pin.SE3(np.eye(3), place)),
    ):
        told = repr(term)
        place += 1.0
        assert repr(term) == told
        place -= 1.0


def test_every_field_of_the_package_can_be_read() -> None:
    """An annotation that does not resolve would ask for nothing."""
    classes = [getattr(tasks, name) for name in tasks.__all__] + [Body, wb.Box, wb.HalfSpace, wb.Mesh, wb.methods.QP]
    classes += [wb.methods.CCD, wb.methods.Newton, wb.methods.Placo, wb.methods.DampedLeastSquares]
    checked = [kind for kind in classes if isinstance(kind, type) and issubclass(kind, Checked)]
    assert len(checked) > 25
    for kind in checked:
        for field in fields(kind) if hasattr(kind, "__dataclass_fields__") else ():
            if field.init and field.default is not MISSING and isinstance(field.default, (bool, float)):
                assert check_of(kind, field.name) is not None, (kind, field.name)
