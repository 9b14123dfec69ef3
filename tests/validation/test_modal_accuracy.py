"""The exact modal integrator and the central difference at a fine step: one answer, from two directions.

Steady rubs of the packaged rig with period 1, 2 and 3. The modal scheme takes its usual accuracy of 1e-3 and
runs from rest; the central difference, 0.25 us and all modes of the mesh, goes on from where that ended, long
enough to leave it if it were not its own orbit.
"""

import numpy as np
import pytest
from closed_form import read_rig, simulate
from random_machines import random_machine
from random_rigs import found_error, random_rig
from record_distance import MOTIONS

from rubhpc.rig.reading import with_keys

STIFF = {"stator.youngs_modulus": "30 GPa"}
ORBITS = {
    "period 1": (1, {"speed_ratio": 0.75, "clearance": "84 um"}),
    "period 2": (2, {"speed_ratio": 0.75, "clearance": "100 um"}),
    "period 2, fast": (2, {"speed_ratio": 3.0, "clearance": "76 um"}),
    "period 3, stiff": (3, {"speed_ratio": 5.3, "clearance_ratio": 0.70, "overrides": STIFF}),
}


def distance(found, known, name):
    """Rms distance of a signal over its rms about the mean."""
    one, other = getattr(found, name), getattr(known, name)
    return np.sqrt(np.mean((one - other) ** 2)) / np.std(other)


@pytest.fixture(scope="module", params=ORBITS)
def orbit(request):
    period, given = ORBITS[request.param]
    settled = simulate("mokhtar2017", **given, transient=240, revolutions=8, keep=("waveform",))
    recorded = {"transient": 0, "revolutions": 2 * period, "initial": settled.final, "keep": ("waveform",)}
    known = simulate("mokhtar2017", **given, **recorded, method="central-difference", step="0.25 us")
    return period, given | recorded, settled, known


def test_orbit_is_that_of_the_central_difference(orbit):
    period, given, settled, known = orbit
    assert settled.period == known.period == period
    found = simulate("mokhtar2017", **given)
    for name in MOTIONS:
        assert distance(found, known, name) < 1e-3, name
    for name in ("peak_contact_force", "contact_impulse", "contact_duration", "friction_work"):
        assert getattr(found, name) == pytest.approx(getattr(known, name), rel=0.01), name
    assert found.contacts_per_revolution == known.contacts_per_revolution
    assert found.minimum_slip_speed == pytest.approx(known.minimum_slip_speed, rel=0.01)
    assert found.energy_residual < 1e-3


def test_central_difference_tends_to_the_modal_answer():
    """Of the second order, until what is left is the modal scheme's own 1e-6."""
    given = {"speed_ratio": 0.75, "clearance": "84 um", "transient": 0, "revolutions": 2}
    exact = simulate("mokhtar2017", **given, accuracy=1e-30)
    error = [
        distance(
            simulate("mokhtar2017", **given, method="central-difference", step=f"{step} us"), exact, "torsion"
        )
        for step in (2.0, 1.0, 0.5)
    ]
    assert np.log2(np.divide(error[:-1], error[1:])) == pytest.approx(2.0, abs=0.2)
    assert error[-1] < 1e-6


@pytest.mark.long
def test_chaotic_motion_has_the_same_statistics():
    """Two runs part for good; means over blocks of 20 revolutions agree within their own scatter."""
    given = {"speed_ratio": 2.25, "clearance_ratio": 0.95, "samples_per_revolution": 64}
    found = simulate("mokhtar2017", **given, transient=100, revolutions=1600, keep=("waveform",))
    known = simulate(
        "mokhtar2017", **given, transient=100, revolutions=400, method="central-difference", step="2 us"
    )
    assert found.period == known.period == 0
    n_sample = known.vertical.size
    assert np.std(found.vertical[:n_sample] - known.vertical) > 0.1 * np.std(known.vertical)
    for name in ("contact_force", "torsion", "vertical", "stator_lateral"):
        for statistic in (np.mean, np.std):
            blocks = [statistic(getattr(run, name).reshape(-1, 20 * 64), axis=1) for run in (found, known)]
            scatter = np.hypot(*(np.std(block) / np.sqrt(len(block) - 1) for block in blocks))
            assert abs(blocks[0].mean() - blocks[1].mean()) < 4 * scatter, (name, statistic)
            assert scatter < 0.05 * np.std(getattr(known, name)), (name, statistic)
    # The counts of 400 revolutions scatter by 3 %.
    assert found.contacts_per_revolution == pytest.approx(known.contacts_per_revolution, rel=0.1)
    assert found.peak_contact_force == pytest.approx(known.peak_contact_force, rel=0.2)  # of a longer run


GROWING = [  # seed of a rig, or speed ratio and clearance (um) of the packaged one; how far neighbours part
    (6, 1e2), (38, 1e2), (9, 1e2), (14, 1e3), (24, 1e3), (3, np.inf), (8, np.inf),
    ((5.09, 70.0), 1e2), ((1.3238, 64.187), np.inf), ((2.6543, 83.518), np.inf),
]  # fmt: skip


@pytest.mark.parametrize(("given", "most"), GROWING)
def test_error_is_the_estimate_times_how_neighbouring_motions_part(given, most):
    """Of clearances 1e-9 apart, over that; some motions err by more than the estimate alone."""
    if isinstance(given, int):
        rig, case = random_rig(given)
        case |= {"revolutions": 10}
    else:
        rig = with_keys(read_rig("mokhtar2017"), STIFF)
        case = {"speed_ratio": given[0], "clearance": given[1] * 1e-6, "friction": 0.3, "revolutions": 20}
    case |= {"transient": 0, "samples_per_revolution": 128, "keep": ("waveform",)}
    name = "clearance" if "clearance" in case else "clearance_ratio"
    record, exact = simulate(rig, **case), simulate(rig, **case, accuracy=1e-15)
    beside = simulate(rig, **case | {name: case[name] * (1 + 1e-9)})
    parted = max(1.0, found_error(beside, record) / 1e-9)
    assert parted < most if most < np.inf else parted > 1e3
    error = found_error(record, exact)
    assert 0.0 < error < record.modal_error * parted
    if parted < 100:
        assert error < 2.0 * record.modal_error


def errors_of(record, exact):
    """Rms distance of each signal over its rms about the mean, but for the start's first samples.

    Accelerations jump at events, which are some ns apart in both: one sample in fifty is left out of them,
    those that differ most.
    """
    start, errors = exact.vertical.size // 64, {}
    for name, signal in exact.signals.items():
        known, found = (np.atleast_2d(of)[:, start:] for of in (signal, record.signals[name]))
        if np.std(known, axis=1).max() > 1e-9 * np.abs(known).max():
            square = (found - known) ** 2
            n_seen = square.shape[1] - (square.shape[1] // 50 if "acceleration" in name else 0)
            seen = np.argsort(square, axis=1)[:, :n_seen]
            size = np.std(np.take_along_axis(known, seen, axis=1), axis=1)
            distance = np.sqrt(np.mean(np.take_along_axis(square, seen, axis=1), axis=1))
            errors[name] = float(np.max(distance / np.maximum(size, 1e-3 * size.max())))
    return errors


@pytest.mark.long
@pytest.mark.parametrize("seed", range(30))
def test_random_machines_are_as_accurate_as_asked(seed):
    """Eight laws, seven probes, bearings, gravity and strong damping, against all modes and finer loads."""
    rig, case = random_machine(seed)
    case = case | {"clearance_ratio": 0.7, "transient": 0, "revolutions": 4, "keep": ("waveform",)}
    record, exact = simulate(rig, **case), simulate(rig, **case, accuracy=1e-8)
    if record.scheme != exact.scheme:
        pytest.skip("all modes leave closed form")
    errors, limit = errors_of(record, exact), 1e-3
    if max(errors.values()) > limit:  # as far as rounding moves it: a series of bounces ends otherwise
        moved = case | {"friction": case["friction"] * (1 + 1e-10)}
        limit += max(errors_of(simulate(rig, **moved, accuracy=1e-8), exact).values())
    print(f"{record.modal_error:.1e} {max(errors.items(), key=lambda item: item[1])}")
    for name, error in errors.items():
        assert error < (2 * limit if "acceleration" in name else 1e-3), name
