"""The chart of dry whirl: over speed, over clearance, and over the whirl frequency."""

import numpy as np
import pytest

from postproc.figures.whirl_chart import draw_whirl
from rubhpc import Bore, Rig, dry_whirl


@pytest.fixture(scope="module")
def rig():
    """A disc of mass 1 in a ring on a spring."""
    ring = Bore(node=1, radius=3.0, mass=0.1, stiffness=1.0, damping=0.02)
    matrices = (np.eye(2), 0.1 * np.eye(2), 0.04 * np.eye(2))
    return Rig.from_matrices(*matrices, degrees=[(1, "v"), (1, "w")], stators=[ring])


def test_over_the_speed_friction_and_frequencies_have_a_panel_each(rig):
    found = dry_whirl(rig, [0.2, 0.4, 0.8], [1.0, 1.5], [0.4], most_frequency=2.0)
    friction, frequency = draw_whirl(found).show()
    rpm = 30 / np.pi * np.array([0.2, 0.4, 0.8])
    lines = [line for line in friction.lines if line.get_color() == "k"]
    for line, gap in zip(lines, (1.0, 1.5), strict=True):
        assert line.get_xdata() == pytest.approx(rpm)
        least = found.least_friction.sel(stator=1, clearance=gap).values
        assert line.get_ydata() == pytest.approx(np.where(np.isfinite(least), least, np.nan), nan_ok=True)
    assert any(list(line.get_ydata()) == [0.4, 0.4] for line in friction.lines), "the friction given"
    is_marked = [line.get_marker() != "None" for line in frequency.lines]
    drawn = np.concatenate([frequency.lines[k].get_ydata() for k in np.flatnonzero(is_marked)])
    assert np.sort(drawn) == pytest.approx(np.sort(np.abs(found.whirl_frequency.values)) / (2 * np.pi))
    names = {text.get_text() for text in frequency.figure.legends[0].get_texts()}
    assert {"friction 0.4", "unstable whip", "no dry whirl", "1X"} <= names


def test_of_one_speed_the_friction_is_drawn_over_the_clearance_or_over_the_frequency(rig):
    several = draw_whirl(dry_whirl(rig, [0.8], [1.0, 1.5], most_frequency=2.0)).show()
    assert [ax.get_xlabel() for ax in several] == ["Clearance (m)"] * 2
    found = dry_whirl(rig, [0.8], [1.0], [0.4], most_frequency=2.0)
    ax = draw_whirl(found).show([several[0]])[0]
    assert ax.get_xlabel().startswith("Whirl frequency (Hz)")
    lowest = float(np.nanmin(found.curve_friction))
    assert lowest == pytest.approx(found.least_friction.item(), rel=1e-3)


def test_a_bore_in_which_nothing_whirls_says_so(rig):
    friction, frequency = draw_whirl(dry_whirl(rig, [1e-6, 2e-6], [1.0], [0.4], most_frequency=2.0)).show()
    assert [text.get_text() for text in frequency.texts] == ["no dry whirl"]
    (shaded,) = friction.collections
    assert shaded.get_paths()[0].get_extents().y1 == friction.get_ylim()[1], "whatever the friction"
