"""Time of a step. One core is meant; on a busy machine the least of several rounds counts."""

import pytest
from closed_form import read_rig
from set_ups import prepared

from rubhpc.integrate.case import run_case
from rubhpc.study.study import Recording

pytestmark = pytest.mark.bench


@pytest.mark.parametrize("normal", ["fixed", "updated"])
def test_step_of_the_packaged_rig_takes_two_microseconds(benchmark, normal):
    """Central difference at the paper's step, rubbing, all of it recorded."""
    setup = prepared(
        read_rig("mokhtar2017"), 148.7, samples=256, method="central-difference", step=0.5e-6, normal=normal
    )
    recording = Recording(transient=0, revolutions=3, keep=())

    def run():
        return run_case(setup, clearance=100e-6, friction=0.3, recording=recording)

    record = benchmark.pedantic(run, rounds=10, warmup_rounds=1)
    assert record.contacts_per_revolution[0] > 0
    per_step = benchmark.stats.stats.min / record.steps
    benchmark.extra_info["us_per_step"] = per_step * 1e6
    assert per_step <= 2e-6
