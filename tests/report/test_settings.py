"""How a study was set, in words and units."""

import json
from dataclasses import asdict

from postproc.report.facts import setting_rows
from rubhpc.study.drive_keys import DriveKeys
from rubhpc.study.tables import Integrator, Recording


def test_numbers_have_the_units_of_their_keys():
    probe = {"name": "left", "node": 1, "angle": -0.7853981633974483, "quantity": "displacement"}
    study = {
        "run_up": {"start": 125.66370614359172, "stop": None, "time": 20.0, "law": []},
        "contact": {"law": "penalty", "stiffness": 4e5, "damping": 30.0},
        "integrator": {"method": "modal", "step": 2e-6},
        "record": {
            "revolutions": 64,
            "samples_per_revolution": 128,
            "keep": ["waveform", "spectrum", "section"],
            "probe": [probe],
        },
    }
    assert dict(setting_rows(study)) == {
        "Run-up": "start 1200 rpm, time 20 s",
        "Contact": "law penalty, stiffness 400 kN m⁻¹, damping 30 N s/m",
        "Integrator": "method modal, step 2 µs",
        "Record": "samples per revolution 128, keep waveform, "
        "probe (name left, node 1, angle -45°, quantity displacement)",
    }


def test_laws_are_read_point_by_point_and_lists_as_sentences():
    law = [[0.0, 31.41592653589793], [10.0, 314.1592653589793]]
    assert setting_rows({"run_up": {"law": law}}) == [("Run-up", "law 300 rpm at 0 s and 3000 rpm at 10 s")]
    record = {"revolutions": 64, "keep": ["waveform", "spectrum"]}  # at constant speeds
    assert setting_rows({"record": record}) == [("Record", "revolutions 64, keep waveform and spectrum")]


def test_every_table_that_a_store_holds_is_read():
    tables = {
        "drive": DriveKeys(torque=(2.0,), inertia=0.01, start=10.0, revolutions=60),
        "integrator": Integrator(),
        "record": Recording(),
    }
    rows = dict(setting_rows({name: json.loads(json.dumps(asdict(table))) for name, table in tables.items()}))
    assert rows["Drive"].startswith("torque")
    assert "2 N m" in rows["Drive"]
    assert rows["Integrator"].startswith("method modal")
