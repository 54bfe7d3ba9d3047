"""`wb.figures.adjustable`: a seat, a wheel or a bench whose settings a solve may choose."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from wholebody.base import checks
from wholebody.base.errors import InputError
from wholebody.figures.description import Chain, Description, copied
from wholebody.figures.figure import Figure
from wholebody.geometry.large_models import geometry_model
from wholebody.geometry.placement import FARTHEST, placement
from wholebody.geometry.shapes import HalfSpace, Shape

SETTINGS = {
    "slide": (pin.JointModelPX, FARTHEST),
    "height": (pin.JointModelPZ, FARTHEST),
    "tilt": (pin.JointModelRY, np.pi),
}
"""Joint and greatest value of each setting."""

ADJUSTABLE = "adjustable"  # name of such a figure


def adjustable(
    parts: Mapping[str, Any],
    *,
    slide: tuple[float, float] | None = None,
    height: tuple[float, float] | None = None,
    tilt: tuple[float, float] | None = None,
) -> Figure:
    """Return a figure of parts that move together, such as a seat, to be joined with a person in a scene.

    Its settings are joints, and unknowns of a problem: the effort of moving them is zero, so the person decides. Hold
    one by `wb.Freeze("seat/slide")`; `scene.figure.joint_values(q)["seat/slide"]` tells what was chosen, and
    `wb.accommodation` tells the settings of all people. In the posture "middle" each setting is in the middle.

    Args:
        parts: name to a shape, or to a shape and where it is when all settings are zero, as for `scene.add`.
        slide: least and greatest setting along x, metres; None where it does not slide.
        height: the same along z.
        tilt: the same about y through the origin, radians; positive lowers what is ahead of it.

    Raises:
        InputError: no parts, no shape, a half-space, no setting, or a range that is empty.

    Examples:
        >>> seat = wb.figures.adjustable({"cushion": wb.Box((0.5, 0.5, 0.08))}, slide=(-0.1, 0.1))
        >>> seat.joints
        ('slide',)
    """
    what = "adjustable: parts"
    checks.instance(parts, Mapping, what, "give {'cushion': (wb.Box((0.45, 0.5, 0.05)), (0.2, 0, 0.4))}")
    model, last = pin.Model(), 0
    model.name = ADJUSTABLE
    spans = {name: span for name, span in zip(SETTINGS, (slide, height, tilt), strict=True) if span is not None}
    for name, span in spans.items():
        kind, most = SETTINGS[name]
        low, high = checks.numbers(span, (2,), f"adjustable: {name}").tolist()
        if not (-most <= low < high <= most):
            raise InputError(f"adjustable: {name} is ({low:g}, {high:g}); give the least and the greatest setting")
        none, ends = np.full(1, 1e6), (np.array([low]), np.array([high]))
        last = model.addJoint(last, kind(), pin.SE3.Identity(), name, none, none, *ends)
        model.addJointFrame(last)
    if not parts or not spans:
        raise InputError("adjustable takes parts, and slide, height or tilt; add what does not move by scene.add")
    middle = 0.5 * (model.lowerPositionLimit + model.upperPositionLimit)
    pieces, known = [], {}
    for name, given in parts.items():
        shape, at = given if isinstance(given, tuple) and len(given) == 2 else (given, (0.0, 0.0, 0.0))
        what = f"adjustable: {checks.text(name, what)!r}"
        checks.instance(shape, Shape, what, "give wb.Box, wb.Mesh or another")
        if "/" in name or model.existFrame(name) or isinstance(shape, HalfSpace):
            raise InputError(f"{what}: take a name without a slash that no setting has, and a shape with an end")
        place = placement(at, what)
        known[name] = shape, place
        frame = model.addFrame(pin.Frame(name, last, 0, place, pin.FrameType.BODY))
        for number, part in enumerate(shape.pieces()):
            piece = pin.GeometryObject(f"{name}:{number}", last, frame, place * part.placement, part.geometry)
            piece.meshColor[:] = (0.45, 0.47, 0.50, 1.0)
            pieces.append(piece)
    description = Description(
        groups={"all": tuple(spans)},
        chains={next(iter(parts)): Chain(tuple(spans), next(iter(parts)))},
        frames=tuple(parts),
        segments=tuple(parts),
        postures={"middle": partial(copied, q=middle)},
        effort=dict.fromkeys(spans, 0.0),
    )
    figure = Figure(ADJUSTABLE, model, geometry_model(pieces), "own", description)
    figure.loaded_as = ADJUSTABLE, {"parts": known, **spans}
    return figure
