"""Structs of arrays and numbers that kernels receive by reference.

Numba passes a named tuple by value: one of 30 arrays is 300 words at every call. A `Struct` is one pointer,
to words that Python has filled in: the address, shape and strides of an array, or a number. Python owns the
arrays, so kernels count no references to them.
"""

from __future__ import annotations

import struct
from array import array
from inspect import Parameter, Signature
from typing import TYPE_CHECKING, Any, Self, dataclass_transform

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    NativeValue,
    infer_getattr,
    lower_builtin,
    lower_getattr_generic,
    models,
    register_model,
    type_callable,
    unbox,
)
from numba.np.arrayobj import populate_array

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

_WORD = ir.IntType(64)


class StructType(types.Type):
    """Numba's type of a `Struct`: its class, and the types of its fields."""

    def __init__(self, of: type[Struct], kinds: tuple[types.Type, ...]) -> None:
        super().__init__(name=f"{of.__module__}.{of.__name__}({','.join(map(_short, kinds))})")
        self.of, self.kinds = of, dict(zip(of._fields, kinds, strict=True))
        sizes = [1 + 2 * kind.ndim if isinstance(kind, types.Array) else 1 for kind in kinds]
        self.place = dict(zip(of._fields, np.cumsum([0, *sizes]).tolist(), strict=False))
        self.n_word = sum(sizes)


register_model(StructType)(models.OpaqueModel)


def _short(kind: types.Type) -> str:
    """Name of a field's type, as part of the names of all functions that take the struct."""
    if not isinstance(kind, types.Array):
        return str(kind)
    return f"{kind.dtype}:{kind.ndim}{kind.layout}{'' if kind.mutable else 'r'}"


@dataclass_transform(frozen_default=True)
class Struct:
    """Base of what kernels receive by reference: arrays, numbers and other structs, which stay as they are.

    The contents of the arrays may change. A subclass declares its fields as a `NamedTuple` does. Kernels may
    make one from the values of all fields; it lasts as long as the function that made it.
    """

    _fields: tuple[str, ...]
    _defaults: dict[str, Any]

    def __init_subclass__(cls) -> None:
        cls._fields = tuple(cls.__annotations__)
        cls._defaults = {name: cls.__dict__[name] for name in cls._fields if name in cls.__dict__}
        _define_constructor(cls)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        values = self._defaults | dict(zip(self._fields, args, strict=False)) | kwargs
        if values.keys() != set(self._fields) or len(args) + len(kwargs) > len(values):
            raise TypeError(f"{type(self).__name__} takes {', '.join(self._fields)}")
        self.__dict__.update(values)

    def __setattr__(self, name: str, value: object) -> None:
        raise AttributeError(f"{type(self).__name__}.{name} cannot be changed; use _replace")

    def __iter__(self) -> Iterator[Any]:
        return (self.__dict__[name] for name in self._fields)

    def __reduce__(self) -> Any:
        return type(self), tuple(self)

    @classmethod
    def _make(cls, values: Iterable[Any]) -> Self:
        return cls(*values)

    def _asdict(self) -> dict[str, Any]:
        return {name: self.__dict__[name] for name in self._fields}

    def _replace(self, **changes: Any) -> Self:
        return type(self)(**(self._asdict() | changes))

    @property
    def _numba_type_(self) -> StructType:
        """Its type, which numba asks for at each call."""
        if "_type" not in self.__dict__:
            self.__dict__["_type"] = _type_of(self)
        found: StructType = self.__dict__["_type"]
        return found

    @property
    def _address(self) -> int:
        """Address of its words, which last as long as it does."""
        if "_words" not in self.__dict__:
            self.__dict__["_words"] = array("q", [word for value in self for word in _words_of(value)])
        words: array[int] = self.__dict__["_words"]
        return words.buffer_info()[0]


_types: dict[Any, StructType] = {}  # known, by classes and kinds of values: numba takes 3 us for each array


def _type_of(held: Struct) -> StructType:
    key = type(held), tuple(map(_kind_of, held))
    if key not in _types:
        kinds = tuple(map(numba.typeof, held))
        for name, kind in zip(held._fields, kinds, strict=True):
            if not isinstance(kind, (types.Array, types.Float, types.Integer, types.Boolean, StructType)):
                raise TypeError(f"{type(held).__name__}.{name} is {kind}: no array, number or struct")
        _types[key] = StructType(type(held), kinds)
    return _types[key]


def _kind_of(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return (
            value.dtype,
            value.ndim,
            value.flags.c_contiguous,
            value.flags.f_contiguous,
            value.flags.writeable,
        )
    return value._numba_type_ if isinstance(value, Struct) else type(value)


def _words_of(value: Any) -> tuple[int, ...]:
    if isinstance(value, np.ndarray):
        return (value.__array_interface__["data"][0], *value.shape, *value.strides)
    if isinstance(value, Struct):
        return (value._address,)
    if isinstance(value, float | np.floating):
        return struct.unpack("q", struct.pack("d", value))
    return (int(value),)


@unbox(StructType)
def _unbox(typ: StructType, held: Any, c: Any) -> NativeValue:
    value = cgutils.alloca_once(c.builder, cgutils.voidptr_t, zfill=True)
    address = c.pyapi.object_getattr_string(held, "_address")
    with c.builder.if_then(cgutils.is_not_null(c.builder, address)):  # Ctrl-C may end what finds it
        c.builder.store(c.pyapi.long_as_voidptr(address), value)
        c.pyapi.decref(address)
    return NativeValue(c.builder.load(value), is_error=c.pyapi.c_api_error())


@infer_getattr
class _Fields(AttributeTemplate):
    key = StructType

    def generic_resolve(self, value: StructType, attr: str) -> Any:  # type: ignore[override]
        return value.kinds.get(attr)


@lower_getattr_generic(StructType)
def _read(context: Any, builder: Any, typ: StructType, value: Any, name: str) -> Any:
    kind, place = typ.kinds[name], typ.place[name]
    words = builder.bitcast(value, _WORD.as_pointer())

    def load(i: int, of: Any) -> Any:
        return builder.load(builder.bitcast(builder.gep(words, [_WORD(place + i)]), of.as_pointer()))

    if isinstance(kind, types.Boolean):
        return builder.icmp_signed("!=", load(0, _WORD), _WORD(0))
    if not isinstance(kind, types.Array):
        return load(0, context.get_value_type(kind))
    made = context.make_array(kind)(context, builder)
    item = context.get_data_type(kind.dtype)
    populate_array(
        made,
        data=load(0, item.as_pointer()),
        shape=[load(1 + i, _WORD) for i in range(kind.ndim)],
        strides=[load(1 + kind.ndim + i, _WORD) for i in range(kind.ndim)],
        itemsize=context.get_constant(types.intp, context.get_abi_sizeof(item)),
        meminfo=None,
    )
    return made._getvalue()


def _define_constructor(cls: type[Struct]) -> None:
    """Let kernels make a struct, in the frame of the function that does."""

    @type_callable(cls)
    def _typer(context: Any) -> Any:
        def typed(*args: types.Type, **kwargs: types.Type) -> StructType:
            values = dict(zip(cls._fields, args, strict=False)) | kwargs
            return StructType(cls, tuple(types.unliteral(values[name]) for name in cls._fields))

        names = [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in cls._fields]
        typed.__signature__ = Signature(names)  # type: ignore[attr-defined]
        return typed

    @lower_builtin(cls, types.VarArg(types.Any))
    def _make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        typ = sig.return_type
        with builder.goto_entry_block():
            words = builder.alloca(_WORD, size=_WORD(typ.n_word))
        for (name, kind), given, arg in zip(typ.kinds.items(), sig.args, args, strict=True):
            value = context.cast(builder, arg, given, kind)
            if isinstance(kind, types.Array):
                held = context.make_array(kind)(context, builder, value)
                sizes = [
                    builder.extract_value(of, i)
                    for of in (held.shape, held.strides)
                    for i in range(kind.ndim)
                ]
                filled = [held.data, *sizes]
            else:
                filled = [builder.zext(value, _WORD) if isinstance(kind, types.Boolean) else value]
            for i, word in enumerate(filled):
                at = builder.gep(words, [_WORD(typ.place[name] + i)])
                builder.store(word, builder.bitcast(at, word.type.as_pointer()))
        return builder.bitcast(words, context.get_value_type(typ))
