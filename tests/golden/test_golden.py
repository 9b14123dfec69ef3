"""The corpus of cases keeps its values, and the bytes of a case do not depend on the cases before it."""

from __future__ import annotations

import corpus
import numpy as np
import pytest

import rubhpc
from rubhpc import recent

STORED = dict(corpus.stored())
# Of the largest value of a waveform. The default accuracy is 1e-3 of each signal and force.
WAVEFORM, FORCE, MEASURE = 2e-3, 5e-3, 2e-3
COUNTS = ("period", "regime")


@pytest.mark.parametrize("name", corpus.CASES)
def test_a_case_keeps_its_values(name):
    found, expected = corpus.compute(name), STORED[name]
    assert found.keys() == expected.keys()
    for key, known in expected.items():
        value = np.asarray(found[key], float)
        assert value.shape == known.shape, key
        if key in COUNTS:
            assert (value == known).all(), key
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
    for other in ((0.75, "60 um", 0.3), (0.75, "84 um", 0.5), (1.7, "84 um", 0.3)):
        bytes_of(*other)
    assert bytes_of(0.75, "84 um", 0.3) == alone
