from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pytest

from rubhpc.schema import DIVERGED, DONE, FAILED, MISSING, case_measures
from rubhpc.storage.journal import Entry, Header, Journal, journals, next_run
from rubhpc.storage.ledger import replay
from rubhpc.storage.measures import measures_type, unlisted_measures
from rubhpc.study.points import Points

if TYPE_CHECKING:
    from pathlib import Path


class Column(NamedTuple):
    dimension: str
    values: tuple[float, ...]


def header_of(*values: tuple[float, ...], identity: str = "abc", n_stator: int = 2) -> Header:
    """Header of a study with an axis for each of these values."""
    points = Points([Column(f"axis{i}", column) for i, column in enumerate(values)])
    return Header(identity=identity, points=points, n_stator=n_stator, measures=case_measures())


HEADER = header_of((0.1, 0.2), (1.0, 2.0, 3.0))


def write(
    folder: Path, *entries: Entry, run: int = 1, writer: str = "rank00000", header: Header = HEADER
) -> Path:
    with Journal(folder, run, writer, header) as journal:
        journal.write(entries)
    return journal.path


def measures(seed: int, n_stator: int = 2) -> np.ndarray:
    """Every bit pattern a float may have, near enough: signs, subnormals, infinities, NaN."""
    rng = np.random.default_rng(seed)
    row = np.zeros((), measures_type(case_measures(), n_stator))
    for name in row.dtype.names:
        kind = row[name].dtype
        if kind.kind == "f":
            values = rng.choice(
                [math.pi * 1e-300, 5e-324, -0.0, math.inf, math.nan, rng.normal()], row[name].shape
            )
            row[name] = values
        else:
            row[name] = rng.integers(0, np.iinfo(kind).max, row[name].shape)
    return row


def test_what_is_written_is_read_back_bit_by_bit(tmp_path):
    rows = {flat: measures(flat) for flat in range(5)}
    write(tmp_path, *(Entry(i, f"id{i}", DONE, 0xDEADBEEF - i, row.tobytes()) for i, row in rows.items()))
    ledger = replay(tmp_path, HEADER)
    assert ledger.status.tolist() == [DONE] * 5 + [MISSING]
    assert ledger.checksum[:5].tolist() == [0xDEADBEEF - i for i in range(5)]
    for i, row in rows.items():
        assert ledger.measures[i].tobytes() == row.tobytes()


def test_the_measures_of_stores_without_a_list_do_not_change():
    """As long as the schema has them, their type and dimensions are those of old journals."""
    frozen = measures_type(unlisted_measures(), 2)
    assert (len(frozen.names), frozen.itemsize) == (22, 9 * 2 * 8 + 11 * 8 + 3)
    listed = [variable for variable in case_measures() if variable.name in frozen.names]
    assert measures_type(listed, 2) == frozen


def test_a_reason_of_any_text_stays_on_its_line(tmp_path):
    reason = 'line one\nline two - "quoted" \\ ünïcode'
    write(
        tmp_path,
        Entry(0, "a", FAILED, reason=reason),
        Entry(1, "b", DIVERGED, 1, measures(1).tobytes(), "grew"),
    )
    ledger = replay(tmp_path, HEADER)
    assert ledger.reasons == {0: reason, 1: "grew"}
    assert ledger.status[:2].tolist() == [FAILED, DIVERGED]


@pytest.mark.parametrize("cut", [1, 2, 10, 60])
def test_a_line_cut_short_is_passed_over_and_the_rest_kept(tmp_path, cut):
    path = write(tmp_path, *(Entry(i, f"id{i}", DONE, i, measures(i).tobytes()) for i in range(3)))
    path.write_bytes(path.read_bytes()[:-cut])
    ledger = replay(tmp_path, HEADER)
    assert ledger.status[:3].tolist() == [DONE, DONE, MISSING]
    assert ledger.skipped.total() == 1
    assert ledger.damaged_cases == {2}


def test_no_flipped_bit_goes_unseen(tmp_path):
    path = write(tmp_path, Entry(4, "id", DONE, 7, measures(0).tobytes()))
    whole = path.read_bytes()
    begin = whole.index(b"\n") + 1
    for at in range(begin, len(whole), 7):
        changed = bytearray(whole)
        changed[at] ^= 0x10
        path.write_bytes(changed)
        ledger = replay(tmp_path, HEADER)
        assert not ledger.status.any(), at
        assert ledger.skipped.total() >= 1


def test_without_its_header_a_line_counts_if_its_id_is_that_of_its_place(tmp_path):
    """A damaged header costs nothing; lines of another grid, or of measures of another size, stay out."""
    lines = [Entry(i, HEADER.id_at(i), DONE, i, measures(i).tobytes()) for i in range(3)]
    path = write(tmp_path, *lines, Entry(4, HEADER.id_at(5), DONE, 4, measures(4).tobytes()))
    write(tmp_path, Entry(5, HEADER.id_at(5), DONE, 1, measures(0, 1).tobytes()), writer="rank00001")
    for journal in tmp_path.iterdir():
        data = bytearray(journal.read_bytes())
        data[20] ^= 1
        journal.write_bytes(data)
    ledger = replay(tmp_path, HEADER)
    assert ledger.status.tolist() == [DONE] * 3 + [MISSING] * 3
    assert ledger.measures[2].tobytes() == measures(2).tobytes()
    assert ledger.skipped.total() == 2
    path.write_bytes(path.read_bytes()[:20])
    assert not replay(tmp_path, HEADER).is_known.any()


@pytest.mark.parametrize(
    "foreign",
    [
        header_of(*HEADER.points.values, identity="other"),
        header_of(*HEADER.points.values, n_stator=1),
        header_of((0.1, 0.25), (1.0, 2.0, 3.0)),
        header_of((0.1, 0.2), (1.0, 2.0, 3.0, 4.0)),
        header_of((0.1, 0.2), (1.0, 2.0)),
        header_of((0.2, 0.1), (1.0, 2.0, 3.0)),
        header_of((0.1, 0.2)),
    ],
    ids=["identity", "stators", "values", "larger grid", "smaller grid", "order", "fewer axes"],
)
def test_journals_of_another_study_do_not_count(tmp_path, foreign):
    write(tmp_path, Entry(0, "a", DONE, 1, measures(0, foreign.n_stator).tobytes()), header=foreign)
    ledger = replay(tmp_path, HEADER)
    assert not ledger.is_known.any()
    assert ledger.skipped.total() == 0


def test_the_later_run_has_the_last_word(tmp_path):
    write(tmp_path, Entry(0, "a", FAILED, reason="old"), Entry(1, "b", DONE, 1, measures(0).tobytes()))
    write(tmp_path, Entry(0, "a", DONE, 5, measures(1).tobytes()), run=2)
    write(tmp_path, Entry(1, "-", MISSING), run=10, writer="verify")
    ledger = replay(tmp_path, HEADER)
    assert ledger.status[:2].tolist() == [DONE, MISSING]
    assert ledger.reasons == {}
    assert ledger.is_known[:2].all()
    assert next_run(tmp_path) == 11


def test_what_a_run_takes_back_comes_before_what_it_computes(tmp_path):
    write(tmp_path, Entry(0, "a", DONE, 5, measures(1).tobytes()), run=3)
    write(tmp_path, Entry(0, "-", MISSING), run=3, writer="gone")
    assert replay(tmp_path, HEADER).status[0] == DONE
    assert [path.name for path in journals(tmp_path)] == [
        "run000003-gone.journal",
        "run000003-rank00000.journal",
    ]


def test_a_run_without_results_leaves_no_file(tmp_path):
    with Journal(tmp_path, 1, "rank00000", HEADER):
        pass
    assert journals(tmp_path) == []
    assert next_run(tmp_path) == 1
