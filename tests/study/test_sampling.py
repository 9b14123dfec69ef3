"""Sampled studies: the points are Saltelli's, their cases stay what they are as the sample grows."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from running import write_sample, write_study
from SALib.sample import sobol

from rubhpc.errors import InputError, StoreError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.rig.reading import with_keys
from rubhpc.running.driver import run as run_here
from rubhpc.running.plan import make_plan
from rubhpc.running.recompute import reproduce
from rubhpc.storage.new_manifest import manifest_of
from rubhpc.storage.resume import differences
from rubhpc.storage.status import read_status
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import Sample, draw, make_axis, make_range, read_study


def test_the_points_are_those_of_saltelli(tmp_path):
    study = read_study(write_sample(tmp_path, n=16, seed=3))
    speed, clearance, friction = study.axes
    problem = {"num_vars": 2, "names": ["a", "b"], "bounds": [[1.2, 2.4], [np.log(0.05), np.log(0.5)]]}
    points = sobol.sample(problem, 16, calc_second_order=False, seed=3)
    np.testing.assert_allclose(speed.values, points[:, 0], rtol=1e-14)
    np.testing.assert_allclose(friction.values, np.exp(points[:, 1]), rtol=1e-14)
    assert clearance.values == (0.7, 0.85)
    case_grid = CaseGrid(study)
    assert (case_grid.dims, case_grid.shape) == (("case", "clearance_ratio"), (64, 2))
    cases = [case for block in case_grid.blocks() for case in case_grid.cases(block)]
    assert len({case.id for case in cases}) == 128
    reported = {case.index: case for case in cases}
    for i in (0, 17, 63):
        assert reported[i, 1].friction == friction.values[i]
        assert reported[i, 1] == case_grid.case((i, 1))
        assert (
            case_grid.operating_points()["spin_speed"][1][i] == reported[i, 0].speed == reported[i, 1].speed
        )


def test_each_case_has_the_speed_and_the_rig_of_its_row(tmp_path):
    """Rotor, stator and speed all drawn: each against the rig made by hand."""
    base = read_study(write_study(tmp_path))
    ranges = {
        "speed_ratio": {"start": 1.2, "stop": 2.4},
        "stator.youngs_modulus": {"start": 3e9, "stop": 3e10, "scale": "log"},
        "rotor.disc.thickness": {"start": "25 mm", "stop": "35 mm"},
    }
    axes = [make_range(name, table, base.rig) for name, table in ranges.items()]
    fixed = [
        make_axis(name, value, base.rig) for name, value in {"clearance_ratio": 0.7, "friction": 0.3}.items()
    ]
    sample = Sample(n=8)
    study = replace(base, axes=draw([*axes, *fixed], sample, base.rig), sample=sample)
    case_grid = CaseGrid(study)
    assert case_grid.dims == ("case", "clearance_ratio", "friction")
    for i in (0, 1, 13, 39):
        ratio, modulus, thickness = (axis.values[i] for axis in study.axes[:3])
        rig = with_keys(base.rig, {"stator.youngs_modulus": modulus, "rotor.disc.thickness": thickness})
        model = assemble(rig)
        case = case_grid.case((i, 0, 0))
        assert case.rig.stator[0].youngs_modulus == modulus
        assert case.rig.rotor.disc[0].thickness == thickness
        assert case.speed == ratio * first_lateral_frequency(model)
        assert case.contact_free_amplitude == contact_free_amplitude(model, case.speed)
        assert case.clearance == 0.7 * case.contact_free_amplitude


def test_a_larger_sample_keeps_every_case(tmp_path):
    few = {"keep": '["section"]', "block": 8}
    run_here(read_study(write_sample(tmp_path, n=8, **few)), quiet=True)
    before = xr.open_zarr(tmp_path / "tiny.zarr").load()
    summary = run_here(read_study(write_sample(tmp_path, n=16, **few)), quiet=True)
    assert (summary.computed, sum(summary.counts)) == (64, 128)
    after = xr.open_zarr(tmp_path / "tiny.zarr").load()
    xr.testing.assert_equal(after.isel(case=slice(32)), before)
    assert not verify(tmp_path / "tiny.zarr")
    whole = read_study(write_sample(tmp_path, n=16, **few), tmp_path / "whole.zarr")
    run_here(whole, quiet=True)
    xr.testing.assert_equal(
        after.drop_vars("wall_time"), xr.open_zarr(whole.output).load().drop_vars("wall_time")
    )


def test_another_sample_is_refused_and_reported(tmp_path):
    def differs(**changes: object) -> str:
        with pytest.raises(StoreError) as refused:
            run_here(read_study(write_sample(tmp_path, "other.toml", **changes)), quiet=True)
        return str(refused.value)

    run_here(read_study(write_sample(tmp_path, n=16)), quiet=True)
    assert "the sample lacks 32 of its 64 cases (n can only grow)" in differs(n=8)
    assert "sample.seed was 1, is 2" in differs(n=16, seed=2)
    wider = "{ start = 1.2, stop = 2.5 }"
    assert "sample.ranges.speed_ratio.stop was 2.4, is 2.5" in differs(n=16, speed_ratio=wider)
    axes = read_study(write_sample(tmp_path, n=16)).axes
    assert "axes were case, clearance_ratio, are speed_ratio" in differs(
        speed_ratio=[0.9], friction=[0.1], run=""
    )
    assert len(axes[0].values) == 64


def test_points_that_a_library_draws_otherwise_are_no_growth(tmp_path):
    study = read_study(write_sample(tmp_path))
    run_here(study, quiet=True)
    moved = replace(study.axes[0], values=(study.axes[0].values[0] + 1e-9, *study.axes[0].values[1:]))
    with pytest.raises(StoreError, match=r"lacks 1 of its 32 cases \(this SALib or SciPy draws other points"):
        run_here(replace(study, axes=(moved, *study.axes[1:])), quiet=True)


def test_a_store_shows_its_sample(tmp_path):
    path = write_sample(tmp_path)
    study = read_study(path)
    plan = make_plan(study).text()
    assert "64 = 32 case (8 points of 2 ranges) x 2 clearance_ratio" in plan
    run_here(study, quiet=True)
    cases = xr.open_zarr(study.output)
    assert cases["peak_torsion"].dims == ("case", "clearance_ratio")
    assert cases["case"].values.tolist() == list(range(32))
    np.testing.assert_array_equal(cases.coords["friction"].values, study.axes[2].values)
    assert cases.coords["speed_ratio"].dims == ("case",)
    assert cases.attrs["study"]["sample"] == {"method": "sobol", "n": 8, "seed": 1}
    reported = cases.attrs["study"]["grid"]["friction"]
    assert reported == {"unit": "1", "start": 0.05, "stop": 0.5, "scale": "log"}
    manifest = Store(study.output).manifest
    assert manifest.name_case(5).startswith("case=2, speed_ratio=")
    assert "holds the same, bit for bit" in reproduce(study, manifest.case_id(5)).verdict
    assert "64 done" in read_status(study.output).text()


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("n = 8", "n = 12", "[sample] n: 12 is not a power of two"),
        ("n = 8", "n = 4", "[sample] n: 4 is out of range; it must be at least 8"),
        ("n = 8", "n = 1048576", "4194304 cases, too many; the limit is 2000000, use a smaller n"),
        ("n = 8", "", "[sample] n: missing; add n = 1024"),
        (
            "n = 8",
            'n = 8\nmethod = "sobal"',
            '[sample] method: "sobal" is not available; choose one of "sobol"',
        ),
        ("n = 8", "n = 8\nsead = 1", "[sample] sead: unknown key; did you mean seed?"),
        (", stop = 2.4", "", "[grid] speed_ratio: a range needs stop"),
        ("start = 1.2, ", "", "[grid] speed_ratio: a range needs start"),
        ("stop = 2.4", "stop = 1.2", "start and stop are both 1.2; write that value alone"),
        (
            "stop = 2.4",
            "stop = 2.4, step = 0.1",
            "step: a sample is drawn from start to stop; remove step or",
        ),
        ("stop = 2.4", 'stop = 2.4, sweep = "up"', "sweep: the cases of a sample have no neighbours"),
        ("stop = 2.4", "stpo = 2.4", 'unknown key "stpo" in a range; did you mean stop?'),
        ("start = 1.2", "start = -1.2", "contains 0, which is not a valid speed"),
        ("start = 0.05", "start = 0", "a logarithmic range from 0 to 0.5"),
        ('"log"', '"loog"', 'scale "loog" is unknown'),
        ("{ start = 1.2, stop = 2.4 }", "1.7", "friction is the only range; write at least two"),
        ("[sample]\nn = 8", "", "a range has either step or num; write one of them, or add [sample]"),
        ("[contact]", '"stator.elements" = { start = 2, stop = 6 }\n[contact]', "none but a quantity"),
        (
            "[contact]",
            '"rotor.shaft.inner_diameter" = { start = "1 mm", stop = "3 cm" }\n[contact]',
            "rotor.shaft.inner_diameter = 0.03: invalid rig",
        ),
    ],
)
def test_a_sample_that_cannot_be_is_refused(tmp_path, old, new, says):
    path = write_sample(tmp_path)
    text = path.read_text()
    assert text.count(old) == 1, old
    path.write_text(text.replace(old, new))
    with pytest.raises(InputError) as refused:
        read_study(path)
    assert says in str(refused.value)
    assert str(refused.value).startswith(f"{path}: ")
    assert not list(tmp_path.glob("*.zarr"))


@pytest.mark.parametrize("method", ["sobol-sequence", "lhs", "random"])
def test_other_methods_draw_any_number_of_cases(tmp_path, method):
    """Each mean is that of the range: within 4 standard errors if random; a hypercube fills each slice."""
    sampled = f'[sample]\nn = 100\nmethod = "{method}"'
    study = read_study(write_sample(tmp_path, run=sampled))
    grid = CaseGrid(study)
    assert grid.shape == (100, 2)
    speed = (np.array(study.axes[0].values) - 1.2) / 1.2
    friction = np.log(np.array(study.axes[2].values) / 0.05) / np.log(10)
    for share in (speed, friction):
        assert share.min() >= 0
        assert share.max() <= 1
        assert share.mean() == pytest.approx(0.5, abs=4 / np.sqrt(12 * 100) if method == "random" else 0.02)
        slices = np.bincount((100 * share).astype(int), minlength=100)
        assert (slices == 1).all() == (method == "lhs")
    assert abs(np.corrcoef(speed, friction)[0, 1]) < 0.4
    one = read_study(write_sample(tmp_path, "one.toml", run=sampled, speed_ratio=[1.4]))
    assert CaseGrid(one).dims == ("speed_ratio", "clearance_ratio", "case")
    seeded = read_study(write_sample(tmp_path, "seed.toml", run=sampled + "\nseed = 2"))
    assert seeded.axes[0].values != study.axes[0].values


@pytest.mark.parametrize("method", ["sobol-sequence", "random"])
def test_a_longer_sequence_keeps_its_cases(tmp_path, method):
    short, long = (
        CaseGrid(read_study(write_sample(tmp_path, run=f'[sample]\nn = {n}\nmethod = "{method}"')))
        for n in (13, 50)
    )
    assert short.identity == long.identity
    ids = {case.id for block in long.blocks() for case in long.cases(block)}
    assert {case.id for block in short.blocks() for case in short.cases(block)} < ids


def test_a_latin_hypercube_cannot_grow(tmp_path):
    short, long = (
        manifest_of(CaseGrid(read_study(write_sample(tmp_path, run=f'[sample]\nn = {n}\nmethod = "lhs"'))))
        for n in (8, 16)
    )
    assert differences(short, long) == [
        "sample.n (this sample is drawn as a whole and cannot grow) was 8, is 16"
    ]


def test_a_sample_needs_a_range(tmp_path):
    path = write_sample(
        tmp_path, run='[sample]\nn = 8\nmethod = "lhs"', speed_ratio=[1.4], friction=[0.1, 0.2]
    )
    with pytest.raises(
        InputError, match=r"no axis of \[grid\] is a range; write a \{ start, stop \}, or leave"
    ):
        read_study(path)


def with_share(tmp_path, n, method="sobol-sequence", share=0.4, **changes):
    """A sample of clearance ratios up to 3, of a speed, and of nothing else."""
    sampled = f'[sample]\nn = {n}\nmethod = "{method}"\nrub_share = {share}'
    axes = {"clearance_ratio": "{ start = 0.8, stop = 3 }", "friction": 0.3} | changes
    return write_sample(tmp_path, run=sampled, **axes)


@pytest.mark.parametrize("method", ["sobol-sequence", "random"])
def test_a_share_of_the_cases_would_touch(tmp_path, method):
    """A circular orbit about a stator reaches it below a clearance ratio of 1, and only there."""
    few, many = (read_study(with_share(tmp_path, n, method)) for n in (13, 40))
    ratios = np.array(many.axis("clearance_ratio").values)
    assert np.cumsum(ratios < 1).tolist() == [int(0.4 * (k + 1)) for k in range(40)]
    for axis in many.axes:
        assert axis.values[:13] == few.axis(axis.name).values[: len(axis.values)]
    assert max(ratios) > 2.5
    assert CaseGrid(few).identity == CaseGrid(many).identity
    assert many.as_dict()["sample"]["rub_share"] == 0.4


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        (
            {"method": "lhs"},
            '[sample] rub_share: has no effect on the points of lhs; set method = "sobol-seq',
        ),
        ({"share": 1.0}, "[sample] rub_share: 1 is out of range; it must be below 1"),
        (
            {"clearance_ratio": [0.7, 1.2]},
            "[sample] rub_share: clearance_ratio has 2 values, at each of which",
        ),
        (
            {"clearance_ratio": 1.2},
            "rub_share: 0 of 640 drawn cases reach a stator, 4 are needed; take smaller",
        ),
        (
            {"clearance_ratio": 0.7},
            "0 of 640 drawn cases stay clear of the stators, 6 are needed; take larger",
        ),
    ],
)
def test_a_share_that_cannot_be_is_refused(tmp_path, changes, says):
    with pytest.raises(InputError) as refused:
        read_study(with_share(tmp_path, 10, **changes))
    assert says in str(refused.value)
