"""Rotors and stators that come as matrices: what is refused, and that stores keep them."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closed_form import read_rig, simulate

from rubhpc import InputError, LumpedStator, MatrixStator, Rig, Stator, Unbalance, assemble
from rubhpc.fem.modes import modes
from rubhpc.fem.response import first_lateral_frequency, steady_response, step_limit
from rubhpc.fem.statics import FLOATS, find_rigid_body_mode
from rubhpc.rig.bearing_table import BearingTable
from rubhpc.rig.parts import Torsion
from rubhpc.rig.reading import rig_from_dict, with_keys
from rubhpc.study.cases import CaseGrid, identity_parts
from rubhpc.study.study import Study, make_axis

PLANE = [(1, "v"), (1, "w")]
ONE = np.eye(2)
WALL = LumpedStator(node=1, rigid=True, radius=0.1)


def rotor(M=ONE, C=None, K=ONE, G=None, degrees=PLANE, **given):
    return Rig.from_matrices(M, C, K, G, degrees=degrees, **given)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"M": [[1.0, 0.0]]}, r"mass: has the shape \(1, 2\); give a square one"),
        ({"M": [[1.0, 0.0], [0.0]]}, "mass: .* is not a matrix of real numbers"),
        ({"M": "heavy"}, "mass: .* is not a matrix"),
        ({"M": [[1.0, 0.0], [0.0, math.nan]]}, "mass: the entry in row 2, column 2 is not finite"),
        ({"M": np.eye(3)}, r"mass: of shape \(3, 3\), but there are 2 degrees"),
        ({"M": ONE * 1j}, "mass: .* is not a matrix of real numbers"),
        ({"M": [[1.0, 0.2], [0.0, 1.0]]}, r"mass: is not symmetric \(1\.v with 1\.w: 0\.2 and 0\)"),
        ({"M": [[1.0, 0.0], [0.0, 0.0]]}, r"mass: degree 1\.w has no mass"),
        ({"M": [[1.0, 2.0], [2.0, 1.0]]}, "mass: is not positive definite"),
        ({"K": None}, "K: missing"),
        ({"K": -ONE}, r"stiffness: degree 1\.v has a negative stiffness"),
        ({"K": [[1.0, 2.0], [2.0, 1.0]]}, "stiffness: is not positive semidefinite"),
        ({"G": ONE}, "gyroscopic: is not skew"),
        ({"C": np.eye(3)}, r"damping: of shape \(3, 3\), but there are 2 degrees"),
        ({"degrees": [(1, "v"), (1, "v")]}, r"degrees: 1\.v is duplicated"),
        ({"degrees": [(1, "v"), (1, "x")]}, 'degrees: unknown degree "x"; .* or use a name'),
        ({"degrees": ["v", "w"]}, "degrees: .* is not a list of degrees; write a node and a name"),
        ({"degrees": [(0, "v"), (1, "w")]}, r"degrees: \(0, 'v'\) is not a degree"),
        ({"output_node": 2}, 'output_node: 2 has neither "v" nor "w" in degrees; choose one of 1'),
        ({"unbalance": [Unbalance(node=5, mass=1.0, radius=1.0)]}, r"unbalance\.1\.node: 5 has neither"),
        ({"stators": [replace(WALL, node=3)]}, r"stator\.1\.node: 3 has neither"),
        ({"stators": [replace(WALL, radius=None)]}, r"stator\.1\.radius: missing"),
        ({"displacement_limit": 0.0}, "displacement_limit: 0 m is out of range"),
        (
            {
                "M": [[1.0]],
                "K": [[1.0]],
                "degrees": [(1, "v")],
                "stators": [replace(WALL, angle=math.pi / 2)],
            },
            r"stator\.1\.angle: node 1 cannot move at 1\.5708 rad",
        ),
    ],
)
def test_what_is_no_body_is_refused_in_one_line(change, message):
    with pytest.raises(InputError, match=message) as error:
        rotor(**change)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"mass": 1.0}, "stiffness: missing; give mass and stiffness, or rigid = true"),
        ({"rigid": True, "mass": 1.0}, "mass: conflicts with rigid = true"),
        ({"rigid": True, "damping": 1.0}, "damping: conflicts with rigid = true"),
        ({"mass": 1.0, "stiffness": 0.0}, "stiffness: 0 N/m is out of range"),
        ({"mass": 1.0, "stiffness": 1.0, "lateral_mass": 1.0}, "lateral_mass: has no effect without"),
    ],
)
def test_lumped_stator_has_mass_and_spring_or_is_rigid(given, message):
    with pytest.raises(InputError, match=message):
        LumpedStator(node=1, **given)


def test_stator_of_matrices_names_what_the_rotor_presses():
    with pytest.raises(InputError, match='none is "axial", on which contact acts'):
        MatrixStator(node=1, mass=ONE, stiffness=ONE, degrees=("lateral", "tilt"))
    with pytest.raises(InputError, match=r"mass: of shape \(2, 2\), but there are 1 degrees"):
        MatrixStator(node=1, mass=ONE, stiffness=ONE)


def test_beam_and_its_matrices_are_the_same_stator():
    packaged = read_rig("mokhtar2017")
    beam = assemble(packaged).stators[0]
    names = [f"{node}.{name}" for node, name in beam.body.degrees]
    names[beam.axial], names[beam.lateral] = "axial", "lateral"
    given = MatrixStator(
        node=8,
        radius=0.06,
        mass=beam.body.mass,
        damping=beam.body.damping,
        stiffness=beam.body.stiffness,
        degrees=tuple(names),
    )
    reported = assemble(replace(packaged, stator=(given,))).stators[0]
    assert (reported.axial, reported.lateral) == (beam.axial, beam.lateral)
    for one, other in zip(modes(reported.body), modes(beam.body), strict=True):
        assert one.frequency == pytest.approx(other.frequency, rel=1e-9)


def test_a_store_can_show_the_matrices_again_to_the_last_bit():
    random = np.random.default_rng(1)
    half = random.normal(size=(3, 2, 2))
    skew = half[2] - half[2].T
    stator = MatrixStator(node=1, radius=0.1, mass=ONE, stiffness=ONE / 3, degrees=("axial", "lateral"))
    rig = rotor(ONE / 7, half[0], half[1] @ half[1].T + ONE, skew, stators=[stator, replace(WALL, angle=1.0)])
    table = json.loads(json.dumps(rig.as_dict()))
    again = rig_from_dict(table)
    assert again.as_dict() == rig.as_dict()
    for name in ("mass", "damping", "stiffness", "gyroscopic"):
        assert np.array_equal(getattr(again.rotor, name), getattr(rig.rotor, name))
    assert np.array_equal(again.stator[0].stiffness, stator.stiffness)
    assert again.stator[1].rigid
    table["rotor"]["mass"]["nonzero"] = "AAAA"
    with pytest.raises(InputError, match="cannot be decoded"):
        rig_from_dict(table)


def test_matrices_are_the_identity_of_a_study_not_what_made_them(tmp_path):
    from rubhpc import read_study

    code = "import rubhpc\ndef build():\n    {}\n    return rubhpc.Rig.from_matrices([[{}]], "
    code += (
        "None, [[1e4]], degrees=[(1, 'v')], stators=[rubhpc.LumpedStator(node=1, rigid=True, radius=1.0)])\n"
    )
    (tmp_path / "study.toml").write_text(
        'rig = "made.py:build"\n[grid]\nspeed = 100.0\nclearance = 1e-4\nfriction = 0.1\n'
    )
    parts = []
    for filler, mass in (("pass", 1.0), ("x = 2", 1.0), ("pass", 1.5)):
        (tmp_path / "made.py").write_text(code.format(filler, mass))
        parts.append(identity_parts(read_study(tmp_path / "study.toml", trust_rig=True)))
    assert parts[0] == parts[1] != parts[2]


@pytest.mark.parametrize(
    ("code", "name", "message"),
    [
        ("def build():\n    return 1 / 0\n", "rig.py:build", "line 2: ZeroDivisionError: division by zero"),
        ("def build(:\n", "rig.py:build", "line 1: SyntaxError"),
        (
            "import sys\ndef build():\n    sys.exit()\n",
            "rig.py:build",
            "line 3: SystemExit; fix the rig file",
        ),
        ("raise GeneratorExit('no')\n", "rig.py:build", "line 1: GeneratorExit: no; fix the rig file"),
        ("import nothing_of_this_name\n", "rig.py:build", "line 1: ModuleNotFoundError"),
        ("def build():\n    return 3\n", "rig.py:build", "returned a int; return a rubhpc.Rig"),
        ("build = 3\n", "rig.py:build", "has no function build"),
        ("", "other.py:build", "other.py: no such file"),
        (
            "import rubhpc\ndef build():\n    return rubhpc.Rig.from_matrices([[1]], degrees=[(1, 'v')])\n",
            "rig.py:build",
            "K: missing",
        ),
    ],
)
def test_what_is_wrong_with_a_rig_of_python_is_reported_in_one_line(tmp_path, code, name, message):
    (tmp_path / "rig.py").write_text(code)
    with pytest.raises(InputError, match=message) as error:
        read_rig(name, tmp_path, "study.toml: rig", trust_rig=True)
    assert str(error.value).startswith("study.toml: rig")
    assert "\n" not in str(error.value)


def test_python_runs_for_a_rig_only_where_it_is_trusted(tmp_path):
    (tmp_path / "rig.py").write_text("raise SystemExit('it ran')\n")
    with pytest.raises(InputError, match="is Python code, which runs only if you trust it; add --trust-rig"):
        read_rig("rig.py:build", tmp_path)


def test_rig_of_python_finds_the_modules_beside_it(tmp_path):
    (tmp_path / "beside_the_rig.py").write_text("MASS = 2.0\n")
    (tmp_path / "rig.py").write_text(
        "import rubhpc\nfrom beside_the_rig import MASS\ndef build():\n"
        "    return rubhpc.Rig.from_matrices([[MASS]], None, [[8.0]], degrees=[(1, 'v')])\n"
    )
    rig = read_rig("rig.py:build", tmp_path, trust_rig=True)
    assert first_lateral_frequency(assemble(rig)) == pytest.approx(2.0)


def test_one_stator_and_one_unbalance_need_no_list():
    heavy = Unbalance(node=1, mass=1.0, radius=1.0)
    assert (
        rotor(stators=WALL, unbalance=heavy).as_dict() == rotor(stators=[WALL], unbalance=[heavy]).as_dict()
    )


def test_sparse_matrices_and_numpy_nodes_are_as_good():
    from scipy.sparse import csr_array

    degrees = [(node, name) for node in np.arange(1, 3) for name in np.array(["v", "w"])]
    sparse = rotor(csr_array(np.eye(4)), None, csr_array(3 * np.eye(4)), degrees=degrees)
    plain = rotor(np.eye(4), None, 3 * np.eye(4), degrees=[(1, "v"), (1, "w"), (2, "v"), (2, "w")])
    assert json.dumps(sparse.as_dict()) == json.dumps(plain.as_dict())


def test_keys_of_a_matrix_rig_are_those_that_it_has():
    spring = LumpedStator(node=1, mass=1e-3, stiffness=1e6, radius=0.1, count=3)
    rig = rotor(stators=[spring], unbalance=[Unbalance(node=1, mass=1e-3, radius=0.1)])
    changed = with_keys(
        rig, {"stator.stiffness": 2e6, "stator.3.angle": "100 deg", "rotor.unbalance.mass": "2 g"}
    )
    assert [s.stiffness for s in changed.stator] == [2e6] * 3
    assert changed.stator[2].angle == pytest.approx(math.radians(100))
    assert changed.rotor.unbalance[0].mass == 2e-3
    assert np.array_equal(changed.rotor.mass, rig.rotor.mass)
    for key in ("rotor.shaft.length", "rotor.mass", "stator.length", "rotor.damping.alpha"):
        with pytest.raises(InputError, match=rf"{key}: unknown key"):
            with_keys(rig, {key: 1.0})
    beam = Stator(
        node=1, radius=0.1, length=0.1, width=0.01, height=0.01, youngs_modulus=1e9, density=1e3, angle=1.0
    )
    mixed = replace(rig, stator=(*rig.stator, beam))
    with pytest.raises(InputError, match="unknown key"):
        with_keys(mixed, {"stator.stiffness": 1.0})  # the beam has none
    assert with_keys(mixed, {"stator.4.length": 0.2}).stator[3].length == 0.2


def test_rig_file_takes_lumped_stators_and_matrices(tmp_path):
    (tmp_path / "rig.toml").write_text(
        'name = "oscillator"\n[rotor]\nmass = [[1, 0], [0, 1]]\nstiffness = [[4, 0], [0, 4]]\n'
        'degrees = [[1, "v"], [1, "w"]]\n[[rotor.unbalance]]\nnode = 1\nmass = 1.0\nradius = 0.1\n'
        '[[stator]]\nnode = 1\nradius = 0.1\nmass = "1 g"\nstiffness = "1e6 N/m"\n'
        '[[stator]]\nnode = 1\nangle = "90 deg"\nradius = 0.1\nrigid = true\n'
    )
    rig = read_rig(tmp_path / "rig.toml")
    assert [modes(stator.body) != [] for stator in assemble(rig).stators] == [True, False]
    assert first_lateral_frequency(assemble(rig)) == pytest.approx(2.0)


def test_kinds_of_motion_that_a_body_couples_are_reported_by_their_energy():
    """A sideways mass that turns a wheel by a lever: two modes of both kinds, and their exact roots."""
    lever, m, J, k, t = 0.1, 2.0, 1e-3, 2e4, 90.0
    M, K = np.diag([m, J]), np.array([[k, k * lever], [k * lever, t + k * lever**2]])
    rig = rotor(M, None, K, degrees=[(1, "v"), (1, "thx")])
    found = modes(assemble(rig).rotor)
    a, b, c = m * J, -(m * K[1, 1] + J * k), k * t
    exact = sorted(math.sqrt((-b + s * math.sqrt(b * b - 4 * a * c)) / (2 * a)) for s in (-1, 1))
    assert [2 * math.pi * mode.frequency for mode in found] == pytest.approx(exact, rel=1e-10)
    assert [(mode.kind, mode.whirl) for mode in found] == [("lateral", "none"), ("torsional", "none")]
    assert first_lateral_frequency(assemble(rig)) == pytest.approx(exact[0], rel=1e-10)


def test_unbalance_drives_what_is_coupled_to_the_sideways_motion():
    K = np.array([[4.0, 1.0], [1.0, 3.0]])
    rig = rotor(
        ONE, None, K, degrees=[(1, "v"), (1, "q1")], unbalance=[Unbalance(node=1, mass=1.0, radius=1.0)]
    )
    response = steady_response(assemble(rig), 1.0)
    assert response == pytest.approx(np.linalg.solve(K - ONE, [1.0, 0.0]), rel=1e-12)


def test_whirl_needs_no_tilt():
    rig = rotor(ONE, None, ONE, [[0.0, 0.2], [-0.2, 0.0]])
    assert [mode.whirl for mode in modes(assemble(rig).rotor, 1.0)] == ["backward", "forward"]
    swapped = rotor(ONE, None, ONE, [[0.0, -0.2], [0.2, 0.0]], degrees=[(1, "w"), (1, "v")])
    assert [mode.whirl for mode in modes(assemble(swapped).rotor, 1.0)] == ["backward", "forward"]


def test_free_motion_is_found_where_contact_or_outputs_see_it():
    packaged = read_rig("mokhtar2017")
    assert find_rigid_body_mode(assemble(packaged)) == ""
    free = with_keys(packaged, {"rotor.torsion.free": True})
    assert find_rigid_body_mode(assemble(free)) == "the rotor is free to turn (torsion)"
    loose = with_keys(packaged, {"rotor.bearing.stiffness": 0.0})
    assert find_rigid_body_mode(assemble(loose)) == FLOATS
    unseen = rotor(np.eye(3), None, np.diag([1.0, 1.0, 0.0]), degrees=[*PLANE, (1, "u")], stators=[WALL])
    assert find_rigid_body_mode(assemble(unseen)) == ""
    adrift = MatrixStator(node=1, radius=0.1, mass=[[1.0]], stiffness=[[0.0]])
    assert (
        find_rigid_body_mode(assemble(rotor(stators=[WALL, replace(adrift, angle=1.0)])))
        == "stator 2 is free to move"
    )


def test_a_rotor_that_floats_freely_is_named_and_steps_without_a_limit():
    adrift = rotor(K=0.0 * ONE, stators=[WALL])
    case = {"speed": 1.0, "clearance": 1e-3, "friction": 0.0, "transient": 0, "revolutions": 1}
    with pytest.raises(
        InputError, match=r"the rotor floats freely: .*; add a bearing with a stiffness, or set"
    ):
        simulate(adrift, **case)
    assert step_limit(assemble(adrift)) == math.inf
    assert not simulate(adrift, method="central-difference", step=1e-2, **case).vertical.any()


def test_rotor_free_in_torsion_is_refused_with_the_fix_and_a_soft_drive_twists_alike():
    """Four revolutions: 0.01 N m/rad holds next to nothing of what friction turns back by then."""
    packaged = read_rig("mokhtar2017")
    free = with_keys(packaged, {"rotor.torsion.free": True})
    given = {"speed": 150.0, "clearance": 1e-4, "friction": 0.2}
    axes = tuple(make_axis(name, value, free) for name, value in given.items())
    with pytest.raises(InputError, match=r"free to turn \(torsion\); give it a stiffness, however soft, or"):
        CaseGrid(Study(title="free", rig=free, axes=axes, output=Path("none.zarr")))
    case = given | {"transient": 0, "revolutions": 4}
    drifts = simulate(free, **case, method="central-difference", step="1 us")
    soft = simulate(with_keys(packaged, {"rotor.torsion.stiffness": 0.01}), **case)
    assert np.ptp(drifts.torsion) > 5e-3
    assert soft.vertical == pytest.approx(drifts.vertical, abs=1e-4 * np.ptp(drifts.vertical))
    assert soft.torsion == pytest.approx(drifts.torsion, abs=5e-3 * np.ptp(drifts.torsion))


def ross(**changed):
    """What `Rig.from_ross` reads of a rotor: two nodes, every degree on a spring of its own."""
    from types import SimpleNamespace

    K = np.diag(np.arange(1.0, 13.0))
    given = {
        "number_dof": 6,
        "nodes": [0, 1],
        "L": 0.5,
        "bearing_elements": [],
        "M": lambda _: np.eye(12),
        "K": lambda _: K,
    }
    given |= {"C": lambda _: np.zeros((12, 12)), "G": lambda: np.zeros((12, 12))}
    return SimpleNamespace(**(given | changed))


def test_degrees_of_ross_are_turned_about_the_shaft():
    """x, y, z, alpha, beta, theta become w, v, u, thz, thy, thx: up stays up."""
    rig = Rig.from_ross(ross(), stators=[replace(WALL, node=2)])
    stiffness = dict(zip(rig.rotor.degrees, np.diag(rig.rotor.stiffness), strict=True))
    expected = {
        (2, "w"): 7.0,
        (2, "v"): 8.0,
        (2, "u"): 9.0,
        (2, "thz"): 10.0,
        (2, "thy"): 11.0,
        (2, "thx"): 12.0,
    }
    assert {degree: stiffness[degree] for degree in expected} == expected
    assert (1, "thx") not in stiffness  # held by the drive
    assert stiffness[(1, "u")] == 3.0  # held by its spring
    assert rig.rotor.displacement_limit == pytest.approx(0.05)
    sprung = Rig.from_ross(ross(), torsion=Torsion(node=2, stiffness=100.0))
    assert np.diag(sprung.rotor.stiffness)[sprung.rotor.degrees.index((2, "thx"))] == 112.0


def test_coupling_of_ross_keeps_its_sense():
    """A force along x that follows from y is, seen here, one along -w that follows from v."""
    K = np.diag(np.arange(1.0, 13.0))
    K[0, 1] = 0.5
    rotor_ = Rig.from_ross(ross(K=lambda _: K)).rotor
    assert rotor_.stiffness[rotor_.degrees.index((1, "w")), rotor_.degrees.index((1, "v"))] == -0.5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"number_dof": 4}, "the rotor has 4 degrees per node, not 6"),
        ({"K": None}, "is not a ross.Rotor; pass one"),
    ],
)
def test_what_is_no_rotor_of_ross_is_refused(change, message):
    with pytest.raises(InputError, match=message):
        Rig.from_ross(ross(**change))


def ross_bearing(**changed):
    """A bearing of ROSS 3 at its node 1, twice as stiff at 100 rad/s as at rest."""
    from types import SimpleNamespace

    given = {"n": 1, "n_link": None, "speed": [0.0, 100.0], "frequency": None, "interpolation": "pchip"}
    given |= {"kxx": [1e6, 2e6], "kyy": [3e6, 6e6], "kxy": 2e5, "kyx": [-1e5, -2e5], "cxx": 10.0, "cyy": 20.0}
    found = SimpleNamespace(**(given | changed))
    found.K = lambda w: np.array([[1e6, 2e5, 0], [-1e5, 3e6, 0], [0, 0, 0]]) * (1 + w / 100.0)
    found.C = lambda w: np.diag([10.0, 20.0, 0.0])
    return found


def ross_on_bearing(**changed):
    bearing = ross_bearing(**changed)

    def matrix(own, whole):
        def at(w):
            entries = np.diag(np.full(12, whole))
            entries[6:9, 6:9] += own(w)
            return entries

        return at

    K, C = matrix(bearing.K, 1e3), matrix(bearing.C, 0.0)
    return ross(bearing_elements=[bearing], K=K, C=C)


def test_bearings_of_ross_keep_their_tables():
    """Turned: (v, w) of the shaft are (y, -x) of ROSS."""
    rig = Rig.from_ross(ross_on_bearing())
    assert rig.rotor.bearing == (
        BearingTable(
            node=2,
            speed=[0.0, 100.0],
            kyy=[3e6, 6e6],
            kzz=[1e6, 2e6],
            kyz=[1e5, 2e5],
            kzy=[-2e5],
            cyy=[20.0],
            czz=[10.0],
            cyz=[0.0],
            czy=[0.0],
        ),
    )
    rows = [rig.rotor.degrees.index((2, name)) for name in ("v", "w")]
    assert rig.rotor.stiffness[np.ix_(rows, rows)] == pytest.approx(np.diag([1e3, 1e3]))
    assert not rig.rotor.damping.any()
    assert rig_from_dict(json.loads(json.dumps(rig.as_dict()))).as_dict() == rig.as_dict()


def test_bearings_of_ross_are_frozen_where_a_speed_is_given():
    frozen = Rig.from_ross(ross_on_bearing(), speed="50 rad/s").rotor
    assert frozen.bearing == ()
    row = frozen.degrees.index((2, "v"))
    assert frozen.stiffness[row, row] == pytest.approx(1e3 + 4.5e6)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"speed": None, "frequency": [0.0, 100.0]}, "depends on the whirl frequency"),
        ({"mxx": [1.0, 2.0]}, "mxx depends on the speed"),
    ],
)
def test_bearings_of_ross_that_no_table_holds_ask_for_a_speed(change, message):
    with pytest.raises(InputError, match=message):
        Rig.from_ross(ross_on_bearing(**change))
    Rig.from_ross(ross_on_bearing(**change), speed=10.0)


def test_pedestals_of_ross_have_three_degrees_and_nodes_of_their_own():
    """At its rows 12 to 14: x, y, z of a mass, to which the bearing at its node 1 is linked."""
    bearing = ross_bearing(n_link=2)
    K = bearing.K
    bearing.K, bearing.C = (lambda w: np.kron([[1, -1], [-1, 1]], K(w))), (lambda w: np.zeros((6, 6)))

    def stiffness(w):
        entries = np.diag(np.full(15, 1e3))
        rows = [6, 7, 8, 12, 13, 14]
        entries[np.ix_(rows, rows)] += bearing.K(w)
        return entries

    given = {"M": lambda _: np.eye(15), "K": stiffness, "C": lambda _: np.zeros((15, 15))}
    rotor_ = Rig.from_ross(ross(bearing_elements=[bearing], G=lambda: np.zeros((15, 15)), **given)).rotor
    assert [name for node, name in rotor_.degrees if node == 3] == ["u", "v", "w"]
    assert (rotor_.bearing[0].node, rotor_.bearing[0].link) == (2, 3)
    assert rotor_.stiffness == pytest.approx(1e3 * np.eye(len(rotor_.degrees)))
    body = assemble(Rig(name="linked", rotor=rotor_)).rotor.at(50.0)
    near, far = ([body.index(node, name) for name in ("v", "w")] for node in (2, 3))
    assert body.stiffness[np.ix_(near, far)] == pytest.approx(np.array([[-4.5e6, -1.5e5], [2e5, -1.5e6]]))


def test_a_multi_rotor_of_ross_is_refused():
    geared = type("MultiRotor", (type(ross()),), {})(**vars(ross()))
    with pytest.raises(InputError, match="the shafts of a MultiRotor turn at different speeds"):
        Rig.from_ross(geared)


def test_a_torsional_node_that_ross_does_not_have_is_refused():
    with pytest.raises(InputError, match="the nodes run from 1 to 2"):
        Rig.from_ross(ross(), torsion=Torsion(fixed_node=3))
