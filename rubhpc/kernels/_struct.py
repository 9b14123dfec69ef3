"""Structs of arrays and numbers that kernels receive by reference.

Numba passes a named tuple by value: one of 30 arrays is 300 words at every call. A `Struct` is one pointer, to
words that Python has filled in: the address, shape and strides of an array, or a number. Python owns the
arrays, so kernels count no references to them.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Iterable, Iterator
from inspect import Parameter, Signature
from typing import Any, Self, dataclass_transform

import numba
import numpy as np
from llvmlite import ir
from numba import types
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

_WORD = ir.IntType(64)


class StructType(types.Type):  # type: ignore[misc]
    """Numba's type of a `Struct`: its class, and the types of its fields."""

    def __init__(self, of: type[Struct], kinds: tuple[types.Type, ...]) -> None:
        super().__init__(name=f"{of.__module__}.{of.__name__}({','.join(map(_short, kinds))})")
        self.of, self.kinds = of, dict(zip(of._fields, kinds, strict=True))
        sizes = [1 + 2 * kind.ndim if isinstance(kind, types.Array) else 1 for kind in kinds]
        self.place = dict(zip(of._fields, np.cumsum([0, *sizes]).tolist(), strict=False))
        self.n_word = sum(sizes)


def _short(kind: types.Type) -> str:
    """Name of a field's type; those of the functions that take it contain it."""
    if not isinstance(kind, types.Array):
        return str(kind)
    return f"{kind.dtype}:{kind.ndim}{kind.layout}{'' if kind.mutable else 'r'}"


register_model(StructType)(models.OpaqueModel)


@dataclass_transform(frozen_default=True)
class Struct:
    """Base of what kernels receive by reference: arrays, numbers and other structs, which stay as they are.

    The contents of arrays may change. A subclass declares its fields as a `NamedTuple` does.
    """

    _fields: tuple[str, ...]
    _defaults: dict[str, Any]
    invariant = True

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
        found = self.__dict__.get("_type")
        if found is None:
            found = self.__dict__["_type"] = _type_of(type(self), tuple(map(_kind_key, self)), tuple(self))
        return found  # type: ignore[no-any-return]

    @property
    def _address(self) -> int:
        words = self.__dict__.get("_words")
        if words is None:
            words = self.__dict__["_words"] = array("q", [w for value in self for w in _words_of(value)])
        return words.buffer_info()[0]  # type: ignore[no-any-return]


_types: dict[Any, StructType] = {}


def _kind_key(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.dtype, value.ndim, value.flags.c_contiguous, value.flags.writeable
    return value._numba_type_ if isinstance(value, Struct) else type(value)


def _type_of(of: type[Struct], keys: tuple[Any, ...], values: tuple[Any, ...]) -> StructType:
    found = _types.get((of, keys))
    if found is None:
        kinds = tuple(numba.typeof(value) for value in values)
        for name, kind in zip(of._fields, kinds, strict=True):
            if not isinstance(kind, (types.Array, types.Float, types.Integer, types.Boolean, StructType)):
                raise TypeError(f"{of.__name__}.{name} is {kind}, not an array, a number or a struct")
        found = _types[of, keys] = StructType(of, kinds)
    return found


def _words_of(value: Any) -> tuple[int, ...]:
    if isinstance(value, np.ndarray):
        return (value.ctypes.data, *value.shape, *value.strides)
    if isinstance(value, Struct):
        return (value._address,)
    if isinstance(value, (float, np.floating)):
        return struct.unpack("q", struct.pack("d", value))
    return (int(value),)


@unbox(StructType)
def _unbox(typ: StructType, held: Any, c: Any) -> NativeValue:
    address = c.pyapi.object_getattr_string(held, "_address")
    value = c.pyapi.long_as_voidptr(address)
    c.pyapi.decref(address)
    return NativeValue(value, is_error=c.pyapi.c_api_error())


@infer_getattr
class _Fields(AttributeTemplate):  # type: ignore[misc]
    key = StructType

    def generic_resolve(self, typ: StructType, name: str) -> Any:
        return typ.kinds.get(name)


@lower_getattr_generic(StructType)
def _read(context: Any, builder: Any, typ: StructType, value: Any, name: str) -> Any:
    kind, place = typ.kinds[name], typ.place[name]
    words = builder.bitcast(value, _WORD.as_pointer())

    def load(i: int, as_type: Any = None) -> Any:
        at = builder.gep(words, [_WORD(place + i)])
        if as_type is not None:
            at = builder.bitcast(at, as_type.as_pointer())
        found = builder.load(at)
        if typ.of.invariant:
            found.set_metadata("invariant.load", builder.module.add_metadata([]))
        return found

    as_value = context.get_value_type(kind)
    if isinstance(kind, types.Boolean):
        return builder.icmp_signed("!=", load(0), _WORD(0))
    if not isinstance(kind, types.Array):
        return load(0, as_value)
    n, item = kind.ndim, context.get_data_type(kind.dtype)
    made = context.make_array(kind)(context, builder)
    populate_array(
        made,
        data=load(0, item.as_pointer()),
        shape=[load(1 + i) for i in range(n)],
        strides=[load(1 + n + i) for i in range(n)],
        itemsize=context.get_constant(types.intp, context.get_abi_sizeof(item)),
        meminfo=None,
    )
    return made._getvalue()


def _define_constructor(cls: type[Struct]) -> None:
    """Let kernels make a struct, which lasts as long as the function that makes it."""

    @type_callable(cls)
    def _type(context: Any) -> Any:
        def typed(*args: types.Type) -> StructType:
            return StructType(cls, tuple(map(types.unliteral, args)))

        names = [Parameter(name, Parameter.POSITIONAL_OR_KEYWORD) for name in cls._fields]
        typed.__signature__ = Signature(names)  # type: ignore[attr-defined]
        return typed

    @lower_builtin(cls, types.VarArg(types.Any))
    def _make(context: Any, builder: Any, sig: Any, args: Any) -> Any:
        typ = sig.return_type
        entry = builder.goto_entry_block()
        with entry:
            words = builder.alloca(_WORD, size=_WORD(typ.n_word))
        for (name, kind), given, value in zip(typ.kinds.items(), sig.args, args, strict=True):
            place = typ.place[name]
            value = context.cast(builder, value, given, kind)

            def store(i: int, what: Any) -> None:
                at = builder.gep(words, [_WORD(place + i)])
                builder.store(what, builder.bitcast(at, what.type.as_pointer()))

            if isinstance(kind, types.Array):
                made = context.make_array(kind)(context, builder, value)
                store(0, made.data)
                for i, size in enumerate([*_unpack(builder, made.shape), *_unpack(builder, made.strides)]):
                    store(1 + i, size)
            elif isinstance(kind, types.Boolean):
                store(0, builder.zext(value, _WORD))
            else:
                store(0, value)
        return builder.bitcast(words, context.get_value_type(typ))


def _unpack(builder: Any, tuple_: Any) -> list[Any]:
    return [builder.extract_value(tuple_, i) for i in range(tuple_.type.count)]
