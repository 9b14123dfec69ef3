"""Axes in the style of the house."""

import pytest

from postproc.figures.drawing import house_style, new_figure


@pytest.fixture
def ax():
    with house_style():
        yield new_figure()[1][0]
