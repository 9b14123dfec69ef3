"""The files of a store for zarr: those that are checked, with waiting blocks in their shards."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

import numpy as np
from zarr.abc.store import RangeByteRequest, SuffixByteRequest
from zarr.core.buffer import default_buffer_prototype

from rubhpc.errors import StoreError
from rubhpc.input.array_files import ArrayFiles
from rubhpc.storage import layout
from rubhpc.storage.block_files import ABSENT, BlockFiles, encode_index
from rubhpc.storage.manifest import Manifest

if TYPE_CHECKING:
    from zarr.abc.store import ByteRequest
    from zarr.core.buffer import Buffer, BufferPrototype

    from rubhpc.schema import Variable

_ADDRESS = 40  # bits: what lies at a position of a shard with waiting blocks begins at (position + 1) << 40


class RegularFiles(ArrayFiles):
    """The files of a store for zarr (`rubhpc.input.array_files`), with waiting blocks in their shards.

    Of a shard for which blocks are waiting, zarr is given an index of addresses that stand for positions:
    each chunk is then read from where it is at that moment.
    """

    def __init__(self, root: Any, *, read_only: bool = True) -> None:
        super().__init__(root, read_only=read_only)
        self._blocks: BlockFiles | None = None
        self._variables: dict[str, Variable] = {}
        try:
            manifest = Manifest.read(self.root)
        except StoreError:  # a copy made by other tools, or a single array
            return
        if manifest.shard:
            self._blocks = BlockFiles(self.root, manifest)
            self._variables = {variable.name: variable for variable in manifest.variables}
            self._most = {
                v.name: layout.most_bytes(v.dtype, (*manifest.chunk, *manifest.extent(v)))
                for v in manifest.variables
            }

    @property
    def has_waiting_blocks(self) -> bool:
        """Whether blocks are waiting to be packed, which no other reader sees."""
        return self._blocks is not None and self._blocks.folder.is_dir()

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
            It is no regular file.
        """
        name, _, place = key.partition("/c.")
        if place and name in self._variables:
            is_address = isinstance(byte_range, RangeByteRequest) and byte_range.start >> _ADDRESS
            if is_address or self.has_waiting_blocks:
                data = await asyncio.to_thread(self._shard, self._variables[name], place, byte_range)
                prototype = prototype or default_buffer_prototype()
                return None if data is None else prototype.buffer.from_bytes(data)
        return await super().get(key, prototype, byte_range)

    def _shard(self, variable: Variable, key: str, byte_range: ByteRequest | None) -> bytes | None:
        """A shard or a part of it; None where it has no chunk."""
        assert self._blocks is not None
        blocks, most = self._blocks, self._most[variable.name]
        shard = tuple(map(int, key.split(".")))[: -len(variable.dims) or None]
        if isinstance(byte_range, SuffixByteRequest):
            index = np.full((blocks.n_inner, 2), ABSENT, "<u8")
            for i in range(blocks.n_inner):
                if size := blocks.size(variable, blocks.chunk_at(shard, i)):
                    index[i] = (i + 1) << _ADDRESS, size
            return encode_index(index) if (index[:, 1] != ABSENT).any() else None
        if isinstance(byte_range, RangeByteRequest):
            place = blocks.chunk_at(shard, (byte_range.start >> _ADDRESS) - 1)
            return blocks.read(variable, place, most)
        return blocks.compose(variable, shard, most) or None
