"""The command `modes`: its JSON, its table and its figure."""

import json
import math
import subprocess
import sys

import pytest
from click.testing import CliRunner

from rubhpc.commands.modes import modes
from rubhpc.errors import InputError
from rubhpc.rig.reading import PACKAGED


def run(*arguments):
    result = CliRunner().invoke(modes, list(arguments))
    if result.exception:
        raise result.exception
    return result.output


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


def test_table_stands_still_unless_told():
    lines = run("mokhtar2017", "--count", "3").splitlines()
    assert "Rotor at 0 rpm (0 rad/s)" in lines
    assert "Stator 1" in lines
    first = lines[lines.index("Rotor at 0 rpm (0 rad/s)") + 2].split()
    assert [float(word) for word in first[:3]] == pytest.approx([31.5596, 31.4586, 0.07993], rel=1e-4)
    assert first[3:] == ["lateral", "planar"]


def test_table_says_how_many_modes_it_leaves_out():
    assert "(76 more; --count 88 shows all)" in run("mokhtar2017")
    assert "more;" not in run("mokhtar2017", "--count", "88")


def test_a_wall_has_no_table(tmp_path):
    rig = (PACKAGED / "mokhtar2017.toml").read_text()
    (tmp_path / "walled.toml").write_text(rig + "\n[[stator]]\nnode = 8\nangle = 3.0\nrigid = true\n")
    lines = run(str(tmp_path / "walled.toml"), "--count", "3").splitlines()
    assert lines[-1] == "Stator 2: a wall, which does not move"


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
