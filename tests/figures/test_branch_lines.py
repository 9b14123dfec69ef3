"""The legend of branches beside the caption of the figure."""

import pytest

from postproc.figures.branch_lines import name_branches
from postproc.figures.drawing import house_style, new_figure

NAMES = (
    *("P1, stable", "P1, unstable", "P2, stable", "P2, unstable", "P4, stable", "P4, unstable"),
    *("fold", "period doubling", "Neimark-Sacker", "grazing"),
)


@pytest.mark.parametrize("n_name", [2, 6, 8, len(NAMES)])
@pytest.mark.parametrize("n_panel", [1, 2])
def test_names_of_branches_leave_room_for_the_caption(n_name, n_panel):
    with house_style():
        figure, axes = new_figure(1, 90, 180, n_panel, False)
        for name in NAMES[:n_name]:
            axes[-1].plot([0, 1], [0, 1], label=name)
        name_branches(axes)
        text = figure.suptitle("$r$ = 2.28, $c_g$ = 0.7, $\\mu$ = 0.3", fontsize=7, x=0.02, ha="left")
        figure.canvas.draw()
    (legend,) = figure.legends
    assert [entry.get_text() for entry in legend.get_texts()] == list(NAMES[:n_name])
    assert not legend.get_window_extent().overlaps(text.get_window_extent())
