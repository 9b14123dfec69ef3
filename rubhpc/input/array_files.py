"""The files of arrays for zarr: only regular ones of format 3, whose metadata and lengths are checked."""

from __future__ import annotations

import asyncio
import math
import re
import stat
from pathlib import Path
from typing import TYPE_CHECKING, Any

from zarr.codecs import BloscCodec, ZstdCodec
from zarr.core.buffer import default_buffer_prototype
from zarr.core.codec_pipeline import BatchedCodecPipeline
from zarr.registry import register_pipeline
from zarr.storage import LocalStore

from rubhpc.errors import StoreError
from rubhpc.input.array_metadata import METADATA, read_metadata, stated_size

if TYPE_CHECKING:
    from collections.abc import Iterable

    from zarr.abc.store import ByteRequest
    from zarr.core.array_spec import ArraySpec
    from zarr.core.buffer import Buffer, BufferPrototype, NDBuffer

_OLD = (".zarray", ".zattrs", ".zgroup", ".zmetadata")  # of format 2, which may name code to be run
_CHUNK = re.compile(r"(^|/)c([/.][\d/.]+)?$")  # the end of the key of a chunk, behind the name of its array


class CheckedPipeline(BatchedCodecPipeline):
    """Reads chunks as zarr does, and reports a damaged one as a StoreError."""

    async def read(self, batch_info: Iterable[Any], out: NDBuffer, drop_axes: tuple[int, ...] = ()) -> None:
        """Read and decode chunks into `out`.

        Raises
        ------
        StoreError
            A chunk is damaged.
        """
        batch = list(batch_info)
        try:
            await super().read(batch, out, drop_axes)
        except (ValueError, RuntimeError, TypeError, ArithmeticError) as error:  # of zarr and its codecs
            where = str(batch[0][0]).removeprefix("file://") if len(batch) == 1 else "a chunk"
            reason = " ".join(str(error).split())
            raise StoreError(f"{where}: is damaged ({reason}); rubhpc verify names its cases") from error

    async def decode_batch(
        self, chunk_bytes_and_specs: Iterable[tuple[Buffer | None, ArraySpec]]
    ) -> Iterable[NDBuffer | None]:
        """Decode chunks, none of which says that it decodes into more than it should.

        Raises
        ------
        ValueError
            One does.
        """
        batch = list(chunk_bytes_and_specs)
        compressors = [kind for kind in map(_compressor, self.bytes_bytes_codecs) if kind]
        for data, spec in batch if compressors else ():
            size = math.prod(spec.shape) * spec.dtype.to_native_dtype().itemsize
            if data is not None and stated_size(compressors[0], data[:32].to_bytes()) != size:
                raise ValueError("a chunk of another size")
        return await super().decode_batch(batch)


def _compressor(codec: object) -> str:
    return {BloscCodec: "blosc", ZstdCodec: "zstd"}.get(type(codec), "")


register_pipeline(CheckedPipeline)
CHECKED = {"codec_pipeline.path": f"{CheckedPipeline.__module__}.{CheckedPipeline.__qualname__}"}


class ArrayFiles(LocalStore):
    """A directory for zarr; a pipe in it is not waited for, and a device is not read.

    Metadata are checked (`rubhpc.input.array_metadata`), those of format 2 are not there, and no file is
    longer than a chunk of its array can be.
    """

    def __init__(self, root: Any, *, read_only: bool = True) -> None:
        super().__init__(Path(root), read_only=read_only)
        self._longest: dict[str, int] = {}  # bytes of a chunk, or a shard, of each array

    async def get(
        self,
        key: str,
        prototype: BufferPrototype | None = None,
        byte_range: ByteRequest | None = None,
    ) -> Buffer | None:
        """The content of a file, or a part of it; None where there is none.

        Raises
        ------
        StoreError
            It is no regular file, or has what no store has.
        """
        path = self.root / key
        if path.name in _OLD:
            return None
        try:
            found = path.stat()
            if path.name == METADATA and stat.S_ISREG(found.st_mode):
                data, longest = await asyncio.to_thread(read_metadata, path, self.root)
                self._longest |= longest
                return (prototype or default_buffer_prototype()).buffer.from_bytes(data)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except OSError as error:
            raise StoreError(f"{path}: cannot be read ({error.strerror}); see rubhpc verify") from error
        if not stat.S_ISREG(found.st_mode):
            raise StoreError(f"{path}: is not a regular file; rubhpc verify names what is damaged")
        if found.st_size > self._longest.get(_CHUNK.sub("", key), 0):
            raise StoreError(f"{path}: is longer than a chunk can be; rubhpc verify names its cases")
        return await super().get(key, prototype, byte_range)
