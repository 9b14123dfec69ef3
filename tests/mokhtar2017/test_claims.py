"""The claims on stores of known content: each holds on what it describes, and fails on what it does not."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from spoiling import SPOILED

from postproc.mokhtar2017.claims.cases import FREEDOM, SIXTH_HARMONIC, CaseFailed
from postproc.mokhtar2017.claims.claim import FAILS, HEAD, HOLDS, REPORTED, as_json, document_of, text
from postproc.mokhtar2017.claims.loops import count_loops
from postproc.mokhtar2017.claims.quantities import tilt
from postproc.mokhtar2017.claims.table import CLAIMS, on_figure
from rubhpc.errors import InputError, StoreError
from rubhpc.schema import DIVERGED, MISSING

BY_ID = {claim.id: claim for claim in CLAIMS}
GATED = [claim.id for claim in CLAIMS if not claim.is_reported]
DOCUMENT = Path(__file__).parents[2] / "docs" / "claims.md"


@pytest.fixture(scope="module")
def results(sound):
    return [claim.evaluate(sound) for claim in CLAIMS]


def test_each_claim_holds_on_what_it_describes_or_is_reported(results):
    assert {r.claim.id: r.found for r in results if r.verdict == FAILS} == {}
    assert {r.claim.id for r in results if r.verdict == REPORTED} == BY_ID.keys() - set(GATED)


def test_every_gated_claim_is_spoiled():
    assert set(GATED) == SPOILED.keys()
    assert len(CLAIMS) == len(BY_ID)


@pytest.mark.parametrize(("name", "i"), [(name, i) for name in GATED for i in range(len(SPOILED[name]))])
def test_a_claim_fails_on_what_it_does_not_describe(name, i, sound):
    result = BY_ID[name].evaluate(SPOILED[name][i](sound))
    assert result.verdict == FAILS, result.found


def test_findings_show_the_known_content(results):
    found = {r.claim.id: r.found for r in results}
    assert found["C14"] == "11/2X (130.18 Hz)"
    assert found["C12"] == "1/2X, 1X, 3/2X: 1.4, 122, 4.3 µm"
    assert found["C51"].endswith("means -70, -48, -24 µm")
    assert found["C71"].startswith("1X at r 1.7, 1/2X at r 3.5, 1/3X at r 5.3")
    assert found["D1"].endswith("30 GPa: r 1.7, 3.5, 5.3")
    assert found["D3"] == "0.86 and 0.40"


def test_a_case_that_diverged_fails_its_claims_and_one_not_computed_is_refused(sound):
    store = sound["sixth_harmonic"]
    status = store["status"].copy()
    status[1] = DIVERGED
    with pytest.raises(CaseFailed, match="diverged"):
        SIXTH_HARMONIC.of({"sixth_harmonic": store.assign(status=status)})
    assert BY_ID["C24"].evaluate({"sixth_harmonic": store.assign(status=status)}).verdict == FAILS
    status[1] = MISSING
    with pytest.raises(StoreError, match="make paper"):
        SIXTH_HARMONIC.of({"sixth_harmonic": store.assign(status=status)})


TURN = 2 * np.pi * np.arange(400) / 400


@pytest.mark.parametrize(
    ("path", "loops"),
    [
        (np.exp(1j * TURN), 1),
        (np.cos(TURN) + 0.2j * np.sin(TURN - 1), 1),
        (np.exp(2j * TURN) + 0.5 * np.exp(1j * TURN), 2),  # two lobes, one in the other
        (np.exp(3j * TURN) + 0.5 * np.exp(1j * TURN), 3),
        (np.cos(TURN) + 1j * np.sin(2 * TURN), 2),  # a figure of eight
        (np.exp(2j * TURN) + 0.5 * np.exp(-1j * TURN), 2),  # lobes that cross one another three times
        (np.exp(1j * TURN) + 0.02 * np.exp(40j * TURN), 1),  # wiggles are no loops
    ],
)
def test_loops_are_counted(path, loops):
    assert count_loops(path * np.exp(0.3j) + 0.1) == loops


def test_tilt_is_the_lean_of_the_long_axis(sound):
    case = FREEDOM.but(speed_ratio=1.5, stator_1_lateral=0).of(sound)
    assert tilt(case) == pytest.approx(0, abs=1e-6)
    lean = math.radians(20)
    path = (case["vertical"] + 1j * case["horizontal"]) * np.exp(1j * lean)
    assert tilt(case.assign(vertical=path.real, horizontal=path.imag)) == pytest.approx(lean, abs=1e-6)


def test_claims_are_found_by_their_figures():
    assert BY_ID["C17"].figures == [6, 7]
    assert BY_ID["C01"].figures == []
    assert {c.id for c in on_figure(20)} == {"C70", "C71", "C72", "D6"}
    with pytest.raises(InputError, match="--figure 2: no claim on it"):
        on_figure(2)


def test_results_as_text_and_as_json_show_the_same(results):
    listed = json.loads(as_json(results))
    assert [entry["id"] for entry in listed] == [c.id for c in CLAIMS]
    assert all(set(entry) == set(HEAD) for entry in listed)
    shown = text(results, 100)
    assert max(map(len, shown.splitlines())) <= 100
    assert shown.splitlines()[-1] == f"{len(GATED)} hold, {len(CLAIMS) - len(GATED)} are reported"
    assert re.findall(r"^([CD]\d+)", shown, re.MULTILINE) == [entry["id"] for entry in listed]


def test_the_document_lists_the_claims_of_the_code_and_none_that_fails(results):
    def rows(document):
        lines = [line for line in document.splitlines() if re.match(r"\| [CD]\d", line)]
        return [[cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in lines]

    fresh, kept = rows(document_of(results)), rows(DOCUMENT.read_text())
    reported = [HEAD.index(column) for column in ("id", "figure", "claim", "expected")]
    assert [[row[i] for i in reported] for row in kept] == [[row[i] for i in reported] for row in fresh]
    assert {row[-1] for row in kept} == {HOLDS, REPORTED}
