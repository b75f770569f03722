"""Rules: each is a generator of remarks; its docstring is its manual page.

A rule is registered by `rule` with its code, a name and a default severity. The runner alone adds
code, severity and position. What only the reader can see (syntax, duplicate keys, types) is
registered by `reader_rule`, so that every code is listed and explained in one place.

Codes: TT1xx the text and its keys, TT2xx names and elements, TT3xx primitives, TT4xx surfaces,
TT5xx vehicles, TT6xx tracks.
"""

from __future__ import annotations

from collections.abc import Callable, Container, Iterator, Mapping
from functools import cache, cached_property
from importlib import import_module
from inspect import cleandoc

from msgspec import UNSET, Struct

from terratool.definition.curves import CurveError, problems
from terratool.definition.findings import Remark, Severity
from terratool.definition.model import Definition
from terratool.definition.summaries import ShapeSummary, summarise_shape
from terratool.definition.tree import Owner, Tree
from terratool.definition.vehicle import AxleText, VehicleText

_MODULES = (
    "reading", "files", "presence", "names", "usage", "placement", "hiding", "steps", "curves",
    "shapes", "surfaces", "vehicle_geometry", "vehicle_limits", "tracks",
)  # fmt: skip


class Subject(Struct, frozen=True, dict=True):
    """What a rule looks at.

    Attributes:
        definition: the model, without the values that did not fit.
        tree: its elements laid flat.
        unfit: of each key the owners whose value was left out; "" is for the owner itself.
        size: bytes of the text.
        packed: whether they came from gzip.
        max_step: height of a step from which on it is remarked on; None for no limit.
    """

    definition: Definition
    tree: Tree
    unfit: Mapping[str, Container[Owner]] = {}
    size: int = 0
    packed: bool = False
    max_step: float | None = None

    def left_out(self, owner: Owner, *keys: str) -> bool:
        """Whether one of these values of an object, or all of it, did not fit."""
        return bool(self.unfit) and any(owner in self.unfit.get(key, ()) for key in ("", *keys))

    @cached_property
    def flaws(self) -> dict[str, tuple[CurveError, ...]]:
        """What is wrong with the curves of primitives, by name; none of those that are good."""
        found = ((name, problems(p)) for name, p in self.definition.primitives.items())
        return {name: flaws for name, flaws in found if flaws}

    @cached_property
    def outlines(self) -> dict[str, ShapeSummary]:
        """What the curves of primitives are like, by name; none of those that mean nothing."""
        primitives = self.definition.primitives.items()
        return {name: summarise_shape(p) for name, p in primitives if name not in self.flaws}


class VehicleSubject(Struct, frozen=True, dict=True):
    """What a rule about vehicles looks at.

    Attributes:
        vehicle: the model, without the values that did not fit.
        unfit: of each key the owners whose value was left out; "" is for the owner itself.
    """

    vehicle: VehicleText
    unfit: Mapping[str, Container[Owner]] = {}

    def left_out(self, owner: Owner, *keys: str) -> bool:
        """Whether one of these values of an object, or all of it, did not fit."""
        return any(owner in self.unfit.get(key, ()) for key in ("", *keys))

    @cached_property
    def axles(self) -> tuple[AxleText, ...]:
        """The axles in document order, each with an x; none if not all of them are known."""
        axles = self.vehicle.all_axles
        known = not self.left_out("", "axles", "wheelbase") and not any(
            axle.x is UNSET or self.left_out(f"/axles/{index}", "wheels", "driven")
            for index, axle in enumerate(axles)
        )
        return axles if known else ()


Check = Callable[[Subject], Iterator[Remark]]
VehicleCheck = Callable[[VehicleSubject], Iterator[Remark]]


class Rule(Struct, frozen=True):
    """A code, its name, default severity and manual page, and the generator behind it.

    Attributes:
        check: of terrains; None if there is none.
        vehicle_check: of vehicles, likewise.
    """

    code: str
    name: str
    severity: Severity
    manual: str
    check: Check | None = None
    vehicle_check: VehicleCheck | None = None

    @property
    def summary(self) -> str:
        """The first sentence of the manual page."""
        return self.manual.partition("\n\n")[0].replace("\n", " ")


_rules: dict[str, Rule] = {}


def rule(code: str, name: str, severity: Severity = "error") -> Callable[[Check], Check]:
    """Register a generator as a rule."""

    def register(check: Check) -> Check:
        _rules[code] = Rule(code, name, severity, cleandoc(check.__doc__ or ""), check)
        return check

    return register


def vehicle_rule(
    code: str, name: str, severity: Severity = "error"
) -> Callable[[VehicleCheck], VehicleCheck]:
    """Register a generator as a rule about vehicles."""

    def register(check: VehicleCheck) -> VehicleCheck:
        manual = cleandoc(check.__doc__ or "")
        _rules[code] = Rule(code, name, severity, manual, vehicle_check=check)
        return check

    return register


def reader_rule(code: str, name: str, manual: str, severity: Severity = "error") -> None:
    """Register a code that the reader itself reports."""
    _rules[code] = Rule(code, name, severity, cleandoc(manual))


@cache
def all_rules() -> dict[str, Rule]:
    """Every rule by its code, in the order of the codes."""
    for module in _MODULES:
        import_module(f"{__name__}.{module}")
    return dict(sorted(_rules.items()))
