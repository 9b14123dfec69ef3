"""Contact modes are tuned to as many pieces at once as memory allows, which changes no result."""

from dataclasses import replace

import numpy as np
import pytest
from closed_form import run_up
from overhung_pump import pump
from test_run_up_machines import PROBES, TIPS

from rubhpc.integrate.changing_speed import pieces, range_library, speed_ranges

CASE = {"start": 320.0, "stop": 332.0, "time": 0.18, "clearance": 1.2e-4, "friction": 0.1}
SIGNALS = "vertical", "torsion", "probe_twist", "probe_impeller"


@pytest.mark.parametrize("per_revolution", [None, 16])  # by default blocks have few pieces
def test_fewer_pieces_at_once_give_the_same_run_up(per_revolution, monkeypatch):
    rig, found, rooms = replace(pump(), stator=TIPS), [], []
    room_of = range_library.RangeLibrary._n_room_of

    def noted(library, n_byte):
        rooms.append(room_of(library, n_byte))
        return rooms[-1]

    monkeypatch.setattr(range_library.RangeLibrary, "_n_room_of", noted)
    for most in (range_library.MOST_BYTES, range_library.MOST_BYTES // 4, 1):
        monkeypatch.setattr(range_library, "MOST_BYTES", most)
        pieces._KNOWN.clear()  # matrices with tables for as many pieces as before
        speed_ranges._BUFFERS.clear()
        case = CASE | {"pieces_per_revolution": per_revolution}
        found.append(run_up(rig, **case, probes=PROBES, samples_per_revolution=64))
    assert found[0].contact_fraction.max() > 0.0
    assert rooms[0] > min(rooms[1:-1]) > rooms[-1] == 1
    for other in found[1:]:
        for name in SIGNALS:
            expected = found[0][name].values
            assert np.abs(other[name].values - expected).max() <= 1e-12 * np.abs(expected).max(), name
