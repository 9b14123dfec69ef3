"""The corpus of cases keeps its values, and the bytes of a case do not depend on the cases before it.

It finds faults of 1 %, unless another size is given, in

- restitution; friction as a force, as a couple on the shaft, as work, and its sense under reversed spin;
- an exponent of a contact mode; its rows of switch functions, of slip and of losses; its outputs at samples;
- a penalty's damping in the motion, in the force and with friction; a static ratio that is ignored;
- one mode fewer;
- run-ups and drives without gyroscopic terms of the acceleration; the twist by it; the growth of the
  unbalance force; a place in the range of speeds (5 %);
- saltation matrices (in the monodromy matrix), and the shift of an event in the tangent (in an exponent);
- tables and bodies kept for another friction, clearance or speed;
- the mean force of a sample (0.2 %) and the sense of gyroscopic forces by central differences;
- the stators' hold on a carrier, the sag, its offset across a normal (10 %), the rim's curvature.
"""

from __future__ import annotations

import corpus
import numpy as np
import pytest

import rubhpc
from rubhpc import recent

STORED = corpus.stored()
# Of the largest value of a waveform. Motions are exact between events, and these are exact to a tick: what is
# allowed is half of the default accuracy with which modes are chosen, and as much for the steps of observers.
WAVEFORM, FORCE, MEASURE = 5e-4, 1e-3, 5e-4
# A balance is of the energies exchanged, an exponent of a revolution.
ABSOLUTE = {"energy_residual": 1e-5, "lyapunov_exponent": 1e-4}
COUNTS = ("period", "regime")


@pytest.mark.parametrize("name", corpus.CASES)
def test_a_case_keeps_its_values(name):
    found, expected = corpus.compute(name), STORED[name]
    assert found.keys() == expected.keys()
    for key, known in expected.items():
        value = np.ravel(found[key])
        assert value.shape == known.shape, key
        if key in COUNTS:
            assert (value == known).all(), key
            continue
        if key in ABSOLUTE:
            assert np.abs(value - known).max() <= ABSOLUTE[key], key
            continue
        share = FORCE if "force" in key else WAVEFORM if key in corpus.SIGNALS else MEASURE
        allowed = share * max(np.abs(known).max(initial=0.0), 1e-12)
        assert np.abs(value - known).max(initial=0.0) <= allowed, key


LAWS = ["LINEAR", "COULOMB", "STATIC", "PENALTY", "BOTH", "BOUNCING", "BOUNCING_COULOMB", "STRIBECK", "TABLE"]
LAWS += ["UPDATED", "BENT_UPDATED", "CENTRAL"]


@pytest.mark.parametrize("law", LAWS)
def test_the_bytes_of_a_case_do_not_depend_on_the_cases_before(law):
    options = dict(getattr(corpus, law))
    geometry = options.pop("geometry")
    transient, revolutions = (1, 2) if "method" in options else (10, 12)
    rig = corpus.machine("packaged")

    def bytes_of(speed_ratio, clearance, friction):
        record = rubhpc.simulate(
            rig,
            speed_ratio=speed_ratio,
            clearance=clearance,
            friction=friction,
            overrides={"stator.geometry": geometry},
            transient=transient,
            revolutions=revolutions,
            samples_per_revolution=32,
            **options,
        )
        measures = {
            key: np.asarray(value).tobytes() for key, value in record.measures.items() if key != "wall_time"
        }
        return measures | {key: value.tobytes() for key, value in record.signals.items()}

    recent.forget()
    alone = bytes_of(0.75, "84 um", 0.3)
    recent.forget()
    for other in (
        (1.7, "84 um", 0.3),
        (0.75, "84 um", 0.5),
        (0.75, "60 um", 0.3),
    ):  # speed first, then friction
        bytes_of(*other)
    assert bytes_of(0.75, "84 um", 0.3) == alone
