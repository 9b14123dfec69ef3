"""Set-ups of the cases of a study."""

from dataclasses import replace

import pytest

from rubhpc import Carrier, Probe, read_rig, read_study
from rubhpc.running.case_setup import set_up, set_up_for_kernels
from rubhpc.storage.resume import grid_for


@pytest.fixture
def study(tmp_path):
    """A ring of eight, one case of it."""
    path = tmp_path / "ring.toml"
    path.write_text(
        'title = "ring"\nrig = "mokhtar2017"\noutput = "ring.zarr"\n'
        "[grid]\nspeed_ratio = [1.5]\nclearance_ratio = [0.8]\nfriction = [0.1]\n"
        '[contact]\nmodel = "mokhtar2017"\n'
    )
    read, packaged = read_study(path), read_rig("mokhtar2017").with_geometry("linear")
    return replace(read, rig=replace(packaged, stator=(replace(packaged.stator[0], count=8),)))


def first_case(study):
    return grid_for(study).case([0, 0, 0])


def test_kernels_are_loaded_with_the_first_stators_of_a_ring(study):
    case = first_case(study)
    assert len(set_up(study, case).model.stators) == 8
    assert len(set_up_for_kernels(study, case).model.stators) == 2


def test_stators_that_are_measured_or_share_a_carrier_stay(study):
    probe = Probe(name="fifth", stator=5, angle=0.0)
    probed = replace(study, recording=replace(study.recording, probe=(probe,)))
    casing = Carrier(name="casing", mass=20.0, stiffness=2e7)
    standing = tuple(replace(stator, carrier="casing") for stator in study.rig.stator)
    carried = replace(study, rig=replace(study.rig, carrier=(casing,), stator=standing))
    for whole in (probed, carried):
        assert len(set_up_for_kernels(whole, first_case(whole)).model.stators) == 8
