"""Numbers as a page carries them: rounded to what is seen, compressed, undone in the browser by `data.js`."""

from __future__ import annotations

import base64
import json
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import ArrayLike, NDArray

DECADES = 5.0  # of a spectrum, below its highest line; what is lower is not carried
STEPS = 65535  # of the range of a section
WAVE_STEPS = 4095  # of the range of a waveform: a figure is some 300 pixels high
RATIOS = 2047  # of a spectrum's decades: half a percent each


def pack_floats(values: ArrayLike) -> bytes:
    """Return numbers to four digits (12 bits, single precision), compressed; NaN stays NaN.

    Bytes of equal weight lie together, as zarr's shuffle has them, so that what is alike compresses.
    """
    with np.errstate(over="ignore"):  # infinite then
        bits = np.ascontiguousarray(values, dtype="<f4").ravel().view("<u4")
    # Rounding the significand of the largest NaN would make it a zero.
    rounded = np.where(bits & 0x7FFFFFFF > 0x7F800000, 0x7FC00000, bits + 0x400 & 0xFFFFF800).astype("<u4")
    return zlib.compress(rounded.view(np.uint8).reshape(-1, 4).T.tobytes(), 6)


def quantised(
    values: NDArray[np.floating[Any]], steps: int = STEPS
) -> tuple[dict[str, float], NDArray[np.uint16]]:
    """Return values in equal steps from the lowest to the highest, and what undoes it; n stays n."""
    low, high = float(values.min()), float(values.max())
    step = (high - low) / steps
    codes = np.rint((values.astype(float) - low) / step) if step > 0 else np.zeros(values.shape)
    return {"low": low, "step": step, "n": values.size}, codes.astype("<u2")


def bends(codes: NDArray[np.uint16]) -> NDArray[np.uint16]:
    """Return the second differences of `WAVE_STEPS`, from 0 on: small numbers where a curve is smooth.

    Negative integers alternate with the others: 0, -1, 1, -2, ...
    """
    second = np.diff(codes.astype(np.int64), n=2, prepend=[0, 0])
    return np.where(second < 0, -2 * second - 1, 2 * second).astype("<u2")


def quantised_spectrum(amplitude: NDArray[np.floating[Any]]) -> tuple[dict[str, float], NDArray[np.uint16]]:
    """Return amplitudes in 2047 equal ratios over five decades below the highest, and what undoes it.

    Lower lines are 0; the others are kept within 0.3 %.
    """
    top = float(amplitude.max(initial=0.0))
    codes = np.zeros(amplitude.shape)
    if top > 0:
        with np.errstate(divide="ignore"):
            codes = np.rint(RATIOS * (1 + np.log10(amplitude.astype(float) / top) / DECADES))
        codes = np.clip(codes, 0, RATIOS)
    return {"top": top, "n": amplitude.size}, codes.astype("<u2")


def pack_record(header: Mapping[str, Any], arrays: Sequence[NDArray[np.uint16]]) -> bytes:
    """Return a header and the arrays it describes as one compressed record.

    It has the header's length, the header as JSON, the low bytes of all arrays and then the high ones.
    """
    text = json.dumps(_shortened(header), separators=(",", ":"), allow_nan=False).encode()
    body = np.concatenate([*arrays, np.empty(0, "<u2")]).astype("<u2").view(np.uint8).reshape(-1, 2).T
    return zlib.compress(len(text).to_bytes(4, "little") + text + body.tobytes(), 9)


def _shortened(header: Any) -> Any:
    """Return the header with its numbers to nine digits."""
    if isinstance(header, float):
        return float(f"{header:.9g}")
    if isinstance(header, dict):
        return {name: _shortened(value) for name, value in header.items()}
    return [_shortened(value) for value in header] if isinstance(header, list | tuple) else header


def as_text(data: bytes) -> str:
    """Return bytes as a page carries them."""
    return base64.b64encode(data).decode()
