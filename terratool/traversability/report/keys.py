"""Conversion of members of results to keys of JSON: names, units, and nulls."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from msgspec import Struct, UnsetType

from terratool.report.documents import one_of
from terratool.report.numbers import exact
from terratool.traversability.verdicts import Reason, Verdict

Kind = TypeVar("Kind", bound=Struct)


class ResultMember(NamedTuple):
    """Member of a result that a key of JSON is made of, and the conversion.

    Attributes:
        member: name of the member; empty where it is that of the key without its unit.
        unit: unit at the end of the key's name; empty for none.
        factor: factor from the SI unit to this one.
        codes: enumeration whose codes an array has; None for none.
    """

    member: str = ""
    unit: str = ""
    factor: float = 1.0
    codes: type[Verdict | Reason] | None = None


DEG = 180.0 / math.pi
"""Degrees in a radian."""

Text = str | None
"""Text, or null where it is empty."""
Metres = Annotated[float, ResultMember(unit="m")]
SquareMetres = Annotated[float, ResultMember(unit="m2")]
MetresPerSecond = Annotated[float, ResultMember(unit="m_s")]
MetresPerSquareSecond = Annotated[float, ResultMember(unit="m_s2")]
MetresPerKilonewton = Annotated[float, ResultMember(unit="m_per_kN", factor=1e3)]
Kilograms = Annotated[float, ResultMember(unit="kg")]
Seconds = Annotated[float, ResultMember(unit="s")]
Joules = Annotated[float, ResultMember(unit="J")]
WattHours = Annotated[float, ResultMember(unit="Wh", factor=1.0 / 3600.0)]
Watts = Annotated[float, ResultMember(unit="W")]
Newtons = Annotated[float, ResultMember(unit="N")]
NewtonMetres = Annotated[float, ResultMember(unit="Nm")]
Kilopascals = Annotated[float, ResultMember(unit="kPa", factor=1e-3)]
Degrees = Annotated[float, ResultMember(unit="deg", factor=DEG)]
Numbers = tuple[float | None, ...]
"""Numbers, each null where it is not known or means nothing."""
ManyMetres = Annotated[Numbers, ResultMember(unit="m")]
ManyDegrees = Annotated[Numbers, ResultMember(unit="deg", factor=DEG)]
VerdictText = Annotated[str, one_of(verdict.label for verdict in Verdict)]
ReasonText = Annotated[str, one_of(reason.label for reason in Reason if reason != Reason.NONE)]
Binding = Annotated[ReasonText | None, ResultMember("reason")]


def fill_keys(kind: type[Kind], record: object) -> Kind:
    """Make a record of JSON keys from a result."""
    found: dict[str, Any] = {}
    for one in sources_of(kind):
        value = value_of(getattr(record, one.member), one.of, one.nested, one.kept)
        if value is not None or not one.optional:
            found[one.key] = value
    return kind(**found)


class KeySource(NamedTuple):
    """Source of a key.

    Attributes:
        key: name of the key.
        member: name of the result's member.
        of: conversion of the member.
        nested: type of the records that the member becomes; None for plain values.
        kept: whether an empty text stays one, rather than null.
        optional: whether the key is left out where the member is None.
    """

    key: str
    member: str
    of: ResultMember
    nested: type[Struct] | None
    kept: bool
    optional: bool


@cache
def sources_of(kind: type[Struct]) -> tuple[KeySource, ...]:
    """Sources of the keys of a record."""
    found = []
    for key, hint in get_type_hints(kind, include_extras=True).items():
        parts = list(_parts(hint))
        of = next((one for one in parts if isinstance(one, ResultMember)), ResultMember())
        nested = (one for one in parts if isinstance(one, type) and issubclass(one, Struct))
        member = of.member or (key.removesuffix(f"_{of.unit}") if of.unit else key)
        found.append(
            KeySource(key, member, of, next(nested, None), hint is str, UnsetType in parts)
        )
    return tuple(found)


def _parts(hint: Any) -> Iterator[Any]:
    """Yield a type and all types that it is made of."""
    yield hint
    for one in get_args(hint):
        yield from _parts(one)


_AS_IT_IS = ResultMember()


def value_of(
    value: Any, of: ResultMember = _AS_IT_IS, nested: type[Struct] | None = None, kept: bool = False
) -> Any:
    """Value for JSON: None for an empty text, for `Reason.NONE`, and for NaN and infinity.

    Floating-point numbers have twelve digits, as further ones come from factors of units alone.
    """
    if isinstance(value, float):
        return exact(value * of.factor)
    if isinstance(value, str):
        return value if value or kept else None
    if isinstance(value, Verdict):
        return value.label
    if isinstance(value, Reason):
        return None if value == Reason.NONE else value.label
    if isinstance(value, np.ndarray):
        value = tuple(map(of.codes, value.tolist()) if of.codes else value.tolist())
    if isinstance(value, tuple):
        return tuple(value_of(each, of, nested, kept) for each in value)
    return value if value is None or nested is None else fill_keys(nested, value)
