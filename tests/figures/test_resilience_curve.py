"""The resilience curve: what no knock leads to is marked as such, and directions are signed."""

import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

from postproc.figures.resilience_curve import resilience


def knocks(least, angle):
    """Two clearances over three speeds."""
    dims = ("speed_ratio", "clearance")
    least, angle = np.array(least), np.array(angle)
    harmless = np.where(np.isnan(least), 3.65, 0.98 * least)
    columns = {
        "least_impulse": (least, "N s"),
        "harmless_impulse": (harmless, "N s"),
        "worst_angle": (angle, "rad"),
        "worst_node": (np.zeros((3, 2)), "1"),
        "has_contact_free_motion": (np.ones((3, 2), bool), "1"),
    }
    return xr.Dataset(
        {
            name: (dims, values, {"units": unit, "long_name": name})
            for name, (values, unit) in columns.items()
        },
        coords={
            "speed_ratio": ("speed_ratio", [1.1, 1.2, 1.3], {"units": "1", "long_name": "speed ratio"}),
            "clearance": ("clearance", [3e-4, 4e-4], {"units": "m", "long_name": "clearance"}),
        },
    )


def drawn(found):
    drawing = resilience(found)
    axes = Figure().subplots(*drawing.panels, squeeze=False).ravel().tolist()
    drawing.draw(axes)
    return axes


def test_what_no_knock_leads_to_is_marked_above():
    above, below = drawn(
        knocks([[0.1, 0.2], [0.15, np.nan], [0.2, np.nan]], [[0, 0], [6.0, np.nan], [0, np.nan]])
    )
    labels = above.get_legend_handles_labels()[1]
    assert "none up to 3.6 N s" in labels or "none up to 3.7 N s" in labels
    (marks,) = [line for line in above.lines if line.get_marker() == "^"]
    assert marks.get_xdata() == pytest.approx([1.2, 1.3])
    assert below.lines[0].get_ydata() == pytest.approx([0.0, np.degrees(6.0) - 360.0, 0.0])


def test_one_direction_has_no_panel():
    (above,) = drawn(knocks([[0.1, 0.2], [0.15, 0.3], [0.2, 0.5]], np.zeros((3, 2))))
    assert not [line for line in above.lines if line.get_marker() == "^"]
