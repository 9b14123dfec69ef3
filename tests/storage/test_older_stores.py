"""Stores that lack keys of today's studies: these mean what they meant then, and a run asks for them."""

import json
from dataclasses import replace
from zlib import crc32

import pytest
from running import write_study

import rubhpc
from postproc.catalogue import figures
from postproc.report.budget import write_report
from postproc.store.export import write_hdf5
from postproc.store.rig_of_case import rig_of
from rubhpc.errors import StoreError
from rubhpc.storage.manifest import Manifest
from rubhpc.storage.resume import grid_for
from rubhpc.storage.store import Store
from rubhpc.storage.verify import verify
from rubhpc.study.cases import CaseGrid
from rubhpc.study.study import read_study

SMALL = {"speed_ratio": [0.9], "friction": [0.1, 0.3], "keep": '["section"]'}
KEYS = "normal", "friction_law"


@pytest.fixture
def older(tmp_path):
    """A finished store without the keys, whose cases are of the fixed normal, sliding and linear stators."""
    study = read_study(write_study(tmp_path, **SMALL))
    rubhpc.run(study, quiet=True)
    manifest = Manifest.read(study.output)
    path = study.output / "zarr.json"
    group = json.loads(path.read_text())
    for contact in (manifest.parts["contact"], group["attributes"]["study"]["contact"]):
        for key in KEYS:
            del contact[key]
    del group["attributes"]["study"]["contact"]["model"]
    assert "geometry" not in manifest.parts["rig"]["stator"][0]
    assert "geometry" not in group["attributes"]["rig"]["stator"][0]
    text = json.dumps(group).encode()
    path.write_bytes(text)
    replace(manifest, files=manifest.files | {"zarr.json": crc32(text)}).write(study.output)
    return study.output


def test_it_is_read_as_ever(older, tmp_path):
    assert not verify(older)
    cases = rubhpc.open(older)
    drawing = figures()["map"].of(cases, x="clearance_ratio", y="friction")
    assert drawing.verdict == ("model mokhtar2017",)
    drawing.save(tmp_path / "map.png")
    assert not rig_of(cases.isel(friction=0, clearance_ratio=0, speed_ratio=0)).stator[0].is_bent
    write_report(cases, tmp_path / "page.html", 20e6)
    assert "<dt>Model</dt><dd>mokhtar2017</dd>" in (tmp_path / "page.html").read_text()
    write_hdf5(cases, tmp_path / "cases.h5")


def test_a_run_on_it_says_what_to_add_and_goes_on_with_it(older, tmp_path):
    study = read_study(write_study(tmp_path, contact="", **SMALL))
    assert study.model == "updated normal, Coulomb friction, second-order stators"
    with pytest.raises(
        StoreError, match=r'add \[contact\] model = "mokhtar2017" to the study, or'
    ) as refused:
        grid_for(study)
    assert "\n" not in str(refused.value)
    more = SMALL | {"friction": [0.1, 0.3, 0.5]}
    done = rubhpc.run(read_study(write_study(tmp_path, **more)), quiet=True)
    assert (done.computed, done.counts[1]) == (2, 6)


@pytest.mark.parametrize(
    ("contact", "rest", "message"),
    [
        ('friction_law = "sliding"', "", 'add [contact] model = "mokhtar2017" to the study, or'),
        ('normal = "fixed"\nfriction_law = "sliding"', "", 'add [contact] model = "mokhtar2017" to'),
        (
            'friction_law = "stribeck"\nstribeck_speed = 1.0\nstatic_friction_ratio = 2',
            "",
            "; choose another",
        ),
        ("", '[override]\n"stator.length" = "41 mm"', "; choose another --output"),
    ],
)
def test_what_a_study_says_itself_is_not_added(older, tmp_path, contact, rest, message):
    with pytest.raises(StoreError) as refused:
        grid_for(read_study(write_study(tmp_path, contact=contact, run=rest, **SMALL)))
    assert message in str(refused.value)


def test_keys_are_named_one_by_one_where_no_model_has_them(tmp_path):
    given = SMALL | {"contact": 'normal = "fixed"\nfriction_law = "coulomb"'}
    study = read_study(write_study(tmp_path, **given))
    Store.create(study.output, CaseGrid(study))
    with pytest.raises(StoreError, match=r'add \[contact\] normal = "fixed" to the study, or choose another'):
        grid_for(read_study(write_study(tmp_path, **SMALL | {"contact": ""})))
