"""Journals that say two things of a case."""

import binascii
from zlib import crc32

import pytest
from running import run_here, stored_bytes, write_study
from test_journal import HEADER, measures, write

from rubhpc.schema import DONE, FAILED, MISSING
from rubhpc.storage.journal import Entry
from rubhpc.storage.verify import contradicted


def entry(seed, *, flat=2, checksum=7, status=DONE, reason="", wall_time=1.0):
    row = measures(seed)
    row["wall_time"] = wall_time
    return Entry(flat, f"id{flat}", status, checksum, row.tobytes(), reason)


MISSED = Entry(2, "id2", MISSING)


@pytest.mark.parametrize(
    ("entries", "found"),
    [
        ([entry(1), entry(1)], set()),
        ([entry(1), entry(1, wall_time=2.0)], set()),
        ([entry(1), entry(2)], {2}),
        ([entry(1), entry(1, checksum=8)], {2}),
        ([entry(1), entry(1, flat=3, checksum=8)], set()),
        ([entry(1), MISSED, entry(2)], set()),
        ([entry(1), entry(2), MISSED], set()),
        ([entry(1, status=FAILED, reason="why"), entry(2)], set()),
    ],
    ids=["same", "time", "measures", "bytes", "cases", "missed", "marked", "failed"],
)
def test_lines_of_one_journal(tmp_path, entries, found):
    write(tmp_path, *entries)
    assert contradicted(tmp_path, HEADER) == found


def test_a_later_run_decides(tmp_path):
    write(tmp_path, entry(1), entry(2))
    assert contradicted(tmp_path, HEADER) == {2}
    write(tmp_path, entry(3), run=2)
    assert contradicted(tmp_path, HEADER) == set()


def test_a_doubled_journal_loses_nothing_and_a_foreign_line_is_named(tmp_path):
    """Of two results the one with the stored arrays cannot be found if these agree: the case is computed."""
    study = write_study(tmp_path, friction=[0.1], speed_ratio=[0.9])
    assert run_here("run", study, "--quiet").returncode == 0
    store = tmp_path / "tiny.zarr"
    expected = stored_bytes(store)
    (journal,) = (store / ".rubhpc" / "journal").iterdir()
    whole = journal.read_bytes()
    journal.write_bytes(whole + whole)
    assert run_here("verify", store).stdout == "2 cases checked, no damage\n"
    line = whole.splitlines()[-1][9:].split(b" ", 5)
    record = bytearray(binascii.a2b_base64(line[4]))
    record[0] ^= 1
    line[4] = binascii.b2a_base64(bytes(record), newline=False)
    text = b" ".join(line)
    journal.write_bytes(whole + b"%08x %s\n" % (crc32(text), text))
    found = run_here("verify", store)
    assert found.returncode == 3
    assert "two lines of a journal contradict each other" in found.stdout
    assert len(found.stderr.splitlines()) == 1
    assert run_here("run", study, "--quiet").returncode == 0
    assert run_here("verify", store).returncode == 0
    assert stored_bytes(store) == expected
