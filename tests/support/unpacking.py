"""What the report's page does to the data that it carries, in Python: `data.js` is the original."""

from __future__ import annotations

import json
import zlib

import numpy as np

from postproc.report.packing import RATIOS


def unpacked_floats(data: bytes) -> np.ndarray:
    planes = np.frombuffer(zlib.decompress(data), np.uint8)
    return np.ascontiguousarray(planes.reshape(4, -1).T).view("<f4").ravel()


def unpacked_record(data: bytes) -> dict:
    body = zlib.decompress(data)
    length = int.from_bytes(body[:4], "little")
    header = json.loads(body[4 : 4 + length])
    low, high = np.frombuffer(body, np.uint8, offset=4 + length).astype(int).reshape(2, -1)
    codes = low + 256 * high
    for entry in [*header["waves"], *header["spectra"], *header["section"]]:
        own, codes = codes[: entry["n"]], codes[entry["n"] :]
        if "top" in entry:
            entry["values"] = np.where(own > 0, entry["top"] * 10 ** (5 * (own / RATIOS - 1)), 0.0)
        else:
            entry["values"] = entry["low"] + entry["step"] * (
                unbent(own) if entry in header["waves"] else own
            )
    assert codes.size == 0
    return header


def unbent(codes: np.ndarray) -> np.ndarray:
    return np.cumsum(np.cumsum(np.where(codes % 2, -(codes + 1) // 2, codes // 2)))
