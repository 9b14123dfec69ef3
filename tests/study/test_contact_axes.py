"""Keys of [contact] as axes of a grid: which combinations can be, what each case takes, ids, the store."""

import pytest
import xarray as xr
from closed_form import LAWS, Contact

from postproc.cases.maps import validity
from postproc.store.rig_of_case import rig_of
from postproc.store.select import select
from rubhpc.errors import InputError
from rubhpc.running.driver import run
from rubhpc.running.recompute import reproduce
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

BASE = """
rig = "mokhtar2017"
[grid]
speed_ratio = 0.75
clearance = "84 um"
friction = 0.3
"""
QUICK = """
[record]
transient = 1
revolutions = 2
samples_per_revolution = 32
keep = ["section"]
"""


def study_of(tmp_path, axes="", contact="", rest=""):
    path = tmp_path / "laws.toml"
    closed = {key: word for key, word in LAWS.items() if key not in f"{axes}{contact}"}
    laws = "\n".join([contact, *(f'{key} = "{word}"' for key, word in closed.items())])
    path.write_text(f'{BASE}{axes}\n[override]\n"stator.geometry" = "linear"\n[contact]\n{laws}\n{rest}')
    return read_study(path, tmp_path / "laws.zarr")


def test_each_case_takes_its_own_contact(tmp_path):
    axes = '"contact.law" = ["penalty", "lagrange"]\n"contact.friction_law" = ["sliding", "coulomb"]'
    stated = 'stiffness = "1e7 N/m"\ndamping = 10.0\nrestitution = 0.5\nstatic_friction_ratio = 1.2'
    grid = CaseGrid(study_of(tmp_path, axes, stated))
    assert grid.dims[-2:] == ("contact_law", "contact_friction_law")
    found = [case.contact for block in grid.blocks() for case in grid.cases(block)]
    assert len(found) == len({case.id for block in grid.blocks() for case in grid.cases(block)}) == 4
    spring, coulomb = {"stiffness": 1e7, "damping": 10.0}, {"friction_law": "coulomb"}
    assert set(found) == {
        Contact(law="penalty", **spring),
        Contact(law="penalty", static_friction_ratio=1.2, **spring, **coulomb),
        Contact(restitution=0.5),
        Contact(restitution=0.5, static_friction_ratio=1.2, **coulomb),
    }


def test_quantities_are_axes_in_si_units(tmp_path):
    axes = '"contact.stiffness" = ["1 kN/mm", 1e7]\n"contact.damping" = { start = 0, stop = 20, num = 3 }'
    study = study_of(tmp_path, axes, 'law = "penalty"')
    assert study.axis("contact.stiffness").values == (1e6, 1e7)
    assert study.axis("contact.damping").unit == "N s m-1"
    assert CaseGrid(study).case((0, 0, 0, 1, 2)).contact == Contact(
        law="penalty", stiffness=1e7, damping=20.0
    )


@pytest.mark.parametrize(
    ("axes", "contact", "message"),
    [
        (
            'contact.law = ["lagrange", "penalty"]',
            "",
            r"contact.law = penalty: \[contact\] stiffness: missing",
        ),
        (
            'contact.law = ["lagrange", "spring"]',
            "",
            r'contact.law: "spring" is not available; choose one of "lag',
        ),
        ("contact.law = [1]", "", "contact.law: 1 is not text"),
        ('contact.law = ["lagrange", "lagrange"]', "", "contact.law: lagrange is duplicated"),
        ("contact.law = { start = 0, stop = 1, num = 2 }", "", "a range of words; write a list"),
        ('contact.laww = ["lagrange"]', "", "unknown axis; did you mean contact.law?"),
        ("contact.stiffness = [1e7]", "", "contact.stiffness = 1e.07: .* a multiplier has none"),
        ("contact.restitution = [0.5, 1.5]", "", "restitution = 1.5: .* at most 1"),
        ("contact.restitution = [-0.5]", "", r"contact.restitution: -0.5 is out of range"),
        (
            'contact.law = ["lagrange", "penalty"]\ncontact.stiffness = [1e7, 1e8]',
            "",
            "contact.law = lagrange, contact.stiffness = 1e.07: .* a multiplier has none",
        ),
        (
            'contact.normal = ["fixed", "updated"]',
            "stiffness = 1e7",
            r'stiffness: no case has law = "penalty"',
        ),
        ('contact.law = ["lagrange"]', 'law = "lagrange"', "law: is also an axis of the grid"),
        ('contact.normal = { values = ["fixed", "updated"], sweep = "up" }', "", "words have no order"),
    ],
)
def test_what_cannot_be_is_refused_when_the_study_is_read(tmp_path, axes, contact, message):
    with pytest.raises(InputError, match=message) as refused:
        study_of(tmp_path, axes, contact)
    assert "\n" not in str(refused.value)
    assert "laws.toml" in str(refused.value)


def test_order_on_the_axis_changes_no_id(tmp_path):
    one, other = (
        CaseGrid(study_of(tmp_path, f'contact.normal = ["{first}", "{second}"]'))
        for first, second in (("fixed", "updated"), ("updated", "fixed"))
    )
    assert one.identity == other.identity
    assert one.case((0, 0, 0, 0)).id == other.case((0, 0, 0, 1)).id
    assert one.case((0, 0, 0, 0)).contact.normal == "fixed"


def test_a_study_of_laws_runs_is_selected_by_name_and_recomputed(tmp_path):
    """Each case is, bit for bit, that of the study that states its law for all cases."""
    axes = 'contact.law = ["lagrange", "penalty"]'
    study = study_of(tmp_path, axes, "stiffness = 1e7", QUICK)
    assert run(study, quiet=True).counts[1] == 2
    assert not verify(study.output)
    with xr.open_zarr(study.output) as store:
        assert store.contact_law.attrs["flag_meanings"].split()[:2] == ["lagrange", "penalty"]
        assert store.attrs["study"]["grid"]["contact.law"]["values"] == ["lagrange", "penalty"]
        for i, (law, stated) in enumerate(
            (("lagrange", ""), ("penalty", 'law = "penalty"\nstiffness = 1e7'))
        ):
            alone = tmp_path / law
            alone.mkdir()
            single = study_of(alone, "", stated, QUICK)
            run(single, quiet=True)
            chosen = select(store, {"contact_law": law})
            assert rig_of(chosen) == rig_of(store.isel(contact_law=i))
            with xr.open_zarr(single.output) as expected:
                for name in ("section_vertical", "peak_contact_force", "steps"):
                    assert (chosen[name].values == expected[name].values).all(), name
        assert validity(store).dims == store.status.dims
    assert "contact.law=penalty" in Store(study.output).manifest.name_case(1)
    reported = reproduce(study, Store(study.output).manifest.case_id(1))
    assert "bit for bit" in reported.verdict
