"""Unstable rotors and sagging shafts: what a study, a run and a single case say of them and refuse."""

import math

import numpy as np
import pytest
import xarray as xr

from rubhpc import assemble, read_rig, simulate
from rubhpc.errors import InputError
from rubhpc.fem.stability import instability_message, is_passive, unstable_modes
from rubhpc.rig.reading import with_keys
from rubhpc.running.driver import run
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

CROSS = {"rotor.bearing.kyz": 5e4, "rotor.bearing.kzy": -5e4, "rotor.damping.beta": 0.0}
RIG = read_rig("mokhtar2017")


def study_of(tmp_path, grid, **override):
    keys = "\n".join(f'"{key}" = {value}' for key, value in override.items())
    path = tmp_path / "a.toml"
    record = 'transient = 1\nrevolutions = 1\nsamples_per_revolution = 16\nkeep = ["section"]'
    path.write_text(
        f'rig = "mokhtar2017"\n[grid]\nfriction = 0.1\n{grid}\n[override]\n{keys}\n[record]\n{record}'
    )
    return read_study(path, tmp_path / "a.zarr")


@pytest.mark.parametrize("cross", [0.0, 1e3, 5e4])
def test_a_passive_rotor_is_stable(cross):
    model = assemble(with_keys(RIG, {"rotor.bearing.kyz": cross, "rotor.bearing.kzy": -cross}))
    assert is_passive(model.rotor) == (cross == 0.0)
    if is_passive(model.rotor):
        assert not unstable_modes(model.rotor, 500.0)


def test_unstable_speeds_are_named_once_and_have_no_amplitude(tmp_path, capsys):
    study = study_of(tmp_path, 'clearance = "1 mm"\nspeed_ratio = [0.5, 2.0]', **CROSS)
    grid = CaseGrid(study)
    speed = [case.speed for block in grid.blocks() for case in grid.cases(block)]
    expected = [bool(unstable_modes(assemble(study.rig).rotor, at)) for at in speed]
    assert all(expected)
    (line,) = grid.warnings()
    low, high = (f"{at * 30 / math.pi:.6g}" for at in sorted(speed))
    assert line.startswith(
        f"at 2 of 2 operating points, {low} to {high} rpm: the rotor is unstable at {low} rpm"
    )
    run(study)
    assert capsys.readouterr().out.count("warning: at 2 of 2 operating points") == 1
    with xr.open_zarr(study.output) as store:
        assert np.isnan(store.contact_free_amplitude).all()


def test_a_ratio_of_no_amplitude_is_refused(tmp_path):
    study = study_of(tmp_path, "clearance_ratio = 0.7\nspeed_ratio = [0.5, 2.0]", **CROSS)
    with pytest.raises(
        InputError, match=r"clearance_ratio: the rotor is unstable at .* give clearance instead"
    ):
        CaseGrid(study).operating_points()


def test_one_case_says_that_its_rotor_is_unstable():
    options = {"speed_ratio": 0.5, "transient": 1, "revolutions": 1, "samples_per_revolution": 16, "keep": ()}
    record = simulate(RIG, clearance="1 mm", overrides=CROSS, **options)
    model = assemble(with_keys(RIG, CROSS))
    assert record.remark == instability_message(model, record.spin_speed) != ""
    assert math.isnan(record.contact_free_amplitude)
    assert "unstable" in repr(record)
    with pytest.raises(
        InputError, match=r"simulate: clearance_ratio: the rotor is unstable .* give clearance"
    ):
        simulate(RIG, clearance_ratio=0.7, overrides=CROSS, **options)
    assert simulate(RIG, clearance="1 mm", **options).remark == ""


@pytest.mark.parametrize(("gravity", "angle", "n"), [(0.0, 180, 0), (9.81, 180, 2), (9.81, 0, 0)])
def test_a_sag_beyond_the_clearance_is_named(tmp_path, gravity, angle, n):
    """The packaged shaft sags by 0.27 mm; stators above it are farther away."""
    keys = {"rotor.gravity": gravity, "stator.angle": f'"{angle} deg"'}
    grid = "clearance_ratio = [0.7, 0.8, 20.0]\nspeed_ratio = 0.75"
    found = CaseGrid(study_of(tmp_path, grid, **keys)).warnings()
    assert len(found) == (n > 0)
    if n:
        assert f"the sag of the shaft exceeds {n} of 3 clearances" in found[0]
        assert " um at a clearance of " in found[0]
    absolute = study_of(tmp_path, 'clearance = "0.1 mm"\nspeed_ratio = 0.75', **keys)
    assert CaseGrid(absolute).warnings() == ()


def test_undamped_stators_are_named_with_how_many_rigs_have_them(tmp_path):
    grid = 'clearance_ratio = 0.7\nspeed_ratio = [0.5, 2.0]\n"stator.damping.beta" = [0.0, 1e-5]'
    (line,) = CaseGrid(study_of(tmp_path, grid)).warnings()
    assert line.startswith("at 1 of 2 rigs: no damping acts on 18 modes, first the lateral mode of ")
    assert "Hz, of stator 1: once excited, it does not decay" in line
