"""One basis for a range of speeds, against the reduction at each speed."""

import numpy as np
import pytest
from trial_rig import trial_rig

from rubhpc.fem.assemble import assemble
from rubhpc.integrate.reduced_model.reduction import AlongSpeeds, reduce_model
from rubhpc.integrate.reduced_model.truncation import kept_modes

ENDS = (150.0, 260.0)


def answers(reduced, frequency):
    """Displacements of pairs and output for unit forces there, and for the unbalance."""
    rows = np.vstack([reduced.degree.reshape(-1, reduced.degree.shape[2]), reduced.output])
    system = reduced.stiffness - frequency**2 * np.eye(len(reduced.stiffness))
    loads = np.column_stack([rows.T, reduced.force[0] - 1j * reduced.force[1]])
    return rows @ np.linalg.solve(system + 1j * frequency * reduced.damping, loads)


@pytest.mark.parametrize("accuracy", [1e-3, 1e-30])
def test_is_the_reduction_at_each_speed(accuracy):
    model = assemble(trial_rig(2, cross=1e5))
    along = AlongSpeeds(model, ENDS, accuracy)
    for spin in (ENDS[0], 210.0, ENDS[1]):
        there, alone = along.at(spin), reduce_model(model, spin, accuracy)
        assert there.spin == spin
        for frequency in (spin, 3.0 * spin):
            expected = answers(alone, frequency)
            assert answers(there, frequency) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert along.at(200.0).basis is along.at(201.0).basis


def test_keeps_what_any_of_the_speeds_needs():
    model, ends = assemble(trial_rig(1)), (50.0, 6000.0)
    numbers = [sum(part.sum() for part in kept_modes(model, spin, 1e-3)) for spin in ends]
    assert numbers[0] < numbers[1]
    n_degrees = [
        len(AlongSpeeds(model, spins, 1e-3).at(50.0).stiffness) for spins in (ends, ends[1:], ends[:1])
    ]
    assert n_degrees[0] == n_degrees[1] > n_degrees[2]
