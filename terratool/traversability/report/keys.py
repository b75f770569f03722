"""Keys of JSON made of members of results: their names, their units, and what is null."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Annotated, Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from msgspec import Struct, UnsetType

from terratool.report.numbers import exact
from terratool.traversability.results import Reason, Verdict

Kind = TypeVar("Kind", bound=Struct)


class Of(NamedTuple):
    """How a key is made of a member of a result.

    Attributes:
        member: its name; empty where it is called as the key without its unit.
        unit: of the key, at its end; empty where it has none.
        factor: of the unit, from SI units.
        codes: the enumeration whose codes an array has.
    """

    member: str = ""
    unit: str = ""
    factor: float = 1.0
    codes: type[Verdict | Reason] | None = None


DEG = 180.0 / math.pi
"""Degrees in a radian."""

Text = str | None
"""A text, or null where it is empty."""
Number = float | None
"""A number, or null where it is not known, means nothing or has no limit."""
Metres = Annotated[Number, Of(unit="m")]
SquareMetres = Annotated[Number, Of(unit="m2")]
MetresPerSecond = Annotated[Number, Of(unit="m_s")]
MetresPerSquareSecond = Annotated[Number, Of(unit="m_s2")]
MetresPerKilonewton = Annotated[Number, Of(unit="m_per_kN", factor=1e3)]
Kilograms = Annotated[Number, Of(unit="kg")]
Seconds = Annotated[Number, Of(unit="s")]
Joules = Annotated[Number, Of(unit="J")]
Watts = Annotated[Number, Of(unit="W")]
Newtons = Annotated[Number, Of(unit="N")]
NewtonMetres = Annotated[Number, Of(unit="Nm")]
Kilopascals = Annotated[Number, Of(unit="kPa", factor=1e-3)]
Degrees = Annotated[Number, Of(unit="deg", factor=DEG)]
Numbers = tuple[float | None, ...]
ManyMetres = Annotated[Numbers, Of(unit="m")]
ManyDegrees = Annotated[Numbers, Of(unit="deg", factor=DEG)]
Binding = Annotated[Text, Of("reason")]


def filled(kind: type[Kind], record: object) -> Kind:
    """The keys of a result."""
    found: dict[str, Any] = {}
    for one in _sources(kind):
        value = value_of(getattr(record, one.member), one.of, one.nested, one.kept)
        if value is not None or not one.optional:
            found[one.key] = value
    return kind(**found)


class _Source(NamedTuple):
    """Where a key comes from.

    Attributes:
        key: its name.
        member: of the result.
        of: how the key is made of it.
        nested: the kind of the records that it has.
        kept: whether an empty text is one.
        optional: whether the key is left out where there is nothing.
    """

    key: str
    member: str
    of: Of
    nested: type[Struct] | None
    kept: bool
    optional: bool


@cache
def _sources(kind: type[Struct]) -> tuple[_Source, ...]:
    found = []
    for key, hint in get_type_hints(kind, include_extras=True).items():
        parts = list(_parts(hint))
        of = next((one for one in parts if isinstance(one, Of)), Of())
        nested = (one for one in parts if isinstance(one, type) and issubclass(one, Struct))
        member = of.member or (key.removesuffix(f"_{of.unit}") if of.unit else key)
        found.append(_Source(key, member, of, next(nested, None), hint is str, UnsetType in parts))
    return tuple(found)


def _parts(hint: Any) -> Iterator[Any]:
    """A type, and all that it is made of."""
    yield hint
    for one in get_args(hint):
        yield from _parts(one)


_AS_IT_IS = Of()


def value_of(
    value: Any, of: Of = _AS_IT_IS, nested: type[Struct] | None = None, kept: bool = False
) -> Any:
    """A value for JSON: None for an empty text, for no reason, and for what is not finite.

    Floating-point numbers have twelve digits: none that only come from factors of units.
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
    return value if value is None or nested is None else filled(nested, value)
