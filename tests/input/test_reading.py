"""Numbers with units, and TOML files: what is taken, what is refused, and in which words."""

from __future__ import annotations

import math
import subprocess
import sys

import pint
import pytest

from rubhpc.errors import InputError
from rubhpc.input.quantity import _EVERYDAY, _factor, parse_quantity
from rubhpc.input.reading import build, read_toml
from rubhpc.rig.parts import Damping


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        (3, "m", 3.0),
        ("100 um", "m", 1e-4),
        ("100 µm", "m", 1e-4),  # the micro sign
        ("100 μm", "m", 1e-4),  # the Greek letter
        ("3 GPa", "Pa", 3e9),
        ("8 g", "kg", 8e-3),
        ("1 g/cm^3", "kg/m^3", 1000.0),
        ("2 kN/mm", "N/m", 2e6),
        ("2 N/(mm)", "N/m", 2e3),
        ("31.7 1/s", "1/s", 31.7),
        ("2 lbf/in", "N/m", 2 * 0.45359237 * 9.80665 / 0.0254),
        ("-90 deg", "rad", -math.pi / 2),
        ("90°", "rad", math.pi / 2),
        ("30 %", "", 0.3),
        ("0.3", "", 0.3),
        ("2 h", "s", 7200.0),
        ("1.5e-3 m", "m", 1.5e-3),
    ],
)
def test_a_quantity_comes_in_si_units(value, unit, expected):
    assert parse_quantity(value, unit, "key") == pytest.approx(expected, rel=1e-15)


@pytest.mark.parametrize(
    "turns_a_minute", ["1800 rpm", "30 turn/s", "30 rps", "30 rev/s", "1800 turn/min", "10800 deg/s"]
)
def test_a_turn_is_two_pi_however_it_is_written(turns_a_minute):
    assert parse_quantity(turns_a_minute, "rad/s", "speed") == pytest.approx(60 * math.pi, rel=1e-15)
    assert parse_quantity(turns_a_minute, "Hz", "frequency") == pytest.approx(30.0, rel=1e-15)


@pytest.mark.parametrize(
    ("given", "turns", "angle"),
    [  # to pint each of them is rad/s
        ("3000 1/min", "3000 rpm", "50 rad/s"),
        ("3000 min^-1", "3000 rpm", "50 rad/s"),
        ("50 1/s", "3000 rpm", "50 rad/s"),
        ("50 Hz", "3000 rpm", "50 rad/s"),
        ("0.05 kHz", "3000 rpm", "50 rad/s"),
        ("50 counts/s", "3000 rpm", "50 rad/s"),
        ("1e3 %/s", "600 rpm", "10 rad/s"),
    ],
)
@pytest.mark.parametrize("unit", ["rad/s", "rad * s**-1"])  # of a rig or study, of a store
def test_a_rotation_speed_says_whether_it_counts_turns(given, turns, angle, unit):
    fix = f'write "{turns}" if it counts turns, "{angle}" if it counts radians'
    with pytest.raises(InputError) as refused:
        parse_quantity(given, unit, "speed")
    assert str(refused.value) == f'speed: "{given}" is ambiguous for a rotation speed; {fix}'


@pytest.mark.parametrize("text", ["30 um", "70 um", "0.3 mm", "110 um", "56 um"])
def test_text_and_the_si_number_are_one_value(text):
    number, unit = text.split()
    assert parse_quantity(text, "m", "key") == float(f"{number}e{-6 if unit == 'um' else -3}")


def test_minus_zero_is_zero():
    assert math.copysign(1.0, parse_quantity(-0.0, "m", "key")) == 1.0
    assert math.copysign(1.0, parse_quantity("-0 m", "m", "key")) == 1.0


@pytest.mark.parametrize(
    ("unit", "given"), [(unit, given) for unit in _EVERYDAY for given in _EVERYDAY[unit]]
)
def test_the_everyday_units_are_those_of_pint(unit, given):
    assert _factor(given, unit, "key", given) == pytest.approx(_EVERYDAY[unit][given], rel=1e-15)
    if unit not in ("rad/s", "Hz"):  # where a turn counts 1
        assert pint.Quantity(1.0, given).m_as(unit) == pytest.approx(_EVERYDAY[unit][given], rel=1e-15)


@pytest.mark.parametrize(
    "value",
    [
        "1 kg", "0.5", "nan m", "inf m", "1e999 m", "3,5 mm", "1 m + 1 m", "m", "", "1 m/", "1 3 m", "1 (m",
        "1 parsnip", "1 __class__", "__import__('os').getcwd()", "9**9**9 m", "1 m**9**9", "1 m**99",
        "20 degC", "2 dB", "1 " + "m" * 190 + "!", "1 " + "m " * 99, "1" * 300, "1\n\n", True, None, [1], {},
        math.nan, math.inf, 10**400,
    ],
)  # fmt: skip
def test_what_is_no_length_is_refused_in_one_line(value):
    with pytest.raises(InputError, match=r"\Aa\.toml: \[grid\] gap: .+; .+\Z") as refused:
        parse_quantity(value, "m", "a.toml: [grid] gap")
    assert str(refused.value).isprintable()


def test_pint_stays_away_until_it_is_needed():
    code = """
import sys
from rubhpc.rig.reading import read_rig
from rubhpc.input.quantity import parse_quantity
read_rig("mokhtar2017")
assert "pint" not in sys.modules
parse_quantity("1 inch", "m", "")
assert "pint" in sys.modules
"""
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("ratios", "expected"),
    [
        (
            "31.56 = 0.09, 128.05 = 0.022",
            ((31.56, 0.09), (128.05, 0.022)),
        ),  # TOML reads 31.56 as the table 31
        ("31.56 = 0.09, 31.7 = 0.1", ((31.56, 0.09), (31.7, 0.1))),
        ('"31.56" = 0.09, "128.05 Hz" = "2.2 %"', ((31.56, 0.09), (128.05, 0.022))),
        ('100 = 0.05, "2 kHz" = 0.1', ((100.0, 0.05), (2000.0, 0.1))),
    ],
)
def test_damping_ratios_may_be_spelled_as_bare_numbers(tmp_path, ratios, expected):
    file = tmp_path / "a.toml"
    file.write_text(f"ratios = {{ {ratios} }}")
    assert build(Damping, read_toml(file), "a.toml", "rotor.damping").ratios == expected


@pytest.mark.parametrize("content", [b"\xef\xbb\xbfa = 1\r\nb = 2\r\n", b"a = 1\nb = 2"])
def test_windows_files_are_taken(tmp_path, content):
    file = tmp_path / "a.toml"
    file.write_bytes(content)
    assert read_toml(file) == {"a": 1, "b": 2}


def test_what_is_no_file_is_refused(tmp_path):
    for path in (tmp_path, tmp_path / "none.toml", tmp_path / "a.toml" / "b", tmp_path / ("x" * 5000)):
        (tmp_path / "a.toml").touch()
        with pytest.raises(InputError, match=r"\A.*(no such file|not a file|cannot be read).*; .+\Z"):
            read_toml(path)


@pytest.mark.parametrize("text", ["a{} = 1", "[a{}]", "x = {{ a{} = 1 }}", '"a"{} = 1'])
def test_a_key_of_many_parts_is_refused_before_it_is_parsed(tmp_path, text):
    part = '."a"' if '"' in text else " . a"
    (tmp_path / "long.toml").write_text("# a comment\n" + text.format(part * 20_000))
    with pytest.raises(InputError, match="line 2: a key of over 32 parts"):
        read_toml(tmp_path / "long.toml")


def test_texts_and_comments_may_hold_dots(tmp_path):
    dots = "a.b" * 40
    (tmp_path / "dots.toml").write_text(f'title = "{dots}" # {dots}')
    assert read_toml(tmp_path / "dots.toml") == {"title": dots}
