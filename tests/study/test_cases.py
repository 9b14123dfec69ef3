"""Cases and blocks: each case in one block, ids that outlive growth, an identity that moves with results."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_form import Contact, read_rig
from hypothesis import given, settings
from hypothesis import strategies as st

from rubhpc.errors import InputError
from rubhpc.fem.assemble import assemble
from rubhpc.fem.response import contact_free_amplitude, first_lateral_frequency
from rubhpc.rig.reading import with_keys
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import Integrator, Recording, Run, Study, make_axis

RIG = read_rig("mokhtar2017")
SMALL = {"speed_ratio": [0.75, 1.5], "clearance_ratio": [0.7, 0.85], "friction": [0.1, 0.3, 0.5]}


def study(grid=SMALL, rig=RIG, **parts):
    axes = tuple(make_axis(name, values, rig) for name, values in grid.items())
    given = {"output": Path("t.zarr"), "contact": Contact()} | parts
    return Study(title="t", rig=rig, axes=axes, **given)


@st.composite
def grids(draw):
    """Grids of every kind of axis, in any order."""
    ratio = st.lists(st.sampled_from([0.5, 0.75, 1.5, 3.0]), min_size=1, max_size=3, unique=True)
    frictions = st.floats(0, 1).filter(lambda x: x == 0 or x > 1e-30)  # within what a study may hold
    grid = {
        draw(st.sampled_from(["speed", "speed_ratio"])): draw(ratio),
        draw(st.sampled_from(["clearance", "clearance_ratio"])): draw(ratio),
        "friction": draw(st.lists(frictions, min_size=1, max_size=5, unique=True)),
    }
    if draw(st.booleans()):
        grid["stator.youngs_modulus"] = draw(st.permutations([3e9, 3e10]))
    if draw(st.booleans()):
        grid["rotor.bearing.kyy"] = [1e6, 2e6, 3e6][: draw(st.integers(1, 3))]
    return dict(draw(st.permutations(list(grid.items()))))


@settings(max_examples=40, deadline=None)
@given(grid=grids(), block=st.none() | st.integers(1, 40))
def test_every_case_lies_in_exactly_one_block(grid, block):
    case_grid = CaseGrid(study(grid, run=Run(block=block)))
    blocks = case_grid.blocks()
    cases = [case for block in blocks for case in case_grid.cases(block)]
    assert sorted(case.index for case in cases) == list(np.ndindex(case_grid.shape))
    assert len({case.id for case in cases}) == len(cases) == case_grid.n_case
    assert sorted(b.number for b in blocks) == list(range(len(blocks)))
    assert [b.cost for b in blocks] == sorted((b.cost for b in blocks), reverse=True)
    assert all(math.prod(b.shape) <= (block or 16) for b in blocks)
    for b in blocks:  # a block is a chunk of the store: it starts on a multiple of the chunk
        assert all(s % c == 0 for s, c in zip(b.start, case_grid.chunk, strict=True))
        assert case_grid.case_ids(b) == [case.id for case in case_grid.cases(b)]
    assert case_grid.case(cases[-1].index) == cases[-1]
    assert CaseGrid(case_grid.study).blocks() == blocks


@settings(max_examples=30, deadline=None)
@given(grid=grids(), data=st.data())
def test_growth_keeps_identity_and_ids(grid, data):
    """Wherever a new value stands, and whatever the order of the old ones."""
    name = data.draw(st.sampled_from(sorted(grid)))
    longer = data.draw(st.permutations([*grid[name], max(grid[name]) * 1.25 + 0.1]))
    before, after = CaseGrid(study(grid)), CaseGrid(study(grid | {name: longer}))
    assert after.identity == before.identity
    kept = {before.case(i).id: before.case(i) for i in np.ndindex(before.shape)}
    grown = {after.case(i).id: after.case(i) for i in np.ndindex(after.shape)}
    assert kept.keys() < grown.keys()
    for name, case in itertools.islice(kept.items(), 5):
        assert replace(grown[name], index=case.index) == case


@pytest.mark.parametrize(
    "change",
    [
        {"rig": with_keys(RIG, {"stator.length": 0.041})},
        {"rig": with_keys(RIG, {"rotor.bearing.2.kyz": 1.0})},
        {"contact": Contact(normal="updated")},
        {"integrator": Integrator(step=0.4e-6)},
        {"recording": Recording(transient=121)},
        {"recording": Recording(samples_per_revolution=128)},
        {"recording": Recording(keep=("section",))},
        {"grid": {"clearance_ratio": [0.7, 0.85], "speed_ratio": [0.75, 1.5], "friction": [0.1, 0.3, 0.5]}},
        {"grid": {"speed": [0.75, 1.5], "clearance_ratio": [0.7, 0.85], "friction": [0.1, 0.3, 0.5]}},
    ],
)
def test_what_changes_results_changes_the_identity(change):
    assert CaseGrid(study(**change)).identity != CaseGrid(study()).identity


@pytest.mark.parametrize(
    "change",
    [
        {"run": Run(block=3, time_limit=60.0, case_time_limit=1.0, max_failures=3)},
        {"title": "another"},
        {"output": Path("elsewhere.zarr"), "source": Path("a.toml")},
        {"rig": replace(RIG, name="by another name")},
        {"rig": with_keys(RIG, {"rotor.bearing.stiffness": 1_000_000})},
        {"grid": SMALL | {"friction": [0.2]}},
        {"grid": SMALL | {"friction": [0.5, 0.1, 0.3, 0.2]}},
        {"recording": Recording(keep=("section", "spectrum", "waveform"))},
    ],
)
def test_what_changes_no_result_leaves_the_identity(change):
    parts = {"title": "t"} | change
    grid, rig, title = parts.pop("grid", SMALL), parts.pop("rig", RIG), parts.pop("title")
    assert CaseGrid(replace(study(grid, rig, **parts), title=title)).identity == CaseGrid(study()).identity


@pytest.mark.parametrize(
    ("key", "unit"),
    [("stator.youngs_modulus", 1.0), ("stator.1.length", 1.0), ("rotor.bearing.stiffness", 1e7)],
)
def test_what_the_rig_says_of_a_key_that_is_an_axis_leaves_the_identity(key, unit):
    """Every case sets it; another key of the same part still counts."""
    grid = SMALL | {key: [0.05 * unit, 0.06 * unit]}
    identity = CaseGrid(study(grid)).identity
    assert CaseGrid(study(grid, with_keys(RIG, {key: 0.055 * unit}))).identity == identity
    assert CaseGrid(study(SMALL | {key: [0.06 * unit, 0.07 * unit, 0.05 * unit]})).identity == identity
    assert CaseGrid(study(grid, with_keys(RIG, {"stator.width": 0.004}))).identity != identity
    assert CaseGrid(study(SMALL)).identity != identity


def test_a_case_says_what_the_axes_amount_to():
    grid = SMALL | {"stator.youngs_modulus": [3e9, 3e10], "rotor.bearing.kyy": [1e6, 5e5]}
    case = CaseGrid(study(grid)).case((1, 0, 2, 1, 1))
    rig = with_keys(RIG, {"stator.youngs_modulus": 3e10, "rotor.bearing.kyy": 5e5})
    model = assemble(rig)
    speed = 1.5 * first_lateral_frequency(model)
    assert case.rig == rig
    assert case.friction == 0.5
    assert case.speed == pytest.approx(speed, rel=1e-14)
    assert case.contact_free_amplitude == pytest.approx(contact_free_amplitude(model, speed), rel=1e-12)
    assert case.clearance == pytest.approx(0.7 * contact_free_amplitude(model, speed), rel=1e-12)


def test_the_papers_gaps_come_back():
    grid = {"speed_ratio": [3.0, 2.0], "clearance_ratio": [0.70, 0.85], "friction": 0.3}
    case_grid = CaseGrid(study(grid))
    assert case_grid.case((0, 0, 0)).clearance == pytest.approx(76e-6, abs=1e-6)
    assert case_grid.case((1, 0, 0)).clearance == pytest.approx(90e-6, abs=1.5e-6)
    assert case_grid.case((1, 1, 0)).clearance == pytest.approx(110e-6, abs=1.5e-6)


def test_settings_lie_along_the_axes_that_set_them():
    grid = {
        "stator.youngs_modulus": [3e9, 3e10],
        "friction": [0.1, 0.3],
        "rotor.bearing.kyy": [1e6, 5e5, 2e6],
    }
    grid |= {"speed_ratio": [0.75, 1.5], "clearance_ratio": [0.7, 0.8, 0.9, 0.95]}
    case_grid = CaseGrid(study(grid))
    found = case_grid.operating_points()
    assert found["spin_speed"][0] == ("rotor_bearing_kyy", "speed_ratio")
    assert found["contact_free_amplitude"][0] == ("rotor_bearing_kyy", "speed_ratio")
    assert found["clearance"][0] == ("rotor_bearing_kyy", "speed_ratio", "clearance_ratio")
    for index in [(0, 0, 0, 0, 0), (1, 1, 2, 1, 3), (1, 0, 1, 0, 2)]:
        case, at = case_grid.case(index), dict(zip(case_grid.dims, index, strict=True))
        for name, value in (
            ("spin_speed", case.speed),
            ("clearance", case.clearance),
            ("contact_free_amplitude", case.contact_free_amplitude),
        ):
            dims, values = found[name]
            assert values[tuple(at[dim] for dim in dims)] == value  # to the last bit


def test_the_node_of_the_stator_is_where_the_amplitude_is_taken():
    rig = with_keys(RIG, {"stator.radius": 0.06})
    case_grid = CaseGrid(study(SMALL | {"stator.node": [8, 5]}, rig))
    dims, amplitude = case_grid.operating_points()["contact_free_amplitude"]
    assert dims == ("speed_ratio", "stator_node")
    assert np.all(amplitude[:, 1] < 0.9 * amplitude[:, 0])  # nearer to the bearing the shaft swings less
    model = assemble(rig)
    assert amplitude[0, 1] == pytest.approx(
        contact_free_amplitude(model, case_grid.case((0, 0, 0, 1)).speed, 5)
    )


def test_absolute_axes_are_their_own_settings():
    case_grid = CaseGrid(study({"speed": [100.0, -100.0], "clearance": ["84 um", "100 um"], "friction": 0.3}))
    found = case_grid.operating_points()
    assert found["spin_speed"][0] == ("speed",)
    assert found["clearance"][0] == ("clearance",)
    assert list(found["clearance"][1]) == [84e-6, 100e-6]
    amplitude = found["contact_free_amplitude"][1]
    assert amplitude[0] == pytest.approx(amplitude[1])  # of either sense of rotation


def test_cost_is_revolutions_over_speed_over_step():
    recording = Recording(transient=10, revolutions=6)
    grid = {"speed": [50.0, -200.0, 100.0], "clearance": 1e-4, "friction": [0.1, 0.2]}
    case_grid = CaseGrid(
        study(
            grid,
            recording=recording,
            integrator=Integrator(method="central-difference", step=0.5e-6),
            run=Run(block=2),
        )
    )
    assert [(b.start[0], b.cost) for b in case_grid.blocks()] == [
        (i, round(2 * 16 * 2 * math.pi / speed / 0.5e-6)) for i, speed in ((0, 50), (2, 100), (1, 200))
    ]


def test_a_block_shares_its_speed_and_rig():
    grid = SMALL | {"stator.youngs_modulus": [3e9, 3e10]}
    case_grid = CaseGrid(study(grid, run=Run(block=6)))
    assert case_grid.chunk == (1, 2, 3, 1)
    assert CaseGrid(study(grid, run=Run(block=12))).chunk == (2, 2, 3, 1)
    assert CaseGrid(study(grid, run=Run(block=4))).chunk == (1, 1, 3, 1)
    assert CaseGrid(study(grid), chunk=(2, 1, 2, 2)).blocks()[0].shape in {(2, 1, 2, 2), (2, 1, 1, 2)}


def test_a_step_beyond_stability_is_refused_before_the_run():
    grid = SMALL | {"stator.youngs_modulus": [3e9, 3e10]}
    with pytest.raises(
        InputError, match=r"\[integrator\] step: 1e-06 s .* stator\.youngs_modulus = 3e\+10; use less"
    ):
        CaseGrid(study(grid, integrator=Integrator(method="central-difference", step=1e-6)))
    CaseGrid(study(SMALL, integrator=Integrator(method="central-difference", step=1e-6)))


def test_a_refusal_of_the_settings_names_the_file(tmp_path):
    file = tmp_path / "study.toml"
    with pytest.raises(InputError, match=r"study\.toml: \[integrator\] step: 0\.001 s is above"):
        CaseGrid(study(integrator=Integrator(method="central-difference", step=1e-3), source=file))
    rig = with_keys(RIG, {"stator.clearance_offset": "-90 um"})  # 0.7 of 122 um is less
    with pytest.raises(InputError, match=r"study\.toml: \[grid\] clearance_ratio: .* leave no gap"):
        CaseGrid(study(rig=rig, source=file)).operating_points()


def test_a_million_cases_are_planned():
    many = {"start": 0.5, "stop": 5.5, "num": 100}
    case_grid = CaseGrid(
        study({"speed_ratio": many, "clearance_ratio": many | {"start": 0.1, "stop": 0.9}, "friction": many})
    )
    blocks = case_grid.blocks()
    case_grid.operating_points()
    assert sum(math.prod(b.shape) for b in blocks) == case_grid.n_case == 1_000_000
    ids = [case_id for block in blocks[:50] for case_id in case_grid.case_ids(block)]
    assert len(set(ids)) == len(ids) == sum(math.prod(b.shape) for b in blocks[:50])


def test_the_quick_start_fits_into_a_minute_of_two_cores():
    from rubhpc.study.study import read_study

    for job in ("quickstart", "cascade"):
        case_grid = CaseGrid(read_study(Path(__file__).parents[2] / "jobs" / f"{job}.toml"))
        # half a microsecond of a core for a step of half a microsecond
        assert sum(block.cost for block in case_grid.blocks()) * 0.5e-6 < 70
