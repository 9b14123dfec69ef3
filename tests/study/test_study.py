"""Study files: every kind of axis, the other tables, and how much is refused before anything is written."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from malformed import CASES, RIG, STUDY, Malformed

from rubhpc.errors import InputError
from rubhpc.rig.reading import PACKAGED, read_rig
from rubhpc.study.identity import identity_parts
from rubhpc.study.study import Contact, Integrator, Recording, Run, make_axis, read_study

JOBS = Path(__file__).parents[2] / "jobs"


def grid(tmp_path, text, **tables):
    """Read a study with this grid; friction, clearance and speed are there unless given."""
    for key in ("friction", "clearance_ratio", "speed_ratio"):
        if not any(line.startswith(key.split("_")[0]) for line in text.splitlines()):
            text += f"\n{key} = 0.7"
    file = tmp_path / "s.toml"
    rest = "".join(f"[{name}]\n{lines}\n" for name, lines in tables.items())
    file.write_text(f'rig = "mokhtar2017"\n[grid]\n{text}\n{rest}')
    return read_study(file)


@pytest.mark.parametrize(
    ("text", "name", "values"),
    [
        ("friction = 0.3", "friction", (0.3,)),
        ('friction = "30 %"', "friction", (0.3,)),
        ("friction = [0.5, 0.1, 0.3]", "friction", (0.5, 0.1, 0.3)),
        ("speed = [-100, 100]", "speed", (-100.0, 100.0)),
        ('clearance = ["84 um", 1e-4]', "clearance", (84e-6, 1e-4)),
        ("speed_ratio = { start = 1, stop = 2, step = 0.25 }", "speed_ratio", (1.0, 1.25, 1.5, 1.75, 2.0)),
        ("speed_ratio = { start = 2, stop = 1, step = -0.5 }", "speed_ratio", (2.0, 1.5, 1.0)),
        ("speed_ratio = { start = 1, stop = 2, step = 0.3 }", "speed_ratio", (1.0, 1.3, 1.6, 1.9)),
        ("speed_ratio = { start = 1, stop = 1, step = 0.3 }", "speed_ratio", (1.0,)),
        ("friction = { start = 0, stop = 1, num = 3 }", "friction", (0.0, 0.5, 1.0)),
        ('friction = { start = 0, stop = 0.3, num = 4, scale = "lin" }', "friction", (0.0, 0.1, 0.2, 0.3)),
        (
            'clearance = { start = "1 um", stop = "1 cm", num = 3, scale = "log" }',
            "clearance",
            (1e-6, 1e-4, 1e-2),
        ),
        (
            'clearance = { start = "70 um", stop = "0.11 mm", step = "20 um" }',
            "clearance",
            (70e-6, 90e-6, 110e-6),
        ),
        ('"stator.youngs_modulus" = ["3 GPa", 3e10]', "stator.youngs_modulus", (3e9, 3e10)),
        ('stator.youngs_modulus = ["3 GPa", 3e10]', "stator.youngs_modulus", (3e9, 3e10)),
        ('"stator.1.lateral" = [true, false]', "stator.1.lateral", (1.0, 0.0)),
        ('"stator.elements" = { start = 4, stop = 8, step = 2 }', "stator.elements", (4.0, 6.0, 8.0)),
    ],
)
def test_an_axis_may_be_written_in_many_ways(tmp_path, text, name, values):
    assert grid(tmp_path, text).axis(name).values == pytest.approx(values, rel=1e-15)


@given(
    start=st.integers(-1000, 1000),
    n=st.integers(0, 300),
    step=st.integers(1, 500),
    digits=st.integers(0, 9),
)
def test_a_range_includes_its_stop_whatever_the_rounding(start, n, step, digits):
    texts = [float(f"{v}e-{digits}") for v in (start, start + n * step, step)]
    table = dict(zip(("start", "stop", "step"), texts, strict=True))
    axis = make_axis("rotor.unbalance.phase", table, read_rig("mokhtar2017"))
    assert axis.values == tuple(float(f"{start + i * step}e-{digits}") for i in range(n + 1))


def test_axes_know_their_dimension_and_unit(tmp_path):
    text = '"rotor.disc.density" = 7800\nspeed = "1800 rpm"\n"rotor.bearing.1.cyy" = 3'
    axes = {axis.name: axis for axis in grid(tmp_path, text).axes}
    assert [axes[name].dimension for name in axes][:3] == [
        "rotor_disc_density",
        "speed",
        "rotor_bearing_1_cyy",
    ]
    assert [axes[name].unit for name in axes] == ["kg m-3", "rad s-1", "N s m-1", "1", "1"]
    assert all(axis.long_name for axis in axes.values())


def test_the_grid_keeps_its_order(tmp_path):
    text = '"stator.angle" = 0\nfriction = 1\nspeed = 100\nclearance = 1e-4'
    assert [axis.name for axis in grid(tmp_path, text).axes] == [
        "stator.angle",
        "friction",
        "speed",
        "clearance",
    ]


def test_defaults_are_written_out(tmp_path):
    study = grid(tmp_path, "")
    assert study.title == "s"
    assert study.output == Path("s.zarr")
    assert study.rig == read_rig("mokhtar2017").with_geometry("second_order")
    assert study.contact == Contact(law="lagrange", friction_law="coulomb", normal="updated", model=None)
    assert study.integrator == Integrator(method="modal", step=None, accuracy=1e-3)
    assert study.recording == Recording(transient=120, revolutions=64, samples_per_revolution=256)
    assert study.recording.keep == ("waveform", "spectrum", "section")
    assert study.run == Run(block=None, time_limit=None, case_time_limit=None, max_failures=None)


def test_the_default_is_the_physics(tmp_path):
    """A stator that cannot bend is linear."""
    study = grid(tmp_path, "")
    assert study.rig.stator[0].is_bent
    assert study.rig.as_dict()["stator"][0]["geometry"] == "second_order"
    assert study.model == "updated normal, Coulomb friction, second-order stators"
    fixed = grid(tmp_path, "", override='"stator.lateral" = false')
    assert not fixed.rig.stator[0].is_bent
    assert grid(tmp_path, '"stator.1.lateral" = [false, true]').has_bent_stator


def test_a_model_stands_for_its_keys(tmp_path):
    """Also for the identity; a stator that gives its geometry keeps it."""
    study = grid(tmp_path, "", contact='model = "mokhtar2017"')
    assert (study.contact.normal, study.contact.friction_law) == ("fixed", "sliding")
    assert study.rig.stator[0].geometry == "linear"
    assert study.model == "model mokhtar2017"
    assert study.as_dict()["contact"]["model"] == "mokhtar2017"
    keys = {"contact": 'normal = "fixed"\nfriction_law = "sliding"'}
    one_by_one = grid(tmp_path, "", override='"stator.geometry" = "linear"', **keys)
    assert identity_parts(one_by_one) == identity_parts(study)
    override = '"stator.geometry" = "second_order"'
    bent = grid(tmp_path, "", override=override, contact='model = "mokhtar2017"')
    assert bent.model == "fixed normal, sliding friction, second-order stators"


@pytest.mark.parametrize(
    ("text", "contact", "message"),
    [
        ("", 'normal = "updated"', r'\[contact\] normal: "updated" conflicts with model = "mokhtar2017"'),
        ("", 'friction_law = "coulomb"', r'\[contact\] friction_law: "coulomb" .*"sliding"; remove one'),
        ('"contact.normal" = ["fixed", "updated"]', "", r"contact.normal = updated: .* conflicts with model"),
        ('"contact.model" = ["mokhtar2017"]', "", "unknown axis"),
    ],
)
def test_what_a_model_is_not_is_refused(tmp_path, text, contact, message):
    with pytest.raises(InputError, match=message):
        grid(tmp_path, text, contact=f'model = "mokhtar2017"\n{contact}')


def test_every_table_is_read(tmp_path):
    study = grid(
        tmp_path,
        "",
        override='"stator.length" = "41 mm"\nrotor.damping.alpha = 3',
        contact='normal = "updated"',
        integrator='step = "0.4 us"',
        record='transient = 3\nrevolutions = 2\nsamples_per_revolution = 32\nkeep = ["section"]',
        run='block = 5\ntime_limit = "2 h"\ncase_time_limit = 60\nmax_failures = 0',
    )
    assert study.rig.stator[0].length == 0.041
    assert study.rig.rotor.damping.alpha == 3.0
    assert study.contact.normal == "updated"
    assert study.integrator.step == 0.4e-6
    assert study.recording == Recording(
        transient=3, revolutions=2, samples_per_revolution=32, keep=("section",)
    )
    assert study.run == Run(block=5, time_limit=7200.0, case_time_limit=60.0, max_failures=0)
    assert json.loads(json.dumps(study.as_dict()))["grid"]["friction"] == {"unit": "1", "values": [0.7]}


def test_paths_count_from_where_users_expect(tmp_path, monkeypatch):
    (tmp_path / "studies").mkdir()
    (tmp_path / "rigs").mkdir()
    (tmp_path / "rigs" / "own.toml").write_text(RIG)
    (tmp_path / "studies" / "a.toml").write_text(STUDY.replace("own.toml", "../rigs/own.toml"))
    monkeypatch.chdir(tmp_path)
    assert read_study("studies/a.toml").output == Path("good.zarr")  # in the working directory
    assert read_study("studies/a.toml", output="b.zarr").output == Path("b.zarr")


def test_rigs_of_a_grid_need_only_make_sense_case_by_case(tmp_path):
    text = '"rotor.shaft.inner_diameter" = ["22 mm"]\n"rotor.shaft.outer_diameter" = ["24 mm", "26 mm"]'
    assert len(grid(tmp_path, text).axes) == 5
    with pytest.raises(InputError, match=r"\[grid\] rotor\.shaft\.inner_diameter = 0\.022: .*must be below"):
        grid(tmp_path, '"rotor.shaft.inner_diameter" = ["1 mm", "22 mm"]')


def test_a_grid_of_very_many_rigs_is_tried_along_its_axes(tmp_path):
    many = "{ start = 1000, stop = 1099, step = 1 }"
    text = f'"stator.density" = {many}\n"rotor.disc.density" = {many}\n"stator.node" = [8, 77]'
    with pytest.raises(InputError, match=r"stator\.node = 77"):
        grid(tmp_path, text)


@pytest.mark.parametrize("job", ["quickstart", "cascade", "map"])
def test_the_studies_that_come_along_are_read(job):
    study = read_study(JOBS / f"{job}.toml")
    assert study.output == Path(f"{job}.zarr")
    assert study.rig.stator[0].youngs_modulus == 3e10
    if job != "map":  # the pseudo-critical speeds of that modulus are in the grid
        assert {1.7, 3.5, 5.3} <= set(study.axis("speed_ratio").values)


def test_the_good_study_is_good(tmp_path):
    assert len(read_study(Malformed("good", ()).write(tmp_path)).axes) == 3


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_a_malformed_study_is_refused_in_one_line(tmp_path, monkeypatch, case):
    monkeypatch.chdir(tmp_path)
    study = case.write(tmp_path)
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError) as refused:
        read_study(study.relative_to(tmp_path) if study.is_relative_to(tmp_path) else study)
    assert refused.value.exit_code == 2
    assert str(refused.value).isprintable()  # one line, too
    assert [fragment for fragment in case.says if fragment not in str(refused.value)] == []
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before


def test_a_rig_in_place_of_a_study_is_named():
    with pytest.raises(InputError, match=r"mokhtar2017\.toml: is a rig, not a study"):
        read_study(PACKAGED / "mokhtar2017.toml")
