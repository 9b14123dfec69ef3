"""Axes in the style of the house."""

from collections.abc import Iterator

import pytest
from matplotlib.axes import Axes

from postproc.figures.drawing import house_style, new_figure


@pytest.fixture
def ax() -> Iterator[Axes]:
    with house_style():
        yield new_figure()[1][0]
