"""What a data set is, for people and for programs: its README and its Croissant card."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

from postproc.datasets.columns import WAVE
from postproc.signals.sensors import Sensor
from rubhpc.units import typed_quantity

if TYPE_CHECKING:
    from pathlib import Path

    from postproc.datasets.columns import Column
    from postproc.datasets.windows import Windows

_CROISSANT = "http://mlcommons.org/croissant/1.1"
_OF_CROISSANT = (
    "arrayShape citeAs column equivalentProperty extract field fileObject fileProperty fileSet format "
    "includes isArray isLiveDataset jsonPath key md5 parentField path recordSet references regex repeated "
    "replace samplingRate separator source subField transform"
)
_CONTEXT: dict[str, Any] = {
    "@language": "en",
    "@vocab": "https://schema.org/",
    "cr": "http://mlcommons.org/croissant/",
    "dct": "http://purl.org/dc/terms/",
    "sc": "https://schema.org/",
    "rai": "http://mlcommons.org/croissant/RAI/",
    "conformsTo": "dct:conformsTo",
    "data": {"@id": "cr:data", "@type": "@json"},
    "dataType": {"@id": "cr:dataType", "@type": "@vocab"},
    "examples": {"@id": "cr:examples", "@type": "@json"},
    **{name: f"cr:{name}" for name in _OF_CROISSANT.split()},
}
_TYPES = {
    "int64": "sc:Integer",
    "float64": "sc:Float",
    "bool": "sc:Boolean",
    "string": "sc:Text",
    WAVE: "cr:Float32",
}
_VERSION = "1.0.0"  # of the layout of a data set


@dataclass(frozen=True, kw_only=True)
class Made:
    """What a data set is made of."""

    about: dict[str, str]  # title, study, rig, versions and identity of the store
    columns: list[Column]
    windows: Windows
    n_left_out: int  # cases without a result
    files: dict[str, tuple[int, int, int]]  # of each split: cases, windows, and windows with contact


def readme(made: Made) -> str:
    """Return the README of a data set, whose head names the splits for Hugging Face."""
    windows = made.windows
    splits = [f"| {name} | {c} | {w} | {touched} |" for name, (c, w, touched) in made.files.items()]
    columns = [f"| `{c.name}` | {_type_of(c)} | {c.unit} | {c.meaning} |" for c in made.columns]
    return _README.format(
        files="\n".join(f"  - split: {name}\n    path: {name}.parquet" for name in made.files),
        first=next(iter(made.files)),
        title=made.about.get("title", "Rub"),
        rig=json.loads(made.about.get("rig", "{}")).get("name", ""),
        n_sample=windows.n_sample,
        rate=windows.rate,
        duration=typed_quantity(float(f"{windows.n_sample / windows.rate:.4g}"), "s"),
        splits="\n".join(splits),
        n_left_out=made.n_left_out,
        columns="\n".join(columns),
        identity=made.about.get("identity", ""),
        n_draw=windows.n_draw,
        seed=windows.seed,
        sensors="\n".join(_sensors(windows)),
    )


_README = """\
---
configs:
- config_name: default
  data_files:
{files}
---

# {title}

Simulated vibration of the machine `{rig}`, with and without rub between rotor and stator, as sensors see it.
A row is a window of {n_sample} samples at {rate:g} Hz ({duration}). Numbers are in SI units; a missing value
is null.

| split | cases | windows | with contact |
|---|---|---|---|
{splits}

No case is in two splits, nor is a motion: cases that differ only in their start or in the direction of a
sweep are in one, and so are cases without contact that differ only in what acts in contact. Cases left out
because they have no result: {n_left_out}.

## Columns

| column | type | unit | meaning |
|---|---|---|---|
{columns}

`contact` and `window_contact_fraction` are of the window and count any stator. The other labels are of the
whole record of the case, unless their meaning says otherwise, and of the worst of several stators. A case
that is `out_of_range` solves the equations, but beyond what the model describes.

## How it was made

`rubhpc dataset`, from a store with the identity
`{identity}`.
Study, rig and versions are in the metadata of each Parquet file. Signals were filtered for the sampling rate
and sampled by a clock. Of each case (and level of the noise) there are {n_draw} windows, which begin at
random and have noise of their own; the seed is {seed}.

{sensors}

## Reading it

```python
import pandas

windows = pandas.read_parquet("{first}.parquet")

from datasets import load_dataset

windows = load_dataset("path of this directory", split="{first}").with_format("torch")
```

Units and meanings are in the metadata of the columns:
`pyarrow.parquet.read_schema("{first}.parquet").field("start").metadata`. `croissant.json` describes the files
for programs.
"""


def _type_of(column: Column) -> str:
    return "list of float32" if column.kind == WAVE else column.kind


def _sensors(windows: Windows) -> list[str]:
    """A table of what each signal was seen by."""
    if windows.levels:
        levels = ", ".join(f"{level:g}" for level in windows.levels)
        return [
            f"White noise has {levels} times the median rms of a signal in the cases that touch:",
            "",
            "| signal | median rms |",
            "|---|---|",
            *(f"| `{name}` | {size:.6g} |" for name, size in windows.reference.items()),
        ]
    usual = asdict(Sensor())
    rows = []
    for name, sensor in windows.sensors.items():
        words = [f"{key} {value}" for key, value in asdict(sensor).items() if value != usual[key]]
        rows.append(f"| `{name}` | {', '.join(words) or 'ideal'} |")
    return ["| signal | sensor (SI units) |", "|---|---|", *rows]


def croissant(made: Made, folder: Path) -> dict[str, Any]:
    """Return the Croissant card of a data set whose files are in a folder."""
    windows = made.windows
    files, records = [], []
    for name in made.files:
        file = f"{name}.parquet"
        files.append(
            {
                "@type": "cr:FileObject",
                "@id": file,
                "name": file,
                "contentUrl": file,
                "encodingFormat": "application/x-parquet",
                "sha256": hashlib.sha256((folder / file).read_bytes()).hexdigest(),
            }
        )
        described = [_field(column, name, file, windows.n_sample) for column in made.columns]
        records.append({"@type": "cr:RecordSet", "@id": name, "name": name, "field": described})
    return {
        "@context": _CONTEXT,
        "@type": "sc:Dataset",
        "conformsTo": _CROISSANT,
        "name": made.about.get("title", "Rub"),
        "description": "Simulated vibration with and without rub between rotor and stator, in windows of "
        f"{windows.n_sample} samples at {windows.rate:g} Hz; SI units.",
        "version": _VERSION,
        "distribution": files,
        "recordSet": records,
    }


def _field(column: Column, split: str, file: str, n_sample: int) -> dict[str, Any]:
    is_array = {"isArray": True, "arrayShape": str(n_sample)} if column.kind == WAVE else {}
    return {
        "@type": "cr:Field",
        "@id": f"{split}/{column.name}",
        "name": column.name,
        "description": f"{column.meaning} ({column.unit})" if column.unit else column.meaning,
        "dataType": _TYPES[column.kind],
        **is_array,
        "source": {"fileObject": {"@id": file}, "extract": {"column": column.name}},
    }
