"""What notebooks show: small pieces of HTML with a chart."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
import pytest

import wholebody as wb
from wholebody.base.charts import Shown
from wholebody.studies.records import Records, SolveRecord

MOST = 100_000  # bytes of one answer in a notebook


def lines_of(shown: Shown, panel: int = 0) -> dict[str, np.ndarray]:
    """Values of the labelled lines of a panel of the chart, by label."""
    return {line.get_label(): np.asarray(line.get_ydata()) for line in shown.plot().axes[panel].get_lines()}


def test_a_solution_draws_its_trace_and_notebooks_show_it() -> None:
    problem = wb.Problem(wb.Scene(wb.load("hand")), goals=[wb.Point("right_index_tip", (0.05, 0.05, 0.1))])
    told = ElementTree.fromstring(problem._repr_html_())
    assert [row.findtext("th") for row in told.iter("tr")] == ["goals", "constraints", "measures"]
    assert next(told.iter("td")).text == "Point(right_index_tip)"
    solution = wb.solve(problem)
    drawn = lines_of(solution)
    assert drawn["goal error"] == pytest.approx([max(entry.goal_error, 1e-9) for entry in solution.trace])
    assert lines_of(solution, 1)["measures"] == pytest.approx([entry.measure for entry in solution.trace])
    page = ElementTree.fromstring(f"<body>{solution._repr_html_()}</body>")
    assert repr(solution) == page.findtext("pre")
    assert page.find("{http://www.w3.org/2000/svg}svg") is not None
    assert len(solution._repr_html_()) < MOST


def test_a_clip_draws_the_joints_that_move_most() -> None:
    figure = wb.load("hand")
    q = np.array([figure.neutral] * 30)
    column = figure.model.joints[figure.joint_id(figure.joints[3])].idx_q
    q[:, column] = np.linspace(0.0, 0.2, 30)
    clip = wb.Clip(figure, q, 0.02, "a_$_b")
    drawn = lines_of(clip)
    assert list(drawn) == [figure.joints[3]]  # what stands still is left out
    swung = q + np.linspace(0.0, 0.1, 30)[:, None] * (np.arange(figure.model.nq) > 6)
    assert len(lines_of(wb.Clip(figure, swung, 0.02))) == 8
    assert drawn[figure.joints[3]] == pytest.approx(q[:, column])
    assert len(clip._repr_html_()) < MOST
    assert len(repr(clip)) < 120
    with pytest.raises(wb.UnknownNameError, match="tail"):
        clip.plot(["tail"])


def test_names_with_dollars_are_no_formulas() -> None:
    figure = wb.load("hand")
    scene = wb.Scene(figure).add(wb.Sphere(0.2), name=r"$\ball$", at=(0.0, 0.0, 0.0))
    found = wb.check(wb.Clip(figure, np.array([figure.neutral] * 2), 0.02), scene)
    assert any("ball" in each.names for each in found.contacts)
    inside = lines_of(found)[r"thumb and \$\ball\$".replace("thumb", found.contacts[0].first)]
    assert len(inside) == 3  # two frames, and what is between them
    assert inside == pytest.approx(np.full(3, 1e3 * found.contacts[0].deepest), abs=0.01)  # nothing moves
    assert "<svg" in found._repr_html_()


def test_records_that_are_too_many_for_a_chart_are_told_without_one() -> None:
    few, many = ([SolveRecord(f"case {k}", "solved") for k in range(count)] for count in (3, 101))
    assert "<svg" in Records(few)._repr_html_()
    assert "<svg" not in Records(many)._repr_html_()
    with pytest.raises(wb.InputError, match="101 rows"):
        Records(many).plot()
    assert Records([])._repr_html_().startswith("<pre")
