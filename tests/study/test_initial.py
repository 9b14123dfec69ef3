"""Keys of [initial] as axes of a grid: what each case takes, ids, what is refused, and the store."""

import numpy as np
import pytest
import xarray as xr

from postproc.store.rig_of_case import rig_of
from rubhpc import simulate
from rubhpc.errors import InputError
from rubhpc.running.driver import run
from rubhpc.running.recompute import reproduce
from rubhpc.storage.store import Store
from rubhpc.study.cases import CaseGrid
from rubhpc.study.identity import identity_parts
from rubhpc.study.initial import Initial
from rubhpc.study.study import read_study

BASE = """
rig = "mokhtar2017"
[grid]
speed_ratio = 0.75
clearance = "100 um"
friction = 0.3
"""
QUICK = """
[record]
transient = 0
revolutions = 2
samples_per_revolution = 32
keep = ["section"]
"""


def study_of(tmp_path, axes="", initial="", rest=""):
    path = tmp_path / "starts.toml"
    path.write_text(f"{BASE}{axes}\n[initial]\n{initial}\n{rest}")
    return read_study(path, tmp_path / "starts.zarr")


def test_each_case_takes_its_own_start(tmp_path):
    axes = 'initial.vertical = ["-50 um", "50 um"]\n"initial.impulse_node" = [3, 5]'
    stated = 'from = "contact_free"\nimpulse = "0.1 N*s"\nimpulse_angle = "90 deg"'
    grid = CaseGrid(study_of(tmp_path, axes, stated))
    assert grid.dims[-2:] == ("initial_vertical", "initial_impulse_node")
    cases = [case for block in grid.blocks() for case in grid.cases(block)]
    shared = {"from_": "contact_free", "impulse": 0.1, "impulse_angle": np.pi / 2}
    assert {case.initial for case in cases} == {
        Initial(vertical=v, impulse_node=node, **shared) for v in (-5e-5, 5e-5) for node in (3, 5)
    }
    assert len({case.id for case in cases}) == 4


def test_a_study_without_starts_keeps_its_identity(tmp_path):
    assert "initial" not in identity_parts(study_of(tmp_path))
    assert study_of(tmp_path).as_dict().keys() == study_of(tmp_path, initial='from = "rest"').as_dict().keys()
    moved = study_of(tmp_path, initial='from = "contact_free"')
    assert identity_parts(moved)["initial"]["from"] == moved.as_dict()["initial"]["from"] == "contact_free"


@pytest.mark.parametrize(
    ("axes", "initial", "message"),
    [
        ("initial.vertcal = [0.0]", "", "unknown axis; did you mean initial.vertical?"),
        ('initial.from = ["rest"]', "", "initial.from: unknown axis"),
        ("initial.vertical = [0.0, 0.0]", "", "initial.vertical: 0 is duplicated"),
        ('initial.vertical = ["3 kg"]', "", "is not in m"),
        ("initial.vertical = [0.0]", "vertical = 1e-5", "vertical: is also an axis of the grid"),
        ('initial.vertical = { values = [0, 1e-5], sweep = "up" }', "", "sweep another axis"),
        ("initial.impulse_angle = [0.0, 1.0]", "", "impulse_angle: there is no impulse"),
        ("initial.impulse_node = [0]", "impulse = 1.0", "initial.impulse_node = 0: .* at least 1"),
        (
            "initial.impulse_node = [3, 99]",
            "impulse = 1.0",
            "initial.impulse_node: 99 does not move sideways",
        ),
        ("", 'from = "there"', "from: .* is not available"),
    ],
)
def test_what_cannot_be_is_refused_before_the_run(tmp_path, axes, initial, message):
    with pytest.raises(InputError, match=message) as refused:
        CaseGrid(study_of(tmp_path, axes, initial))
    assert "\n" not in str(refused.value)
    assert "starts.toml" in str(refused.value)


def test_a_study_of_starts_runs_and_is_recomputed(tmp_path):
    axes = 'initial.vertical = { start = "-40 um", stop = "40 um", num = 3 }'
    study = study_of(tmp_path, axes, 'horizontal = "10 um"', QUICK)
    assert run(study, quiet=True).counts[1] == 3
    with xr.open_zarr(study.output) as store:
        assert store.initial_vertical.attrs["units"] == "m"
        assert rig_of(store.isel(initial_vertical=0)) == study.rig
        for vertical in store.initial_vertical.values:
            record = simulate(
                "mokhtar2017",
                speed_ratio=0.75,
                clearance="100 um",
                transient=0,
                revolutions=2,
                samples_per_revolution=32,
                initial={"vertical": float(vertical), "horizontal": 1e-5},
            )
            stored = store.section_vertical.sel(initial_vertical=vertical).values.ravel()
            np.testing.assert_array_equal(stored, record.section_vertical)
            assert stored[0] == pytest.approx(vertical, abs=1e-12)
    assert "bit for bit" in reproduce(study, Store(study.output).manifest.case_id(1)).verdict


def test_starts_are_drawn_and_swept(tmp_path):
    """A sample draws them; in a sweep they hold for the first case."""
    drawn = study_of(
        tmp_path,
        'initial.vertical = { start = "-40 um", stop = "40 um" }',
        "",
        QUICK + '\n[sample]\nmethod = "random"\nn = 5',
    )
    grid = CaseGrid(drawn)
    starts = [case.initial.vertical for block in grid.blocks() for case in grid.cases(block)]
    assert len(set(starts)) == 5
    assert max(map(abs, starts)) < 4e-5
    swept = (
        BASE.replace("0.75", '{ values = [0.7, 0.75], sweep = "up" }') + "initial.vertical = [0.0, 4e-5]\n"
    )
    path = tmp_path / "swept.toml"
    path.write_text(swept + QUICK)
    study = read_study(path, tmp_path / "swept.zarr")
    run(study, quiet=True)
    with xr.open_zarr(study.output) as store:
        first = store.section_vertical.isel(speed_ratio=0, section=0, missing_dims="ignore")
        vertical = first.values.reshape(2, -1)[:, 0]
        np.testing.assert_allclose(vertical, [0.0, 4e-5], atol=1e-12)
