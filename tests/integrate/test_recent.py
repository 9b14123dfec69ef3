"""What calls with the same rig and speed share, and what they must not."""

import threading
from dataclasses import dataclass, replace

import numpy as np
import pytest

import rubhpc.case_arguments
from rubhpc import LumpedStator, Rig, Unbalance, periodic, read_rig, simulate
from rubhpc.recent import KEPT, recent

CASE = {"speed_ratio": 0.9, "clearance": "90 um", "transient": 20, "revolutions": 4, "keep": ("waveform",)}


@dataclass(frozen=True)
class Foreign:
    stiffness: float


@pytest.fixture
def made(monkeypatch):
    """Set-ups that are prepared from now on, by their speeds."""
    found, prepare = [], rubhpc.case_arguments.prepare
    monkeypatch.setattr(
        rubhpc.case_arguments, "prepare", lambda *a, **k: found.append(a[1]) or prepare(*a, **k)
    )
    return found


def test_equal_content_is_made_once_and_other_content_anew():
    made = []
    content = ("test of content", np.array([1.0, 2.0]), 3.0)
    first = recent(lambda: made.append(1) or [1], *content)
    again = recent(lambda: made.append(2) or [2], "test of content", np.array([1.0, 2.0]), 3.0)
    assert again is first
    content[1][0] = 1.5  # an array that is changed in place is other content
    assert recent(lambda: [3], *content) == [3]
    assert made == [1]


def test_the_oldest_is_forgotten():
    made = []
    for n in [*range(KEPT + 1), 0]:
        recent(lambda n=n: made.append(n), "test of age", n)
    assert made == [*range(KEPT + 1), 0]


def test_threads_share_nothing():
    found = [recent(object, "test of threads")]
    other = threading.Thread(target=lambda: found.append(recent(object, "test of threads")))
    other.start()
    other.join()
    assert found[0] is not found[1]


def test_classes_of_others_are_made_each_time():
    """Their functions may be written again while a program runs, in a notebook say."""
    assert recent(object, Foreign(1.0)) is not recent(object, Foreign(1.0))


def test_calls_with_the_same_rig_and_speed_share_their_set_up(made):
    case = CASE | {"speed_ratio": 0.913, "model": "mokhtar2017"}
    first = simulate("mokhtar2017", **case)
    other = simulate(read_rig("mokhtar2017"), **case | {"clearance": "70 um", "friction": 0.1})
    again = simulate("mokhtar2017", **case)
    assert len(made) == 1
    assert not np.array_equal(first.vertical, other.vertical)
    assert np.array_equal(first.vertical, again.vertical)
    simulate("mokhtar2017", **case | {"accuracy": 1e-4})
    simulate("mokhtar2017", **case | {"speed_ratio": 0.914})
    assert len(made) == 3


@pytest.mark.parametrize("friction_law", ["sliding", "coulomb"])
def test_a_ring_keeps_its_bits_whatever_was_called_before(friction_law):
    packaged = read_rig("mokhtar2017").with_geometry("linear")
    ring = replace(packaged, stator=(replace(packaged.stator[0], count=3),))
    case = CASE | {"friction_law": friction_law, "normal": "fixed", "friction": 0.2, "clearance": "60 um"}
    first = simulate(ring, **case)
    simulate(ring, **case | {"clearance": "30 um"})  # it meets other sets of contacts
    assert np.array_equal(simulate(ring, **case).vertical, first.vertical)


def test_matrices_changed_in_place_are_another_rig():
    stiffness = np.eye(2)

    def rig():
        return Rig.from_matrices(
            np.eye(2), 0.08 * np.eye(2), stiffness, degrees=[(1, "v"), (1, "w")],
            stators=[LumpedStator(node=1, rigid=True, radius=1.0)],
            unbalance=[Unbalance(node=1, mass=1.0, radius=1.0)],
        )  # fmt: skip

    case = {"speed": 2.0, "clearance": 10.0, "keep": (), "transient": 5, "model": "mokhtar2017"}
    soft = periodic(rig(), **case).record.contact_free_amplitude
    stiffness *= 2.0
    assert periodic(rig(), **case).record.contact_free_amplitude != soft
