"""The command `modes`: its JSON, its table and its figure."""

import json
import math
import subprocess
import sys
from dataclasses import replace
from functools import partial

import pytest
from click.testing import CliRunner
from printing import printed
from trial_rig import trial_rig

from rubhpc import linear_design
from rubhpc.commands.design import print_design
from rubhpc.commands.modes import modes
from rubhpc.errors import InputError
from rubhpc.rig.reading import PACKAGED

run = partial(printed, modes)


def test_json_has_the_promised_keys_and_only_those():
    document = json.loads(run("mokhtar2017", "--json", "--speed", "1800 rpm", "--speed", "0"))
    assert list(document) == ["speeds"]
    spinning, still = document["speeds"]
    assert set(spinning) == {"speed", "rotor", "stators"}
    assert spinning["speed"] == pytest.approx(60 * math.pi)
    assert still["speed"] == 0.0
    assert len(spinning["rotor"]) == 15 * 6 - 2
    assert [len(stator) for stator in spinning["stators"]] == [18]
    for mode in spinning["rotor"] + spinning["stators"][0]:
        assert set(mode) == {"frequency", "damping_ratio", "kind", "whirl"}
    assert [mode["whirl"] for mode in still["rotor"][:3]] == ["planar", "planar", "none"]
    assert [mode["whirl"] for mode in spinning["rotor"][:3]] == ["backward", "forward", "none"]
    assert [mode["kind"] for mode in still["rotor"][:3]] == ["lateral", "lateral", "torsional"]
    assert still["rotor"][0]["frequency"] == pytest.approx(31.5596, rel=1e-5)
    assert still["rotor"][0]["damping_ratio"] == pytest.approx(31.7 / (4 * math.pi * 31.5596), rel=1e-5)


def test_plain_number_is_a_speed_in_radians_a_second():
    document = json.loads(run("mokhtar2017", "--json", "--speed", "100", "--count", "1"))
    assert document["speeds"][0]["speed"] == 100.0
    assert len(document["speeds"][0]["rotor"]) == len(document["speeds"][0]["stators"][0]) == 1


def test_table_stands_still_by_default():
    lines = run("mokhtar2017", "--count", "3").splitlines()
    assert "Rotor at 0 rpm (0 rad/s)" in lines
    assert "Stator 1" in lines
    first = lines[lines.index("Rotor at 0 rpm (0 rad/s)") + 2].split()
    assert [float(word) for word in first[:3]] == pytest.approx([31.5596, 31.4586, 0.07993], rel=1e-4)
    assert first[3:] == ["lateral", "planar"]


def test_table_says_how_many_modes_it_leaves_out():
    assert "(76 more; --count 88 shows all)" in run("mokhtar2017")
    assert "more;" not in run("mokhtar2017", "--count", "88")


def test_equal_stators_have_one_table(tmp_path):
    """Of a ring of 8 and one that is longer."""
    rig = (PACKAGED / "mokhtar2017.toml").read_text()
    begin = rig.index("[[stator]]")
    ring = rig[begin:].replace("node = 8", "node = 8\ncount = 8", 1)
    longer = rig[begin:].replace('"40 mm"', '"50 mm"').replace("angle = 0.0", "angle = 0.1")
    (tmp_path / "ring.toml").write_text(rig[:begin] + ring + "\n" + longer)
    lines = run(str(tmp_path / "ring.toml"), "--count", "3").splitlines()
    titles = [line for line in lines if line.startswith(("Stator", "Carrier"))]
    assert titles == ["Stators 1 to 8, each", "Stator 9"]


def test_a_wall_has_no_table(tmp_path):
    rig = (PACKAGED / "mokhtar2017.toml").read_text()
    (tmp_path / "walled.toml").write_text(rig + "\n[[stator]]\nnode = 8\nangle = 3.0\nrigid = true\n")
    lines = run(str(tmp_path / "walled.toml"), "--count", "3").splitlines()
    assert lines[-1] == "Stator 2: a wall, which does not move"


def test_a_rotor_that_floats_freely_is_warned_of(tmp_path):
    text = (PACKAGED / "mokhtar2017.toml").read_text().replace("stiffness = 1e6", "stiffness = 0.0")
    (tmp_path / "loose.toml").write_text(text)
    assert "warning: the rotor floats freely: its bearings do not hold it" in run(
        str(tmp_path / "loose.toml")
    )
    assert "floats" not in run("mokhtar2017")


def test_no_damping_is_printed_as_zero_and_warned_of(tmp_path):
    rig = (PACKAGED / "mokhtar2017.toml").read_text().replace("beta = 1.98e-5", "beta = 0.0")
    (tmp_path / "undamped.toml").write_text(rig)
    result = CliRunner().invoke(modes, [str(tmp_path / "undamped.toml"), "--speed", "100", "--speed", "200"])
    table = result.stdout.split("Stator 1")[1]
    assert table.count(" 0.00000 ") == 12
    assert "-0.00000" not in result.stdout
    assert result.stderr.count("warning: no damping acts on 18 modes") == 1


@pytest.mark.parametrize("extension", ["png", "svg"])
def test_figure_is_written_in_the_format_of_its_name(tmp_path, extension):
    path = tmp_path / f"campbell.{extension}"
    run("mokhtar2017", "--figure", str(path), "--count", "3", "--speed", "3000 rpm")
    head = path.read_bytes()[:200]
    assert head.startswith(b"\x89PNG") if extension == "png" else b"<svg" in path.read_bytes()[:2000]


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["mokhtar2018"], "mokhtar2017"),
        (["mokhtar2017", "--speed", "30 kg"], "--speed"),
        (["mokhtar2017", "--speed", "nan"], "--speed"),
        (["mokhtar2017", "--figure", "campbell.doc"], ".png"),
    ],
)
def test_mistakes_are_named_in_one_line(arguments, named):
    with pytest.raises(InputError) as error:
        run(*arguments)
    assert named in str(error.value)
    assert "\n" not in str(error.value)


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from rubhpc.commands.modes import modes; modes(['--help'], standalone_mode=False);"
        "print([name for name in ('numpy', 'scipy', 'matplotlib', 'pint') if name in sys.modules])"
    )
    output = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert output.rstrip().endswith("[]")


RANGE = ("--range", "0 rpm", "3000 rpm")


def test_design_is_printed_and_put_into_json():
    output = run("mokhtar2017", "--count", "1", *RANGE, "--operating", "2400 rpm", "2800 rpm")
    assert "Critical speeds from 0 to 3000 rpm" in output
    rows = [line.split() for line in output.splitlines() if line.endswith("excites")]
    assert [float(row[0]) for row in rows] == pytest.approx([1893.74], abs=0.01)
    assert "Static sag: none" in output
    assert "Stability: stable throughout; least logarithmic decrement of the modes reached 0.5038" in output
    document = json.loads(run("mokhtar2017", "--json", *RANGE, "--response", "8", "--response", "2"))
    assert [c["whirl"] for c in document["critical_speeds"]] == ["backward", "forward"]
    assert [c["is_excited"] for c in document["critical_speeds"]] == [False, True]
    assert [r["node"] for r in document["response"]] == [8, 2]
    assert len(document["response"][0]["speed"]) == len(document["response"][0]["probes"][1]["phase"])
    assert {peak["node"] for peak in document["peaks"]} == {2, 8}
    assert document["peaks"][0]["amplification_factor"] == pytest.approx(6.09, abs=0.01)
    assert document["threshold_speed"] is None
    assert len(document["static_sag"]) == 15


def test_a_sag_that_rounds_to_nothing_has_no_sign(capsys):
    rig = trial_rig(1)
    design = linear_design(replace(rig, rotor=replace(rig.rotor, gravity=9.81)), (0.0, 20.0), n_speed=2)
    print_design(design.assign(sag_horizontal=-1e-25 + 0.0 * design["sag_horizontal"]))
    lines = capsys.readouterr().out.splitlines()
    first = lines.index("Static sag at 0 rpm, um") + 2
    assert [line.split()[2] for line in lines[first : first + 5]] == 5 * ["0.0000"]


def test_response_and_shapes_are_drawn_and_written(tmp_path):
    figure, table = tmp_path / "a.png", tmp_path / "a.csv"
    run("mokhtar2017", *RANGE, "--response", "8", "--figure", str(figure), "--data", str(table))
    assert figure.stat().st_size > 10_000
    assert "major_axis (m)" in table.read_text().splitlines()[0]
    run("mokhtar2017", *RANGE, "--shapes", "--figure", str(figure), "--data", str(tmp_path / "b.nc"))
    run("mokhtar2017", *RANGE, "--data", str(tmp_path / "c.nc"))
    assert (tmp_path / "c.nc").stat().st_size > 10_000


def test_wrong_designs_are_refused(tmp_path):
    with pytest.raises(InputError, match="--shapes: conflicts with --response"):
        run("mokhtar2017", "--shapes", "--response", "8")
    with pytest.raises(InputError, match="a whole design is not a table"):
        run("mokhtar2017", *RANGE, "--data", str(tmp_path / "a.csv"))
    with pytest.raises(InputError, match="node: 99 does not move sideways; nodes 1 to 15 do"):
        run("mokhtar2017", *RANGE, "--response", "99")
    with pytest.raises(InputError, match=r"range: 314.159 to 104.72 rad/s is not a range"):
        run("mokhtar2017", "--range", "3000 rpm", "1000 rpm")


def test_an_unstable_rotor_is_warned_of(tmp_path):
    path = tmp_path / "seal.toml"
    path.write_text(
        (PACKAGED / "mokhtar2017.toml").read_text()
        + "\n[[rotor.bearing]]\nnode = 8\nspeed = [0.0, 500.0]\nkyy = 0.0\nkzz = 0.0\n"
        "kyz = [0.0, 1e5]\nkzy = [0.0, -1e5]\n"
    )
    result = CliRunner().invoke(modes, [str(path), "--speed", "100", "--speed", "400", "--count", "1"])
    warnings = [line for line in result.output.splitlines() if line.startswith("warning:")]
    assert len(warnings) == 1
    assert "the rotor is unstable at 3819.72 rpm: its forward mode of 3" in warnings[0]
    assert "unstable from" in run(str(path), "--range", "0", "400", "--count", "1")


def test_an_amplification_factor_that_is_not_known_is_explained():
    """The range ends before the amplitude has fallen to 0.707 of the peak."""
    assert "AF nan" not in run("mokhtar2017", *RANGE, "--response", "8")
    assert "AF nan: within the range" in run(
        "mokhtar2017", "--range", "1700 rpm", "1930 rpm", "--response", "8"
    )


def test_a_sag_of_dynamic_coefficients_is_remarked_on_once(tmp_path):
    rig = (PACKAGED / "mokhtar2017.toml").read_text()
    rig = rig.replace("[[rotor.shaft]]", "[rotor]\ngravity = 9.81\n[[rotor.shaft]]", 1)
    film = "[[rotor.bearing]]\nnode = 15\nspeed = [0.0, 500.0]\n"
    rig = rig.replace("[[rotor.bearing]]\nnode = 15\n", film, 1)
    for position, n_remark in (("", 1), ("eccentricity_y = -2e-5\n", 0)):
        (tmp_path / "film.toml").write_text(rig.replace(film, film + position))
        result = CliRunner().invoke(modes, [str(tmp_path / "film.toml"), "--speed", "100", "--speed", "200"])
        assert result.stderr.count("warning: the sag under gravity and loads") == n_remark
