"""The word that was meant, of those that are known."""

import pytest

from rubhpc.input.messages import nearest

AXES = ("speed_ratio", "speed", "clearance", "friction", "stator.youngs_modulus", "stator.angle")
KEYS = ("from", "select", "vertical", "vertical_velocity", "horizontal_velocity", "impulse")


@pytest.mark.parametrize(
    ("word", "known", "meant"),
    [
        ("velocty", KEYS, "vertical_velocity"),  # a part of a name, mistyped
        ("velocity", KEYS, "vertical_velocity"),
        ("impuls", KEYS, "impulse"),
        ("stator.young", AXES, "stator.youngs_modulus"),  # the beginning of a name
        ("modulus", AXES, "stator.youngs_modulus"),
        ("speed_rato", AXES, "speed_ratio"),
        ("spd", AXES, "speed"),
        ("Friction", AXES, "friction"),
    ],
)
def test_the_word_that_was_meant_is_named(word, known, meant):
    assert nearest(word, known) == f"did you mean {meant}?"


@pytest.mark.parametrize("word", ["", "zzz", "x", "temperature"])
def test_a_word_like_none_gets_the_list(word):
    assert nearest(word, KEYS) == f"choose one of {', '.join(KEYS)}"
