"""Chains of a sweep: their order, the ids of their cases, and what growth keeps of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

from rubhpc.errors import InputError
from rubhpc.rig.reading import read_rig
from rubhpc.study.axes import BOTH, DIRECTION, DOWN, FROM_REST, UP, Axis
from rubhpc.study.axis_reading import make_axis
from rubhpc.study.continuation import CaseIds, Continuation, continuation_of

RIG = read_rig("mokhtar2017")
BOTH_WAYS = Continuation(axis=0, direction=2)


class Named(NamedTuple):
    name: str
    sweep: str


@pytest.mark.parametrize(
    ("name", "given", "values", "sweep"),
    [
        ("friction", {"values": [0.3, 0.1, 0.2], "sweep": "up"}, (0.1, 0.2, 0.3), UP),
        ("friction", {"values": 0.3, "sweep": "down"}, (0.3,), DOWN),
        ("speed_ratio", {"start": 2, "stop": 1, "step": -0.5, "sweep": "both"}, (1.0, 1.5, 2.0), BOTH),
        ("friction", {"values": [0.3, 0.1], "sweep": "from_rest"}, (0.3, 0.1), FROM_REST),
        ("friction", {"values": [0.3, 0.1]}, (0.3, 0.1), FROM_REST),
        ("clearance", {"start": "1 mm", "stop": "2 mm", "num": 2, "sweep": "up"}, (1e-3, 2e-3), UP),
        ("stator.youngs_modulus", {"values": ["3 GPa", "1 GPa"], "sweep": "down"}, (1e9, 3e9), DOWN),
    ],
)
def test_a_swept_axis_rises_whatever_the_order_it_is_written_in(name, given, values, sweep):
    axis = make_axis(name, given, RIG)
    assert (axis.values, axis.sweep) == (values, sweep)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"values": [0.1], "sweep": "upp"}, 'sweep: "upp" is unknown; did you mean up'),
        ({"values": [0.1], "sweep": "sideways"}, "choose one of from_rest, up, down, both"),
        ({"values": [0.1], "sweep": 3}, "sweep: 3 is unknown; choose one of from_rest, up, down, both"),
        ({"values": [0.1], "swep": "up"}, 'unknown key "swep" in a range; did you mean sweep'),
        ({"values": [0.1], "start": 1.0}, "start conflicts with values; give either a range or values"),
        ({"values": {"start": 0.1, "stop": 0.2, "num": 2}}, r"write values = \[...\]"),
        ({"sweep": "up"}, "a range needs start"),
        ({"values": [], "sweep": "up"}, "empty; give at least one value"),
        ({"values": [0.1, 0.1], "sweep": "up"}, "0.1 is duplicated"),
    ],
)
def test_what_cannot_be_swept_is_refused_in_a_line(given, message):
    with pytest.raises(InputError, match=message) as caught:
        make_axis("friction", given, RIG, "a.toml")
    assert str(caught.value).startswith("a.toml: [grid] friction: ")
    assert "\n" not in str(caught.value)


def test_an_axis_made_by_hand_is_checked_too():
    with pytest.raises(InputError, match='sweep: "dwon" is unknown; did you mean down'):
        Axis(name="friction", dimension="friction", unit="1", values=(0.1,), long_name="", sweep="dwon")


def test_a_grid_has_a_chain_only_where_an_axis_is_swept():
    assert continuation_of([Named("a", FROM_REST), Named("b", FROM_REST)]) is None
    assert continuation_of([Named("a", FROM_REST), Named("b", DOWN)]) == Continuation(axis=1, is_down=True)
    assert (
        continuation_of([Named("a", BOTH), Named("b", FROM_REST), Named(DIRECTION, FROM_REST)]) == BOTH_WAYS
    )


def test_each_case_goes_on_from_its_neighbour_in_its_own_direction():
    assert BOTH_WAYS.predecessor((0, 5, 0), 3) is None
    assert BOTH_WAYS.predecessor((2, 5, 0), 3) == (1, 5, 0)
    assert BOTH_WAYS.predecessor((0, 5, 1), 3) == (1, 5, 1)
    assert BOTH_WAYS.predecessor((2, 5, 1), 3) is None
    down = Continuation(axis=1, is_down=True)
    assert down.predecessor((4, 0), 2) == (4, 1)
    assert sorted([(0, 0), (0, 1)], key=down.position) == [(0, 1), (0, 0)]


def test_marks_spread_to_all_behind_them_and_to_no_other_chain():
    marked = np.zeros((4, 2, 2), int)
    marked[1, 0] = 1
    marked[2, 0, 0] = 5
    spread = BOTH_WAYS.running_maximum(marked)
    assert spread[:, 0, 0].tolist() == [0, 1, 5, 5]
    assert spread[:, 0, 1].tolist() == [1, 1, 0, 0]
    assert not spread[:, 1].any()
    assert Continuation(axis=0, is_down=True).running_maximum(marked[:, 0, 0]).tolist() == [5, 5, 5, 0]


@pytest.mark.parametrize(
    "continuation",
    [Continuation(axis=0), Continuation(axis=0, is_down=True), Continuation(axis=0, direction=1)],
)
@pytest.mark.parametrize("after", [(1.0, 1.5, 2.0, 3.0), (1.0, 2.0, 3.0, 4.0), (0.5, 1.0, 2.0, 3.0)])
def test_ids_and_growth_agree_on_which_cases_are_the_same(continuation, after):
    """A case keeps its id where the same values come before it, and where growth keeps it."""
    before = (1.0, 2.0, 3.0)
    ways = (0.0, 1.0) if continuation.direction is not None else (float(continuation.is_down),)
    mine, yours = (CaseIds("study", [values, (0.0, 1.0)], continuation) for values in (before, after))
    kept = continuation.unchanged(before, after)
    for i, value in enumerate(after):
        for way in ways:
            point = (value, way)
            is_same = value in before and mine(point) == yours(point)
            assert kept[i, int(way) if len(ways) > 1 else 0] == is_same
            predecessors = [v for v in after if (v > value if way else v < value)]
            assert is_same == (
                value in before and predecessors == [v for v in before if (v > value if way else v < value)]
            )


def test_without_a_chain_an_id_shows_of_the_case_alone():
    assert CaseIds("s", [(1.0, 2.0)], None)([2.0]) == CaseIds("s", [(2.0,)], None)([2.0])
    assert CaseIds("s", [(1.0, 2.0)], Continuation(axis=0))([2.0]) != CaseIds(
        "s", [(2.0,)], Continuation(axis=0)
    )([2.0])
