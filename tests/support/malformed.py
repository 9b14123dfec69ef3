"""Studies that must be refused: what is wrong with each, and what the one line about it has to say.

Each is a good study, or a good rig, with one edit.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import rubhpc

STUDY = """\
title = "Good"
rig = "own.toml"
output = "good.zarr"

[grid]
speed_ratio = [0.75, 1.5]
clearance_ratio = 0.70
friction = 0.3

[override]
"stator.length" = "41 mm"

[contact]
law = "lagrange"

[integrator]
step = "0.4 us"

[record]
revolutions = 16

[run]
block = 4
"""
RIG = (Path(rubhpc.__file__).parent / "rigs" / "mokhtar2017.toml").read_text()


@dataclass(frozen=True)
class Malformed:
    """A study file and its rig file; `says` are fragments of the message."""

    name: str
    says: tuple[str, ...]
    study: bytes = STUDY.encode()
    rig: bytes = RIG.encode()

    def write(self, folder: Path) -> Path:
        """Write both files; return the study's path."""
        (folder / "own.toml").write_bytes(self.rig)
        study = folder / "study.toml"
        study.write_bytes(self.study)
        return study


def _edited(text: str, old: str, new: str) -> bytes:
    assert text.count(old) >= 1, old
    return text.replace(old, new, 1).encode()


def _study(name: str, old: str, new: str, *says: str) -> Malformed:
    return Malformed(name, ("study.toml", *says), study=_edited(STUDY, old, new))


def _rig(name: str, old: str, new: str, *says: str) -> Malformed:
    return Malformed(name, ("own.toml", *says), rig=_edited(RIG, old, new))


_SPEED = "speed_ratio = [0.75, 1.5]"
_GAP = "clearance_ratio = 0.70"
_FRICTION = "friction = 0.3"

_SECTION = RIG[RIG.index("[[rotor.shaft]]") : RIG.index("[[rotor.disc]]")]

# Numbers that overflow in the matrices, or take minutes and gigabytes.
_EXTREME = [
    *(
        _rig(f"{old} as {new}", old, new, *says)
        for old, new, *says in [
            ('"0.8 m"', "8e147", "[rotor.shaft.1] length: 8e+147 is out of range", "1e+30"),
            ('"0.8 m"', '"8e147 m"', '[rotor.shaft.1] length: "8e147 m" is out of range'),
            ("density = 7800.0", "density = 5e-324", "density: 5e-324 is out of range"),
            ('"40 mm"', '"1.8e138 mm"', "[stator.1] length:", "is out of range"),
            ('"40 mm"', "5e-324", "[stator.1] length:", "is out of range"),
            ("elements = 6", "elements = 999", "[stator.1] elements: 999 is out of range", "at most 200"),
        ]
    ),
    _rig(
        "shaft of many sections",
        "[[rotor.disc]]",
        f"{_SECTION.replace('= 14', '= 190')}[[rotor.disc]]",
        "[rotor] shaft: 204 elements are too many",
    ),
    _study("speed past the floats", _SPEED, "speed_ratio = 1e300", "speed_ratio: 1e+300 is out of range"),
    _study("an axis past memory", _FRICTION, "friction = { start = 0, stop = 1, num = 10000000 }", "num"),
    _study(
        "more axes than dimensions",
        _FRICTION,
        "\n".join([_FRICTION, *(f'"rotor.x{i}" = 1' for i in range(40))]),
        "[grid]: 43 axes are too many",
    ),
    _study("output the root", '"good.zarr"', '"/"', 'output: "/" does not name a store'),
    _study("output the folder itself", '"good.zarr"', '"./"', 'output: "." does not name a store'),
    _study("a key that colours", _FRICTION, '"\\u001b[31mx" = 1', r"[grid] \x1b[31mx: unknown axis"),
    _rig("a key that turns the line", "angle = 0.0", '"\\u202ex" = 1', r"[stator.1] \u202ex: unknown key"),
]

CASES = [
    *_EXTREME,
    # the file
    Malformed("empty file", ("study.toml", "rig: missing"), study=b""),
    Malformed("not UTF-8", ("study.toml: line 1", "UTF-8"), study=b'title = "\xff"\n'),
    Malformed("null byte", ("study.toml: line 1, column",), study=b'title = "a\x00b"\n'),
    _study("no equals sign", _FRICTION, "friction 0.3", "line 8, column 10", "not TOML"),
    _study("string left open", 'title = "Good"', 'title = "Good', "line 1, column"),
    _study("key given twice", _FRICTION, f"{_FRICTION}\n{_FRICTION}", "line 9, column"),
    _study("table given twice", "[run]", "[grid]", "line 22, column"),
    _study("list left open", _SPEED, "speed_ratio = [0.75", "line 7, column"),
    _study("deep lists", _SPEED, f"speed_ratio = {'[' * 5000}", "nested too deeply"),
    _study("huge integer", _FRICTION, f"friction = {'9' * 5000}", "too long"),
    # the top level
    _study("unknown table", "[record]", "[recording]", "recording: unknown key; did you mean record?"),
    _study("unknown key", 'title = "Good"', 'titel = "Good"', "titel: unknown key; did you mean title?"),
    _study("title of two lines", '"Good"', '"a\\nb"', "title:"),
    _study("title a number", '"Good"', "3", "title: 3 is not a line of text"),
    _study("output empty", '"good.zarr"', '""', "output:"),
    _study("no rig", 'rig = "own.toml"', "", "rig: missing", "mokhtar2017"),
    _study("unknown rig", '"own.toml"', '"mokhtar2018"', "rig:", "did you mean mokhtar2017?"),
    _study("rig file missing", '"own.toml"', '"other.toml"', "rig:", "other.toml: no such file"),
    _study("rig a folder", '"own.toml"', '"."', "not a file"),
    _study("rig a device", '"own.toml"', '"/dev/zero"', "/dev/zero: not a file"),
    _study("rig with a null byte", '"own.toml"', '"a\\u0000b"', "rig:"),
    _study("rig a table", 'rig = "own.toml"', "rig.name = 1", "rig: {'name': 1} is not a line of text"),
    _study("grid a number", "[grid]", "[grids]", "grids: unknown key; did you mean grid?"),
    # the grid
    _study(
        "unknown axis", _FRICTION, "frction = 0.3", "[grid] frction: unknown axis; did you mean friction?"
    ),
    _study("no friction", _FRICTION, "", "[grid] friction: missing"),
    _study("no speed", _SPEED, "", "[grid] speed_ratio: missing", "speed"),
    _study("no clearance", _GAP, "", "[grid] clearance_ratio: missing", "clearance"),
    _study("two speeds", _SPEED, f"{_SPEED}\nspeed = 100", "[grid] speed: conflicts with speed_ratio"),
    _study("two clearances", _GAP, f"{_GAP}\nclearance = 1e-4", "[grid] clearance: conflicts with"),
    _study("axis empty", _FRICTION, "friction = []", "[grid] friction: empty"),
    _study("value twice", _FRICTION, "friction = [0.1, 0.3, 0.1]", "[grid] friction: 0.1 is duplicated"),
    _study(
        "value twice, units apart",
        _FRICTION,
        'friction = [0.1, "10 %"]',
        "[grid] friction: 0.1 is duplicated",
    ),
    _study("not a number", _FRICTION, "friction = nan", "[grid] friction: nan is not finite"),
    _study("infinite", _SPEED, "speed_ratio = [1, inf]", "[grid] speed_ratio: inf is not finite"),
    _study("true for a number", _FRICTION, "friction = true", "[grid] friction: true is not a number"),
    _study("date for a number", _FRICTION, "friction = 2017-01-01", "[grid] friction:", "not a number"),
    _study("list in a list", _FRICTION, "friction = [[0.1]]", "[grid] friction: [0.1] is not a number"),
    _study("number too large", _FRICTION, f"friction = {'9' * 400}", "[grid] friction:", "not finite"),
    _study("wrong unit", _FRICTION, 'friction = "3 mm"', '[grid] friction: "3 mm" is not a plain number'),
    _study("unit on a ratio", _SPEED, 'speed_ratio = "30 Hz"', "[grid] speed_ratio:", "30 Hz"),
    _study("speed in metres", _SPEED, 'speed = "3 m/s"', "[grid] speed:", "rad/s"),
    _study("speed in minutes", _SPEED, 'speed = "3000 1/min"', "[grid] speed:", '"3000 rpm"', '"50 rad/s"'),
    _study("speed in hertz", _SPEED, 'speed = { start = "50 Hz", stop = 9, num = 2 }', "start: ", "rpm"),
    _study("no unit in text", _GAP, 'clearance = "100"', '[grid] clearance: "100" has no unit'),
    _study("unknown unit", _GAP, 'clearance = "100 microns_"', "[grid] clearance: unknown unit", "um"),
    _study(
        "code for a number", _GAP, "clearance = \"__import__('os')\"", "[grid] clearance:", "not a number"
    ),
    _study(
        "tower of powers", _GAP, 'clearance = "9**9**9 m"', "[grid] clearance:", "not a number with a unit"
    ),
    _study("negative friction", _FRICTION, "friction = [0.1, -0.1]", "[grid] friction: -0.1", "at least 0"),
    _study("no share left", _GAP, "clearance_ratio = 0.0", "[grid] clearance_ratio: 0", "above 0"),
    _study("standstill", _SPEED, "speed_ratio = [0, 1]", "[grid] speed_ratio: 0 is not a valid speed"),
    _study(
        "range without stop", _SPEED, "speed_ratio = { start = 1, step = 1 }", "[grid] speed_ratio:", "stop"
    ),
    _study("range with a slip", _SPEED, "speed_ratio = { start = 1, stop = 2, stp = 1 }", "did you mean st"),
    _study(
        "range both ways", _SPEED, "speed_ratio = { start = 1, stop = 2, step = 1, num = 2 }", "step or num"
    ),
    _study(
        "range neither way", _SPEED, "speed_ratio = { start = 1, stop = 2 }", "[grid] speed_ratio:", "num"
    ),
    _study("range backwards", _SPEED, "speed_ratio = { start = 2, stop = 1, step = 0.1 }", "does not lead"),
    _study("range of no step", _SPEED, "speed_ratio = { start = 1, stop = 2, step = 0 }", "does not lead"),
    _study("range without end", _SPEED, "speed_ratio = { start = 1, stop = 2, step = 1e-12 }", "too many"),
    _study("range of one", _SPEED, "speed_ratio = { start = 1, stop = 2, num = 1 }", "num 1"),
    _study("half a value", _SPEED, "speed_ratio = { start = 1, stop = 2, num = 2.5 }", "num 2.5"),
    _study(
        "logarithm of zero",
        _FRICTION,
        'friction = { start = 0, stop = 1, num = 3, scale = "log" }',
        "above 0",
    ),
    _study("unknown scale", _SPEED, 'speed_ratio = { start = 1, stop = 2, num = 3, scale = "dB" }', '"log"'),
    _study(
        "unknown rig key", _FRICTION, f'{_FRICTION}\n"stator.lenght" = 0.04', "did you mean stator.length?"
    ),
    _study("table for a key", _FRICTION, f'{_FRICTION}\n"rotor.damping" = 1', "rotor.damping: is a table"),
    _study("third stator", _FRICTION, f'{_FRICTION}\n"stator.3.angle" = 1', "[grid] stator.3.angle:"),
    _study(
        "axis makes no rig", _FRICTION, f'{_FRICTION}\n"stator.node" = [8, 16]', "stator.node = 16", "1 to 15"
    ),
    _study("half an element", _FRICTION, f'{_FRICTION}\n"stator.elements" = [6.5]', "stator.elements: 6.5"),
    _study(
        "axis that a store has",
        _FRICTION,
        f'{_FRICTION}\n"stator.lateral" = [true, false]',
        "stator.1.lateral",
    ),
    _study(
        "axes over each other",
        _FRICTION,
        f'{_FRICTION}\n"stator.angle" = [0, 1]\n"stator.1.angle" = [0, 1]',
        "[grid] stator.1.angle: is also set by the axis stator.angle",
    ),
    _study(
        "axis twice",
        _FRICTION,
        f'{_FRICTION}\n"stator.angle" = 0\nstator.angle = 1',
        "stator.angle: is duplicated",
    ),
    # the other tables
    _study("override unknown", "stator.length", "stator.lengths", "[override] stator.lengths: unknown key"),
    _study("override of length", "41 mm", "41 s", '[override] stator.length: "41 s" is not in m'),
    _study("override below zero", "41 mm", "-41 mm", "[override] stator.1.length: -0.041 m", "above 0"),
    _study(
        "override of an axis",
        _FRICTION,
        f'{_FRICTION}\n"stator.length" = 0.04',
        "[override] stator.length: is also an axis",
    ),
    _study("unknown law", '"lagrange"', '"herz"', '[contact] law: "herz"', '"lagrange"', '"penalty"'),
    _study("penalty without stiffness", '"lagrange"', '"penalty"', "[contact] stiffness: missing"),
    _study("multiplier with stiffness", '"lagrange"', '"lagrange"\nstiffness = 1e6', "[contact] stiffness:"),
    _study(
        "penalty with restitution",
        '"lagrange"',
        '"penalty"\nstiffness = 1e6\nrestitution = 0.5',
        "[contact] restitution:",
        "leave it out",
    ),
    _study("too much restitution", '"lagrange"', '"lagrange"\nrestitution = 1.5', "at most 1"),
    _study("unknown friction law", 'law = "lagrange"', 'friction_law = "dry"', "friction_law:", "coulomb"),
    _study(
        "friction at rest while sliding",
        'law = "lagrange"',
        'friction_law = "sliding"\nstatic_friction_ratio = 1.2',
        "[contact] static_friction_ratio:",
        '"coulomb"',
    ),
    _study("unknown normal", 'law = "lagrange"', 'normal = "bent"', "[contact] normal:", "fixed", "updated"),
    _study(
        "unknown integrator",
        'step = "0.4 us"',
        'method = "modle"',
        "[integrator] method:",
        "modal",
        "central-difference",
    ),
    _study("step in metres", "0.4 us", "0.4 um", "[integrator] step:", "not in s"),
    _study("no step", '"0.4 us"', "0.0", "[integrator] step: 0 s", "at least"),
    _study("a step of 1e-12 s", '"0.4 us"', "1e-12", "[integrator] step: ", "at least"),
    _study(
        "record unknown",
        "revolutions",
        "revolution",
        "[record] revolution: unknown key; did you mean revolutions?",
    ),
    _study("no revolution", "revolutions = 16", "revolutions = 0", "[record] revolutions: 0", "at least 1"),
    _study("half a revolution", "revolutions = 16", "revolutions = 16.5", "[record] revolutions: 16.5"),
    _study(
        "count in quotes", "revolutions = 16", 'revolutions = "16"', "[record] revolutions:", "whole number"
    ),
    _study(
        "odd samples", "revolutions = 16", "samples_per_revolution = 33", "samples_per_revolution: 33 is odd"
    ),
    _study(
        "few samples", "revolutions = 16", "samples_per_revolution = 8", "[record] samples_per_revolution: 8"
    ),
    _study("keep unknown", "revolutions = 16", 'keep = ["waveforms"]', "[record] keep:", '"waveform"'),
    _study("keep twice", "revolutions = 16", 'keep = ["section", "section"]', "[record] keep:", "duplicated"),
    _study("keep a word", "revolutions = 16", 'keep = "section"', "[record] keep:", "not a list"),
    _study("transient below zero", "revolutions = 16", "transient = -1", "[record] transient: -1"),
    _study("no block", "block = 4", "block = 0", "[run] block: 0"),
    _study("time without unit", "block = 4", 'time_limit = "2"', "[run] time_limit:", "no unit"),
    _study("run a list", "[run]\nblock = 4", "[[run]]\nblock = 4", "[run]", "not a table"),
    # the rig
    _rig("rig not TOML", "node = 8", "node = ", "own.toml: line"),
    _rig(
        "rig key unknown",
        'thickness = "0.03 m"',
        'thicknes = "0.03 m"',
        "[rotor.disc.1] thicknes",
        "thickness?",
    ),
    _rig("rig key missing", 'length = "0.8 m"', "", "[rotor.shaft.1] length: missing"),
    _rig("rig without name", 'name = "mokhtar2017"', "", "name: missing"),
    _rig("shaft of no length", '"0.8 m"', '"0 m"', "[rotor.shaft.1] length: 0 m"),
    _rig(
        "shaft all bore", "inner_diameter = 0.0", 'inner_diameter = "20 mm"', "[rotor.shaft.1] inner_diameter"
    ),
    _rig("no element", "elements = 14", "elements = 0", "[rotor.shaft.1] elements: 0"),
    _rig("elements past memory", "elements = 14", "elements = 100000000", "[rotor.shaft.1] elements"),
    _rig("shaft in one bracket", "[[rotor.shaft]]", "[rotor.shaft]", "[rotor] shaft:", "[[rotor.shaft]]"),
    _rig("modulus in metres", "210 GPa", "210 mm", "[rotor.shaft.1] youngs_modulus", "Pa"),
    _rig(
        "disc off the shaft",
        "[[rotor.disc]]                     # solid, over the shaft: 2.646 kg\nnode = 8",
        "[[rotor.disc]]\nnode = 80",
        "[rotor.disc.1] node: 80",
    ),
    _rig(
        "disc both ways", 'thickness = "0.03 m"', 'thickness = "0.03 m"\nmass = 3', "[rotor.disc.1] thickness"
    ),
    _rig("disc half reported", 'thickness = "0.03 m"', "", "[rotor.disc.1] thickness: missing"),
    _rig("bearing both ways", "stiffness = 1e6", "stiffness = 1e6\nkyy = 1e6", "[rotor.bearing.1] kyy"),
    _rig("bearing of nothing", "stiffness = 1e6", "kyy = 1e6", "[rotor.bearing.1] kzz: missing"),
    _rig("node zero", "node = 15", "node = 0", "[rotor.bearing.2] node: 0"),
    _rig("torsion both ways", "fixed_node = 1 ", "stiffness = 1\nfixed_node = 1 ", "[rotor.torsion]"),
    _rig("torsion untold", "fixed_node = 1 ", "node = 1 ", "[rotor.torsion] fixed_node: missing"),
    _rig("damping both ways", "beta = 0.0", "ratios = { 31.56 = 0.08 }", "[rotor.damping] ratios"),
    _rig(
        "damping at no frequency",
        "alpha = 31.7 ",
        "ratios = { here = 0.08 } #",
        "[rotor.damping.ratios] here",
    ),
    _rig("damping over critical", "alpha = 31.7 ", "ratios = { 31.56 = 8 } #", "[rotor.damping] ratios: 8"),
    _rig(
        "rubber",
        "poissons_ratio = 0.3",
        "poissons_ratio = 0.5",
        "[stator.1] poissons_ratio: 0.5",
        "below 0.5",
    ),
    _rig("stator in the air", "angle = 0.0", "angle = 0.0\nlength = 1", "own.toml: line"),
    _rig(
        "stator without rim",
        "[[stator]]                         # acrylic cantilever\nnode = 8",
        "[[stator]]\nnode = 7",
        "[stator.1] radius: missing",
    ),
    _rig("lateral in quotes", "lateral = true", 'lateral = "yes"', "[stator.1] lateral:", "true nor false"),
    _rig("stator as text", "elements = 6", 'elements = "six"', '[stator.1] elements: "six"'),
    Malformed(
        "no stator",
        ("study.toml", "mokhtar2017 has no stator", "[[stator]]"),
        study=_edited(STUDY, '"stator.length" = "41 mm"', ""),
        rig=RIG[: RIG.index("[[stator]]")].encode(),
    ),
    Malformed(
        "no unbalance",
        ("study.toml", "[grid] clearance_ratio", "unbalance"),
        rig=_edited(RIG, 'mass = "8 g"', "mass = 0"),
    ),
    Malformed(
        "offset closes the gap of a wall",
        ("study.toml", "[grid] clearance", "clearance_offset"),
        study=b'rig = "own.toml"\n[grid]\nspeed = 100\nclearance = "0.1 mm"\nfriction = 0.1',
        rig=f'{RIG}\n[[stator]]\nnode = 8\nangle = 3\nrigid = true\nclearance_offset = "-0.2 mm"'.encode(),
    ),
]
