"""Figures as pictures within the page."""

from __future__ import annotations

import base64
import io
from typing import TYPE_CHECKING

from postproc.figures.style import house_style, new_figure

if TYPE_CHECKING:
    from postproc.figures.drawing import Drawing

MOST_DRAWN = 6  # cases: a picture takes 50 kB


def picture(drawing: Drawing, *, is_shared: bool = False) -> str:
    """Return a figure as an address that contains it; `is_shared`: its panels have one abscissa."""
    n_row, n_column = drawing.panels or (1, 1)
    content = io.BytesIO()
    with house_style():
        figure, axes = new_figure(n_row, drawing.height, drawing.width, n_column, is_shared=is_shared)
        drawing.draw(axes)
        figure.savefig(content, format="png", dpi=110)
    return "data:image/png;base64," + base64.b64encode(content.getvalue()).decode()
