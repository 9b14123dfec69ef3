"""Study and rig files that nobody would write: never a traceback, nothing written where they are refused.

Two ways to spoil a good file: bytes changed anywhere, and values, keys and tables replaced by what a grammar
of nasty ones yields.
"""

from __future__ import annotations

import os
import re
import tempfile
import time
import tomllib
from collections import Counter
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st

import rubhpc
from rubhpc.cli import main
from rubhpc.running import job

if TYPE_CHECKING:
    from collections.abc import Iterator

ROOT = Path(__file__).parents[2]
RIG = Path(rubhpc.__file__).parent / "rigs" / "mokhtar2017.toml"
STUDIES = sorted((ROOT / "jobs").glob("*.toml"))
LONGEST = 20.0  # s that any file may take, on a busy machine

NUMBERS = ["0", "-1", "1e400", "-0.0", "nan", "inf", "0x7fffffffffffffff", "1e-320", "2", "0.5", "9" * 400]
TEXTS = [
    *("10**10**10 m", "10^10^10^10", "1e999999999 m", "1 m**99999999", "1/0 m", "((((((1))))))", "nan m"),
    *("__import__('os').system('touch pwned')", "{os.system}", "$(touch pwned)", "`touch pwned`", "9" * 5000),
    *("\\u0000", "\\n", "", " ", "../../pwned", "/dev/zero", "/dev/stdin", "~/pwned", ".", "os:system"),
    *("my_rig.py:build", "mokhtar2017", "3 GPa", "100 um", "1800 rpm", "-5 %", "\u202e", "\U0001f4a5"),
    *("5 m m m m m m m m m m m", "1 Pa/Pa/Pa", "log"),
]
VALUES = st.one_of(
    st.sampled_from(NUMBERS),
    st.sampled_from(TEXTS).map(lambda text: f'"{text}"'),
    st.sampled_from(
        ["true", "[]", "{}", "[[]]", "2017-01-01", "[" * 3000, "{ start = 0, stop = 1, num = 999999999 }"]
    ),
    st.sampled_from(
        [
            "{ start = 1, stop = 2, step = 1e-9 }",
            "{ start = 1, stop = 2, num = 3, scale = 'log' }",
            "{ start = 0.5, stop = 5, num = 3000 }",
            "{ start = -1, stop = 'x', num = 2 }",
        ]
    ),
    st.lists(st.sampled_from(NUMBERS), min_size=1, max_size=4).map(lambda many: f"[{', '.join(many)}]"),
)
_KEYS = """speed_ratio speed clearance friction transient revolutions keep block step method output rig title
    length __class__ "stator.youngs_modulus" "rotor.bearing.1.kyy" "a.b.c" "" samples_per_revolution
    case_time_limit max_failures node elements law accuracy"""
KEYS = st.sampled_from(_KEYS.split())


@st.composite
def by_grammar(draw: st.DrawFn, text: str) -> bytes:
    """The file with some of its lines given other values or keys, doubled, dropped or moved."""
    lines = text.splitlines()
    for _ in range(draw(st.integers(1, 4))):
        at = draw(st.integers(0, len(lines) - 1))
        key, equals, value = lines[at].partition("=")
        kind = draw(st.sampled_from(["value", "value", "value", "key", "drop", "double", "new", "table"]))
        if kind == "value" and equals:
            lines[at] = f"{key}= {draw(VALUES)}"
        elif kind == "key" and equals:
            lines[at] = f"{draw(KEYS)} ={value}"
        elif kind == "drop":
            del lines[at]
        elif kind == "double":
            lines.insert(draw(st.integers(0, len(lines))), lines[at])
        elif kind == "new":
            lines.insert(at, f"{draw(KEYS)} = {draw(VALUES)}")
        else:
            lines.insert(
                at, draw(st.sampled_from(["[grid]", "[run]", "[[stator]]", "[rotor]", "[x.y]", "[[grid]]"]))
            )
        lines = lines or [""]
    return "\n".join(lines).encode()


@st.composite
def by_bytes(draw: st.DrawFn, text: str) -> bytes:
    """The file with some bytes changed, dropped or put in."""
    data = bytearray(text.encode())
    for _ in range(draw(st.integers(1, 6))):
        at = draw(st.integers(0, len(data) - 1))
        kind = draw(st.sampled_from(["change", "drop", "insert", "cut"]))
        if kind == "change":
            data[at] = draw(st.integers(0, 255))
        elif kind == "drop":
            del data[at : at + draw(st.integers(1, 20))]
        elif kind == "insert":
            data[at:at] = draw(st.binary(min_size=1, max_size=4))
        else:
            del data[at:]
        data = data or bytearray(b"\n")
    return bytes(data)


def small(text: str) -> str:
    """A study of the packaged kind that reads the rig beside it."""
    text = re.sub(r'(?m)^rig *= *".*?"', 'rig = "rig.toml"', text)
    return re.sub(r'(?m)^output *= *".*?"', 'output = "out.zarr"', text)


def spoil(text: str) -> st.SearchStrategy[bytes]:
    return st.one_of(by_grammar(text), by_bytes(text))


STUDY_TEXTS = st.sampled_from([small(path.read_text()) for path in STUDIES])
PAIRS = st.one_of(
    st.tuples(STUDY_TEXTS.flatmap(spoil), st.just(RIG.read_bytes())),
    st.tuples(STUDY_TEXTS.map(str.encode), spoil(RIG.read_text())),
)


def listing(folder: Path) -> dict[str, bytes]:
    return {str(p.relative_to(folder)): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def check(study: bytes, rig: bytes) -> int:
    """Run the command on both files, for no time; returns its exit code."""
    with tempfile.TemporaryDirectory() as above:
        folder = Path(above) / "a" / "b"
        folder.mkdir(parents=True)
        (folder / "study.toml").write_bytes(study)
        (folder / "rig.toml").write_bytes(rig)
        (folder / "my_rig.py").write_text("open('pwned', 'w')\n")
        before = listing(Path(above))
        out, err = StringIO(), StringIO()
        began = time.monotonic()
        with chdir(folder), redirect_stdout(out), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main(["study.toml", "--time-limit", "1 us", "--quiet"])
        code = int(ended.value.code or 0)
        assert time.monotonic() - began < LONGEST
        assert code in (0, 2, 3, 75), err.getvalue()
        assert "Traceback" not in err.getvalue()
        lines = err.getvalue().splitlines()
        assert len(lines) == (code != 0), lines
        assert all(line.startswith("rubhpc: ") and line.isprintable() for line in lines), lines
        after = listing(Path(above))
        if code == 2:
            assert after == before, lines
        else:  # nothing was written but the store that the study names
            store = os.path.normpath(Path("a/b", tomllib.loads(study.decode()).get("output", "study.zarr")))
            beside = {name for name in after if name in before or not name.startswith(f"{store}/")}
            assert {name: after[name] for name in beside} == before
        return code


@pytest.fixture(autouse=True, scope="module")
def no_physics() -> Iterator[None]:
    """What can be run is not run: these are tests of the files."""
    patch = pytest.MonkeyPatch()
    patch.setattr(job, "_warm_up", lambda *_: None)
    yield
    patch.undo()


@pytest.mark.timeout(3600)
@pytest.mark.parametrize("n_example", [30, pytest.param(3000, marks=pytest.mark.long)])
def test_no_file_breaks_the_program(n_example):
    codes = Counter()

    @settings(max_examples=n_example, phases=[Phase.generate])
    @given(pair=PAIRS)
    def run(pair):
        codes[check(*pair)] += 1

    run()
    print(f"\n{codes.total()} spoilt files by exit code: {codes}")


@pytest.mark.parametrize(
    ("key", "text"),
    [
        pytest.param(f'{key} = "{{}}"', text, marks=[pytest.mark.long] if i % one_in else [])
        # A study of any title, and most outputs, is begun, which takes longest: of these some.
        for key, one_in in (("output", 3), ("rig", 1), ("title", 6), ("clearance", 1))
        for i, text in enumerate(TEXTS)
    ],
)
def test_no_text_is_an_expression(key, text):
    """Each nasty text in each key that takes one; none is run, none is slow, none writes beside the store."""
    study = '[grid]\nspeed = 100\nfriction = 0.3\nclearance = "100 um"\n'
    line = key.format(text)
    name = line.partition(" ")[0]
    study = re.sub(rf"(?m)^{name} .*\n", "", study)
    whole = f"{study}{line}\n" if name == "clearance" else f"{line}\n{study}"
    whole = whole if name == "rig" else f'rig = "rig.toml"\n{whole}'
    check(whole.encode(), RIG.read_bytes())


def test_a_rig_in_python_is_run_only_where_it_is_trusted(tmp_path):
    """The word of a study file is not enough."""
    (tmp_path / "my_rig.py").write_text("open('pwned', 'w')\n")
    study = tmp_path / "study.toml"
    study.write_text('rig = "my_rig.py:build"\n[grid]\nspeed = 100\nfriction = 0.3\nclearance = "100 um"\n')
    err = StringIO()
    for command in (["run"], ["plan"]):
        with chdir(tmp_path), redirect_stderr(err), pytest.raises(SystemExit) as ended:
            main([*command, str(study)])
        assert ended.value.code == 2
    assert "--trust-rig" in err.getvalue()
    assert sorted(os.listdir(tmp_path)) == ["my_rig.py", "study.toml"]
