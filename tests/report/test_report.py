"""The report's words and what it carries, without a browser: what is said is so."""

from __future__ import annotations

import base64
import html
import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
import synthetic_store
from printing import printed
from unpacking import unpacked_floats, unpacked_record

from postproc.cases.maps import validity
from postproc.report import budget
from postproc.report.budget import write_report
from postproc.report.cases import Cases
from postproc.report.grid import Measures, described_axes
from postproc.report.page import Page, least_size
from postproc.report.pictures import whirl_facts
from postproc.store.attributes import table_of
from postproc.store.open import open_store
from rubhpc.commands.report import report
from rubhpc.errors import InputError
from rubhpc.rig.reading import read_rig
from rubhpc.rig.rig import Rig
from rubhpc.rig.stators import Bore

MB = 1e6


class Elements(HTMLParser):
    """Elements of a page with their attributes, and the text of its scripts by their id."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.scripts: dict[str | None, str] = {}
        self._script: str | bool | None = False
        self.feed(text)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag == "script":
            self._script = dict(attrs).get("id")

    def handle_data(self, data: str) -> None:
        if self._script is not False:
            self.scripts[self._script] = self.scripts.get(self._script, "") + data

    def handle_endtag(self, tag: str) -> None:
        if tag == "script":
            self._script = False


@pytest.fixture(scope="module")
def written(two_stator_path):
    path = two_stator_path.with_suffix(".html")
    write_report(open_store(two_stator_path), path, 20 * MB)
    return Elements(path.read_text())


def test_all_that_is_shown_of_a_quantity_has_one_unit(two_stator_path):
    facts = json.loads(Elements(Page(open_store(two_stator_path)).html(values={})).scripts["facts"])
    assert {n: s["unit"] for n, s in facts["signals"].items()} == {
        "vertical": "µm",
        "horizontal": "µm",
        "torsion": "µrad",
        "torsion_acceleration": "rad s⁻²",
        "stator_axial": "µm",
        "stator_lateral": "µm",
        "contact_force": "N",
    }
    stronger = Page(
        open_store(two_stator_path).assign(peak_torsion=open_store(two_stator_path)["peak_torsion"] * 1e3)
    )
    assert stronger.measures.scale("torsion") == stronger.measures.scale("peak_torsion")
    assert stronger.measures.scale("torsion").unit == "mrad"


def test_the_page_needs_nothing_else(written):
    kinds = {tag for tag, _ in written.found}
    assert not {"iframe", "object", "audio"} & kinds  # pictures are data, as links below
    links = [
        value for tag, a in written.found for name, value in a.items() if name in ("src", "href", "action")
    ]
    assert all(link.startswith(("#", "data:")) for link in links if link)


def test_the_page_carries_every_case_that_is_done(written):
    records = json.loads(written.scripts["records"])
    status = synthetic_store.make()["status"].values.ravel()
    assert sorted(map(int, records)) == np.flatnonzero(status == 1).tolist()
    values = json.loads(written.scripts["values"])
    assert np.array_equal(unpacked_floats(base64.b64decode(values["status"])), status)
    facts = json.loads(written.scripts["facts"])
    assert [axis["key"] for axis in facts["axes"]][-1] == "stator.youngs_modulus"
    assert [len(axis["values"]) for axis in facts["axes"]] == [5, 3, 2, 2]
    assert facts["nStator"] == 2


def test_every_control_and_drawing_has_a_name(written):
    by_role = [(tag, a) for tag, a in written.found if a.get("role") in ("img", "application")]
    assert len(by_role) >= 6
    assert all(a.get("aria-label") or a.get("aria-labelledby") for _, a in by_role)
    ids = [a["id"] for _, a in written.found if "id" in a]
    assert len(ids) == len(set(ids))
    named = {
        word
        for _, a in written.found
        for k in ("aria-labelledby", "aria-describedby")
        for word in (a.get(k) or "").split()
    }
    assert named <= set(ids)


def test_failures_are_reported_with_their_reasons(two_stator_path):
    dataset = open_store(two_stator_path).assign_attrs(reasons={0: "ran away <b>", 12: "worker died"})
    text = Page(dataset).html(values={})
    assert "1 case diverged" in text
    assert "1 case failed" in text
    assert "ran away &lt;b&gt;" in text
    assert "worker died" in text
    assert "speed ratio 1, clearance 70 µm, friction coefficient 0.1, stator modulus 3 GPa" in text


def test_validity_counts_what_is_out_of_range(two_stator_path):
    text = Page(open_store(two_stator_path)).html(values={})
    rows = re.findall(r'scope="row">([^<]+)</th><td>[^<]+</td>\D*?data-label="Cases">(\d+)<', text)
    reported = {name: int(n) for name, n in rows}
    # Of 60 cases those at the speeds 1.5 and 1.7 slip back, and those at 1.7 are over the Euler load.
    assert reported["Lowest slip speed"] == 24
    assert reported["Contact force over Euler load"] == 12
    assert reported["Tip deflection over length"] == 0


@pytest.mark.parametrize("law", ["coulomb", "stribeck", "table"])
def test_slip_may_reverse_without_steady_sliding(two_stator_path, law):
    dataset = open_store(two_stator_path)
    study = {**table_of(dataset, "study"), "contact": {"friction_law": law}}
    text = Page(dataset.assign_attrs(study=study)).html(values={})
    assert "Contact force over Euler load" in text
    assert "contradicts steady sliding" not in text
    assert "no limit of the model; below 0 the rim slips back" in text  # how many cases is still stated
    found, sliding = validity(dataset.assign_attrs(study=study)), validity(dataset)
    assert int((found & 1).sum()) == 0
    assert "slip" not in found.attrs["long_name"]
    assert int((sliding & 1).sum()) == 24
    assert "slip out of range" in sliding.attrs["long_name"]


@pytest.mark.parametrize(("room", "is_cut"), [(20_000, True), (300_000, False)])
def test_the_size_is_kept_and_what_is_left_out_is_said(two_stator_path, tmp_path, room, is_cut):
    path = tmp_path / "small.html"
    limit = least_size(Page(open_store(two_stator_path))) + room
    load = write_report(open_store(two_stator_path), path, limit)
    assert path.stat().st_size <= limit
    text = path.read_text()
    n_kept = len(json.loads(Elements(text).scripts["records"]))
    assert n_kept == len(load.records)
    assert (n_kept < 57) == is_cut
    assert (f"sections of {57 - n_kept} cases" in text) == is_cut
    assert all(note in html.unescape(text) for note in load.notes)


def test_predicting_the_size_reads_no_case_but_the_pilots(two_stator_path, tmp_path, monkeypatch):
    """What lies around the pilots of 100 000 cases took longer to read than all that is on the page."""
    alone: list[int] = []
    record = Cases.record
    monkeypatch.setattr(
        Cases, "record", lambda self, flat, level: record(self, alone.append(flat) or flat, level)
    )
    monkeypatch.setattr(budget, "_PILOTS", 3)
    load = write_report(open_store(two_stator_path), tmp_path / "page.html", 20e6)
    assert len(alone) == 3  # the others are read at once
    assert len(load.records) > 48


def test_a_limit_that_nothing_fits_is_refused(two_stator_path, tmp_path):
    with pytest.raises(InputError, match=r"--limit: 0\.1 MB is too small for this store; give 0\.\d MB"):
        write_report(open_store(two_stator_path), tmp_path / "none.html", 0.1 * MB)
    assert not (tmp_path / "none.html").exists()


@pytest.mark.parametrize("keep", [(), ("spectrum",), ("section",), ("waveform",)])
def test_a_store_that_keeps_less_has_a_page_too(tmp_path, keep):
    synthetic_store.write(tmp_path / "less.zarr", synthetic_store.make(keep=keep))
    load = write_report(open_store(tmp_path / "less.zarr"), tmp_path / "less.html", 20 * MB)
    if not keep:
        assert load.records == {}
        assert "no waveforms, spectra or sections" in (tmp_path / "less.html").read_text()
        return
    record = unpacked_record(next(iter(load.records.values())))
    kinds = {kind for kind in ("waves", "spectra", "section") if record[kind]}
    assert (
        kinds
        == {"spectrum": {"spectra"}, "section": {"section"}, "waveform": {"waves", "spectra", "section"}}[
            keep[0] if keep else ""
        ]
    )


def test_an_unsorted_axis_has_its_cells_in_order():
    dataset = synthetic_store.make(keep=()).isel(clearance=[2, 0, 1])
    axis = described_axes(dataset)[1]
    assert axis["values"] == pytest.approx([100, 70, 84])
    assert axis["order"] == [1, 2, 0]
    assert axis["edges"] == sorted(axis["edges"])
    assert axis["unit"] == "µm"


RINGS = {
    "several": {"angle": 2.0, "count": 5},
    "wall": {"angle": 0.5, "rigid": True},
    "lumped": {"mass": 0.1, "stiffness": 1e6},
}


@pytest.mark.parametrize("kind", RINGS)
def test_every_kind_of_stator_is_drawn(kind):
    from postproc.report.rig_views import end_view, side_view
    from rubhpc.rig.stators import LumpedStator

    rig = read_rig("mokhtar2017")
    settings = RINGS[kind]
    if kind == "several":
        stator = type(rig.stator[0])(**{**vars(rig.stator[0]), **settings})
    else:
        stator = LumpedStator(node=8, **settings)
    rig = Rig(name="ring", rotor=rig.rotor, stator=(stator,))
    n_drawn = end_view(rig).count("rotate(") - 1  # the arrow of the spin is turned too
    assert n_drawn == (5 if kind == "several" else 1)
    assert "1 disc, 2 bearings" in side_view(rig)


@pytest.mark.parametrize(("count", "kind"), [(8, "circle"), (1, "path")])
def test_a_carrier_is_drawn_on_its_springs(count, kind):
    """In place of the walls behind its stators; around the shaft where they are."""
    from postproc.report.rig_views import end_view, side_view
    from rubhpc.rig.carriers import Carrier

    rig = read_rig("mokhtar2017")
    casing = Carrier(name="casing", mass=5.0, stiffness=2e6)
    stator = replace(rig.stator[0], carrier="casing", count=count)
    rig = Rig(name="ring", rotor=rig.rotor, stator=(stator,), carrier=(casing,))
    view = end_view(rig)
    assert view.count('class="carrier"') == view.count('class="spring"') == view.count('class="wall"') == 1
    assert f'<{kind} class="carrier"' in view
    assert "not to scale: casing" in view
    assert "1 carrier" in side_view(rig)
    assert side_view(rig).count('class="spring"') == (2 if count == 8 else 1)


def test_a_rotor_of_matrices_is_reported_in_words():
    from postproc.report.rig_views import description, end_view, side_view
    from rubhpc.rig.stators import LumpedStator

    stop = LumpedStator(node=1, mass=1e-4, stiffness=1e6, radius=1.0)
    rig = Rig.from_matrices([[100.0]], None, [[1e4]], degrees=[(1, "v")], stators=[stop])
    assert side_view(rig) == ""
    assert "<svg" in end_view(rig)
    assert description(rig) == "rotor of 1 degree of freedom, by its matrices; 1 stator"


def test_the_command_writes_the_page_and_says_what_is_on_it(two_stator_path, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = printed(report, two_stator_path, "--limit", "3 MB")
    assert said.startswith("study.html (")
    assert "all cases with a result" in said
    assert (tmp_path / "study.html").is_file()


@pytest.mark.parametrize(
    ("args", "message"),
    [
        (["--output", "page.pdf"], "name it page.html"),
        (["--output", "no/page.html"], "no directory no"),
        (["--limit", "20 kg"], "--limit"),
        (["--limit", "much"], "--limit"),
    ],
)
def test_wrong_input_is_one_line(two_stator_path, tmp_path, monkeypatch, args, message):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError) as refusal:
        printed(report, two_stator_path, *args)
    assert message in str(refusal.value)
    assert list(tmp_path.iterdir()) == []


def test_the_page_has_the_critical_speeds_of_the_rotor(synthetic_path):
    store = open_store(synthetic_path)
    text = Page(store).html(values={})
    assert "Without contact, the rotor is stable" in text
    assert re.search(r"<td class=.number.>1894</td><td>forward</td>", text)  # 31.56 Hz
    assert "data:image/svg+xml;base64," in text
    bare = store.copy()
    bare.attrs = {k: v for k, v in store.attrs.items() if k != "rig"}
    assert "There is no linear design of this rig" in Page(bare).html(values={})


def test_measures_say_which_stator_is_the_worst(two_stator_path):
    facts = json.loads(Elements(Page(open_store(two_stator_path)).html()).scripts["facts"])
    worst = {v["name"]: v["worst"] for v in facts["variables"] if v["by_stator"]}
    assert worst["peak_contact_force"] == "largest"
    assert worst["minimum_slip_speed"] == "smallest"


def test_masses_have_no_euler_load():
    beams = synthetic_store.make(n_stator=2)
    mass = {"node": 8, "radius": 0.06, "mass": 1e-3, "stiffness": 1e6, "lateral_stiffness": 1e5}
    masses = beams.assign_attrs(rig=beams.attrs["rig"] | {"stator": [mass, mass | {"angle": 1.0}]})
    of_beams, of_keys = (
        {"force_over_euler_load", "tip_deflection_ratio"},
        {"force_over_strength", "bearing_clearance_ratio"},
    )
    assert of_beams <= set(Measures(beams).names)
    assert of_beams.isdisjoint(Measures(masses).names)
    assert set(Measures(beams).names) - of_beams == set(Measures(masses).names)
    assert of_keys.isdisjoint(Measures(beams).names)
    strong = beams.assign_attrs(rig=beams.attrs["rig"] | {"stator": [mass | {"strength": 100.0}]})
    assert of_keys & set(Measures(strong).names) == {"force_over_strength"}


def test_the_page_says_what_can_whirl_in_a_bore(synthetic_path):
    store = open_store(synthetic_path)
    assert not whirl_facts(store)["sentences"], "no bore"
    bored = store.copy()
    hole = Bore(node=8, mass=1.0, stiffness=1e6, damping=100.0)
    rig = replace(read_rig("mokhtar2017"), stator=(hole,))
    bored.attrs = store.attrs | {"rig": rig.as_dict()}
    text = Page(bored).html(values={})
    assert 'href="#whirl"' in text
    assert "Stator 1, node 8: no dry whirl" in text
    assert text.count("data:image/png") == 1
