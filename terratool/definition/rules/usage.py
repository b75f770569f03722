"""Rules on names that nothing uses, and on names that are easily mistaken."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule
from terratool.text.display import escape, quote


@rule("TT204", "unused-primitive", "warning")
def unused_primitive(subject: Subject) -> Iterator[Remark]:
    """A primitive is used by no element.

    It may be a leftover, or the element that should use it names another. Elements use primitives
    as their type, and as the under or roof of a deck or a bore. While one of these names is unknown
    (TT201), nothing is said, as this one may be meant there.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "hill": {"x": "cos", "y": []}},
          "elemTree": {"type": "box"}
        }

    Passes:

        {"size": 10, "elemTypes": {"box": {"x": [1]}}, "elemTree": {"type": "box"}}

    To mend: remove it, or use it.
    """
    used = subject.tree.shapes - {UNSET}
    if subject.is_library or not used or used - subject.primitives.keys():
        return
    for name in subject.definition.primitives:
        if name not in used:
            message = f"no element uses the primitive {quote(name)}."
            yield _on_key("elemTypes", name, message, "Remove it, or use it as a type.")


@rule("TT205", "unused-surface", "warning")
def unused_surface(subject: Subject) -> Iterator[Remark]:
    """A surface is worn by no element and no track.

    It may be a leftover, or the element that should wear it names another. While the surface of
    one of them is unknown (TT202), nothing is said, as this one may be meant there.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "surface": "sand"}
        }

    To mend: remove it, or let an element wear it.
    """
    used = subject.tree.worn | {track.surface for track in subject.definition.ruts}
    used -= {UNSET}
    if subject.is_library or used - subject.surfaces.keys():
        return
    used |= subject.tree.shapes  # names in the wrong place, as TT201 reports
    for name in subject.definition.surfaces:
        if name not in used:
            message = f"no element wears the surface {quote(name)}."
            yield _on_key("surfTypes", name, message, "Remove it, or use it as a surface.")


@rule("TT206", "shared-name", "warning")
def shared_name(subject: Subject) -> Iterator[Remark]:
    """One name is both a surface and a primitive.

    That is allowed, but people take the one for the other, and where the one is written in the
    place of the other, it cannot be found out.

    Fails:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"sand": {"x": [1]}},
          "elemTree": {"type": "sand", "surface": "sand"}
        }

    Passes:

        {
          "size": 10,
          "surfTypes": {"sand": {"cohesion": 1.04, "fricAngle": 28, "sinkage": 0.18}},
          "elemTypes": {"dune": {"x": [1]}},
          "elemTree": {"type": "dune", "surface": "sand"}
        }

    To mend: rename one of the two; primitives are shapes, surfaces are materials.
    """
    surfaces = subject.definition.surfaces
    for name in subject.definition.primitives:
        if name in surfaces:
            message = f"{quote(name)} is both a primitive and a surface."
            yield _on_key("elemTypes", name, message, "Rename one of the two.")


@rule("TT207", "similar-names", "warning")
def similar_names(subject: Subject) -> Iterator[Remark]:
    """A name differs from another only by case.

    Names are case-sensitive: sand and Sand are two surfaces, and one is easily written for the
    other. Surfaces and primitives are looked at together.

    Fails:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "Box": {"x": [0, 1]}},
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "type": "Box"}]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {"box": {"x": [1]}, "ramp": {"x": [0, 1]}},
          "elemTree": {"type": "box", "children": [{"cellX": 0, "cellY": 0, "type": "ramp"}]}
        }

    To mend: give one of them a name that says how it differs.
    """
    definition = subject.definition
    seen: dict[str, str] = {}
    for dictionary, names in (
        ("surfTypes", definition.surfaces),
        ("elemTypes", definition.primitives),
    ):
        for name in names:
            other = seen.setdefault(name.casefold(), name)
            if other != name:
                message = f"{quote(name)} differs from {quote(other)} only by case."
                yield _on_key(dictionary, name, message, "Rename one of the two.")


def _on_key(dictionary: str, name: str, message: str, hint: str) -> Remark:
    return Remark(f"/{dictionary}/{escape(name)}", message, hint, on_key=True)
