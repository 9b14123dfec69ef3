"""What a rank keeps for cases to come."""

import numpy as np
import pytest
from running import ROOT, write_study

from rubhpc.running import case_setup
from rubhpc.running.worker import integrate
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study


@pytest.fixture
def study(tmp_path):
    """Two speeds, two clearances and two frictions of a ring of three."""
    text = (ROOT / "rubhpc" / "rigs" / "mokhtar2017.toml").read_text()
    (tmp_path / "ring.toml").write_text(text.replace("[[stator]]", "[[stator]]\ncount = 3"))
    path = write_study(tmp_path, friction=[0.1, 0.3], clearance_ratio=[0.5, 0.7], transient=6)
    path.write_text(path.read_text().replace('rig = "mokhtar2017"', 'rig = "ring.toml"'))
    return read_study(path)


def test_contact_modes_that_are_freed_are_solved_again_with_the_same_bits(study, monkeypatch):
    """A rank holds those of the case under way and so many bytes of others, whatever the frictions."""
    grid = CaseGrid(study)
    cases = [case for block in grid.blocks() for case in grid.cases(block)]
    records, most, n_freed = [], [], 0
    for limit in (case_setup.MOST_BYTES, 0):
        monkeypatch.setattr(case_setup, "MOST_BYTES", limit)
        kept, found, held = case_setup.KeptSetups(study), [], []
        for case in [*cases, *cases]:  # once more, out of what is kept or again
            setup = kept.of(case)
            found.append(integrate(study, case, setup, case.initial))
            held.append({id(s): dict(s.n_byte) for _, s in kept._kept.values()})
            freed = [s for _, s in kept._kept.values() if not s.n_byte]
            assert not any("_known" in vars(s) for s in freed)  # the solved parts that its modes share
            n_freed += len(freed)
        records.append(found)
        most.append(max(sum(len(of_setup) for of_setup in now.values()) for now in held))
    assert n_freed > 0
    assert most == [4, 1]  # sets of contact modes: two speeds and two frictions, and one
    assert any(record.measures["contact_fraction"].max() > 0.0 for record in records[0])
    for one, other in zip(*records, strict=True):
        for name, values in one.signals.items():
            np.testing.assert_array_equal(values, other.signals[name])
        np.testing.assert_array_equal(one.final.packed(), other.final.packed())
