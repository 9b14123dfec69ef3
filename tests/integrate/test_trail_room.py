"""A trail's room goes from case to case, and changes nothing of what they measure."""

from closed_form import read_rig, simulate

from rubhpc.integrate import case
from rubhpc.rig.reading import with_keys

STIFF = with_keys(read_rig("mokhtar2017"), {"stator.youngs_modulus": 3e10})
CASE = {"friction": 0.3, "transient": 4, "revolutions": 32, "samples_per_revolution": 64, "keep": ()}


def test_the_next_case_takes_the_room_of_the_last_one_and_measures_the_same():
    case._spare.clear()
    chaotic = {"speed_ratio": 3.5, "clearance": 74e-6}
    first = simulate(STIFF, **chaotic, **CASE)
    (room,) = case._spare
    simulate(STIFF, speed_ratio=1.5, clearance=60e-6, **CASE)  # leaves other events in it
    assert [id(trail) for trail in case._spare] == [id(room)]
    again = simulate(STIFF, **chaotic, **CASE)
    assert again.lyapunov_exponent == first.lyapunov_exponent
    assert again.peak_contact_force[0] == first.peak_contact_force[0]
