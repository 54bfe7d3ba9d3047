"""The timeline of a checked clip, in a browser: a click brings the figure to that frame."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import wholebody as wb
from wholebody.view.motion_curves import timeline

INSIDE = "document.querySelector('iframe').contentWindow"


@pytest.fixture(scope="module")
def found() -> wb.motion.ClipCheck:
    """Return the check of a person whose arm goes into a thigh and comes back."""
    figure = wb.load("human")
    standing = figure.posture("standing")
    inside = figure.with_joints(standing, {"right_shoulder_abduction": -0.3})
    return wb.check(wb.Clip(figure, [standing, standing, inside, standing, standing], 0.5, "into a thigh"))  # type: ignore[arg-type]


def test_a_click_brings_the_figure_to_the_frame(browser: Any, found: wb.motion.ClipCheck, tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    page.write_text(timeline(found), encoding="utf-8")
    browser.open(page.as_uri())
    browser.evaluate("document.querySelectorAll('button[data-frame]')[1].click()")  # where the first pair is deepest
    first = found.contacts[0]
    at = (first.deepest_frame + 0.5 * first.deepest_between) * 0.5
    assert browser.evaluate(f"{INSIDE}.viewer.animator.actions[0].time") == pytest.approx(at)
    said = browser.evaluate("document.getElementById('here').textContent")
    assert float(said.split()[0]) == pytest.approx(1e3 * found.deepest, abs=0.01)
    # the middle of the chart, where time runs from 250 pixels to its right end
    browser.evaluate(
        "(() => { const box = chart.getBoundingClientRect(), x = box.left + 250 + (box.width - 250) * 0.15;"
        "chart.dispatchEvent(new PointerEvent('pointermove', { clientX: x, clientY: box.top + 30 }));"
        "chart.setPointerCapture = () => {};"
        "const at = { clientX: x, clientY: box.top + 30, pointerId: 1 };"
        "chart.dispatchEvent(new PointerEvent('pointerdown', at)); })()"
    )
    assert browser.evaluate(f"{INSIDE}.viewer.animator.actions[0].time") == pytest.approx(0.25)
    browser.evaluate("document.onkeydown({ key: 'ArrowRight', preventDefault() {} })")
    assert browser.evaluate("document.getElementById('frame').textContent") in ("1", "2")


def test_a_free_clip_and_one_frame(found: wb.motion.ClipCheck) -> None:
    text = timeline(wb.check(found.clip[:2]))
    assert "No overlap deeper than 0.1 mm" in text
    assert "<canvas" not in text
    assert "into a thigh" in timeline(wb.check(found.clip[:1]))


def test_long_clips_are_shown_in_part(found: wb.motion.ClipCheck, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = timeline(found)
    monkeypatch.setattr("wholebody.view.motion_curves.MOST_POSTURES", 2)
    assert len(timeline(found)) < len(whole)


def test_a_scene_of_another_figure_is_refused(found: wb.motion.ClipCheck) -> None:
    with pytest.raises(wb.InputError, match="another figure"):
        timeline(found, wb.Scene(wb.load("hand")))
    assert np.isfinite(found.depth).all()
