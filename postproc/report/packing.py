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
_STEPS = 65535


def pack_floats(values: ArrayLike) -> bytes:
    """Return numbers to four digits (12 bits, single precision), compressed; NaN stays NaN.

    Bytes of equal weight lie together, as zarr's shuffle has them, so that what is alike compresses.
    """
    bits = np.ascontiguousarray(values, dtype="<f4").ravel().view("<u4")
    # Rounding the significand of the largest NaN would make it a zero.
    rounded = np.where(bits & 0x7FFFFFFF > 0x7F800000, 0x7FC00000, bits + 0x400 & 0xFFFFF800).astype("<u4")
    return zlib.compress(rounded.view(np.uint8).reshape(-1, 4).T.tobytes(), 6)


def quantised(values: NDArray[np.floating[Any]]) -> tuple[dict[str, float], NDArray[np.uint16]]:
    """Return values in 65535 equal steps from the lowest to the highest, and what undoes it; n stays n."""
    low, high = float(values.min()), float(values.max())
    step = (high - low) / _STEPS
    codes = np.rint((values.astype(float) - low) / step) if step > 0 else np.zeros(values.shape)
    return {"low": low, "step": step, "n": values.size}, codes.astype("<u2")


def quantised_spectrum(amplitude: NDArray[np.floating[Any]]) -> tuple[dict[str, float], NDArray[np.uint16]]:
    """Return amplitudes in 65535 equal ratios over five decades below the highest, and what undoes it.

    Lower lines are 0; the others keep four digits.
    """
    top = float(amplitude.max(initial=0.0))
    codes = np.zeros(amplitude.shape)
    if top > 0:
        with np.errstate(divide="ignore"):
            codes = np.rint(_STEPS * (1 + np.log10(amplitude.astype(float) / top) / DECADES))
        codes = np.clip(codes, 0, _STEPS)
    return {"top": top, "n": amplitude.size}, codes.astype("<u2")


def pack_record(header: Mapping[str, Any], arrays: Sequence[NDArray[np.uint16]]) -> bytes:
    """Return a header and the arrays it tells of as one compressed record: length, JSON, arrays."""
    text = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)  # the arrays begin at a whole number
    body = b"".join(array.tobytes() for array in arrays)
    return zlib.compress(len(text).to_bytes(4, "little") + text + body, 6)


def as_text(data: bytes) -> str:
    """Return bytes as a page carries them."""
    return base64.b64encode(data).decode()
