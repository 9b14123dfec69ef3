"""Rings of stators: one table with a count, held one by one."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from calling import called

import rubhpc
from rubhpc import InputError, Rig, assemble, read_rig
from rubhpc.integrate.marches.workspace import workspace
from rubhpc.integrate.packing import pack, pairs_of
from rubhpc.kernels.complementarity import UNSOLVED, solve_complementarity
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.rig.stators import MOST_STATORS
from rubhpc.study.study import make_axis

solve_complementarity = called(solve_complementarity)

PACKAGED = read_rig("mokhtar2017")
PACKAGED_FILE = Path(rubhpc.__file__).parent / "rigs" / "mokhtar2017.toml"
ONE = PACKAGED.stator[0]


def ring(count, **changed):
    return replace(PACKAGED, stator=(replace(ONE, count=count, **changed),))


@pytest.mark.parametrize("count", [1, 2, 3, 12, 32, MOST_STATORS])
def test_a_ring_is_so_many_equal_stators(count):
    rig = ring(count, angle=0.4)
    assert len(rig.stator) == count
    assert [s.angle for s in rig.stator] == pytest.approx(0.4 + 2 * math.pi * np.arange(count) / count)
    assert all(replace(s, angle=0.0) == ONE for s in rig.stator)


def test_a_ring_is_the_same_rig_as_its_stators_written_out():
    single = tuple(replace(ONE, angle=2 * math.pi * i / 3) for i in range(3))
    assert ring(3) == replace(PACKAGED, stator=single)
    linear = ring(3).with_geometry("linear")
    assert rig_from_dict(linear.as_dict()) == linear
    assert "count" not in ring(3).as_dict()["stator"][0]


def test_rig_file_takes_a_ring_among_others(tmp_path):
    text = (tmp_path.parent / "x").name  # any name
    table = PACKAGED.as_dict() | {"name": text}
    table["stator"] = [table["stator"][0] | {"count": 4, "angle": "45 deg"}, table["stator"][0]]
    rig = rig_from_dict(table)
    assert [round(math.degrees(s.angle)) for s in rig.stator] == [45, 135, 225, 315, 0]


def test_stators_of_a_ring_have_keys_of_their_own():
    rig = with_keys(with_keys(ring(4), {"stator.length": "50 mm"}), {"stator.3.angle": "170 deg"})
    assert [s.length for s in rig.stator] == [0.05] * 4
    assert [round(math.degrees(s.angle)) for s in rig.stator] == [0, 90, 170, 270]
    assert make_axis("stator.4.clearance_offset", ["1 um"], rig).values == (1e-6,)
    with pytest.raises(InputError, match=r"stator\.5\.angle: unknown key; did you mean stator"):
        with_keys(rig, {"stator.5.angle": 0.0})
    for key in ("stator.count", "stator.2.count"):
        with pytest.raises(InputError, match="cannot be set by a study; write it in the rig"):
            with_keys(rig, {key: 3})
        with pytest.raises(InputError, match="cannot be set by a study; write it in the rig"):
            make_axis(key, [3, 4], rig)


@pytest.mark.parametrize(
    ("count", "message"),
    [
        (0, "count: 0 is out of range; it must be at least 1"),
        (-3, "count: -3 is out of range"),
        (1.5, "count: 1.5 is not a whole number"),
        ("12", 'count: "12" is not a whole number'),
        (True, "count: true is not a whole number"),
        (10**9, "count: 1000000000 is out of range; it must be at most 62"),
    ],
)
def test_senseless_counts_are_refused(count, message):
    table = PACKAGED.as_dict()
    table["stator"] = [table["stator"][0] | {"count": count}]
    with pytest.raises(InputError, match=message):
        rig_from_dict(table)


def test_stators_of_a_ring_do_not_stand_in_each_other():
    with pytest.raises(InputError, match=r"stator\.5\.angle: coincides with stator\.1, at 0 deg"):
        replace(PACKAGED, stator=(replace(ONE, count=4), replace(ONE, angle=2 * math.pi)))
    two = (replace(ONE, count=4, angle=0.2), replace(ONE, count=4))
    assert len(replace(PACKAGED, stator=two).stator) == 8
    with pytest.raises(InputError, match="stator: 80 stators are too many; use at most 62"):
        replace(PACKAGED, stator=(replace(ONE, count=40), replace(ONE, count=40, angle=0.01)))
    assert isinstance(ring(3), Rig)


@pytest.mark.parametrize("count", [3, 12, 32])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_forces_of_a_ring_are_one_problem_solved_in_few_pivots(count, friction):
    """The disc anywhere, tips disturbed, in steps of 0.5 us: no gap is left, no force pulls."""
    model = assemble(ring(count))
    step, spin = 0.5e-6, 300.0
    packed = pack(model, spin, step)
    pairs = pairs_of(
        model,
        row=packed.degree_row,
        block=packed.degree_block,
        compliance=packed.compliance,
        clearance=1e-4,
        friction=friction,
        spin=spin,
        is_updated=False,
    )
    matrix = workspace(pairs, step).matrix
    random = np.random.default_rng(count)
    angle = np.array([stator.angle for stator in model.stators])
    most_pivots, worst, together = 0, 0.0, 0
    for _ in range(300):
        toward = random.uniform(0, 2 * math.pi)
        gap = 1e-4 - random.uniform(0, 2e-4) * np.cos(angle - toward) + random.normal(0, 2e-5, count)
        force, active = np.zeros(count), gap < 0
        pivots = solve_complementarity(matrix, gap, 1e-14, force, active, np.zeros((count, count + 1)))
        assert pivots != UNSOLVED
        left = gap + matrix @ force
        scale = np.abs(gap).max()
        pulled = -force.min() * matrix[0, 0]
        worst = max(worst, pulled / scale, -left.min() / scale, abs(left[active]).max(initial=0.0) / scale)
        most_pivots, together = max(most_pivots, pivots), max(together, np.count_nonzero(force))
    assert together > 1
    assert most_pivots <= 6
    assert worst < 1e-12


def test_a_store_shows_where_the_stators_stand_and_which_cases_diverged(tmp_path):
    """Dry friction drives the whirl of a ring without bound: a result of its own, which stops nothing."""
    (tmp_path / "study.toml").write_text(
        'rig = "ring.toml"\n[grid]\nspeed_ratio = 1.5\nclearance_ratio = 0.8\nfriction = [0.3, 0.02]\n'
        '[contact]\nmodel = "mokhtar2017"\n'
        "[record]\ntransient = 12\nrevolutions = 2\nsamples_per_revolution = 64\n"
    )
    packaged = PACKAGED_FILE.read_text().replace("[[stator]]", "[[stator]]\ncount = 3")
    (tmp_path / "ring.toml").write_text(packaged)
    summary = rubhpc.run(tmp_path / "study.toml", output=tmp_path / "ring.zarr", quiet=True)
    assert summary.exit_code == 0
    cases = rubhpc.open(tmp_path / "ring.zarr")
    assert cases["status"].values.ravel().tolist() == [3, 1]
    assert cases["stator_angle"].values == pytest.approx(2 * math.pi / 3 * np.arange(3))
    assert cases["stator_angle"].attrs["units"] == "rad"
    assert cases["stator_node"].values.tolist() == [8, 8, 8]
    assert {"stator_angle", "stator_node"} <= set(cases.coords)
