"""Rules on the keys of decks and bores: what stands over other ground, or is cut through it."""

from __future__ import annotations

from collections.abc import Iterator

from msgspec import UNSET

from terratool.definition.findings import Remark
from terratool.definition.model import FACE_KEYS, FACES, GAPS, STOREYS
from terratool.definition.rules.base import Subject, faces_of, rule, storeys_of
from terratool.definition.tree import ROOT, Tree
from terratool.text.display import escape, quote


@rule("TT215", "root-storey")
def root_storey(subject: Subject) -> Iterator[Remark]:
    """The root is a deck or a bore, but it is the ground of the whole terrain.

    The root of a part may be one: it stands in a cell of something else.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "deck": {"thickness": 0.3}}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.3}}
          ]}
        }

    To mend: remove the key, or put the deck or the bore into a cell of the ground.
    """
    root = subject.tree.root_at.get(ROOT)
    for key in STOREYS if root is not None else ():
        if subject.tree.value(key, root or 0) is not UNSET:
            yield Remark(
                f"/{key}",
                f"the root is a {key}, though it is the ground of the whole terrain.",
                f'Remove "{key}", or put the {key} into a cell of the ground.',
                on_key=True,
                element=root or 0,
            )


@rule("TT216", "deck-and-bore")
def deck_and_bore(subject: Subject) -> Iterator[Remark]:
    """An element is a deck and a bore at once.

    A deck stands over other ground, and a bore is cut through it.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 3,
            "deck": {"thickness": 0.3}, "bore": {"height": 2}
          }]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"thickness": 0.3}}
          ]}
        }

    To mend: remove one of the two, or write a second element in the same cell.
    """
    tree = subject.tree
    for index, _ in tree.elements_with("bore", tree.distinct("bore") - {UNSET}):
        if tree.value("deck", index) is not UNSET:
            yield Remark(
                "/bore",
                'the element has both "deck" and "bore".',
                "Remove one of the two, or write two elements.",
                on_key=True,
                element=index,
            )


@rule("TT217", "other-face")
def other_face(subject: Subject) -> Iterator[Remark]:
    """The other face of a deck or a bore is given in no way, or in two.

    A deck has a thickness, or a primitive for its underside, under. A bore has a height, or a
    primitive for its ceiling, roof.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {}}
          ]}
        }

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}, "vault": {"y": "dome"}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": -5,
            "bore": {"height": 2, "roof": "vault"}
          }]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}, "vault": {"y": "dome"}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": -5,
            "bore": {"roof": "vault", "vScale": 2, "vOffset": -3}
          }]}
        }

    To mend: write one of the two.
    """
    for index, key, storey in storeys_of(subject.tree):
        gap, face = GAPS[type(storey)], FACES[type(storey)]
        if storey.gap is UNSET and storey.face is UNSET:
            yield Remark(
                f"/{key}",
                f'the {key} has neither "{gap}" nor "{face}".',
                f'Add "{gap}", or "{face}" with the name of a primitive.',
                element=index,
            )
        elif storey.gap is not UNSET and storey.face is not UNSET:
            yield Remark(
                f"/{key}/{face}",
                f'the {key} has both "{gap}" and "{face}".',
                "Remove one of the two.",
                on_key=True,
                element=index,
            )


@rule("TT218", "idle-face-height")
def idle_face_height(subject: Subject) -> Iterator[Remark]:
    """A deck or a bore has a vScale or vOffset, but no primitive that they are of.

    Within a deck they are the numbers of under, and within a bore those of roof. The heights of the
    element's own surface are those beside deck or bore.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "deck": {"thickness": 0.3, "vOffset": 3}}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vOffset": 3, "deck": {"thickness": 0.3}}
          ]}
        }

    To mend: move the number out of the deck or bore, or give the other face a primitive.
    """
    for index, key, storey in storeys_of(subject.tree):
        if storey.face is not UNSET or storey.gap is UNSET:  # TT217 reports a missing face
            continue
        for number, attribute in FACE_KEYS.items():
            if getattr(storey, attribute) is not UNSET:
                face = FACES[type(storey)]
                yield Remark(
                    f"/{key}/{number}",
                    f'"{number}" in "{key}" is that of "{face}", which is not there.',
                    f'Write it beside "{key}" for the element itself, or add "{face}".',
                    on_key=True,
                    element=index,
                )


@rule("TT219", "radial-face")
def radial_face(subject: Subject) -> Iterator[Remark]:
    """One face of a deck or a bore is radial, and the other is not.

    Both have one footprint: the disc of a radial primitive, or the rectangle of any other.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}, "cup": {"x": "dome", "combine": "radial"}},
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 3, "deck": {"under": "cup"}
          }]}
        }

    Passes:

        {
          "size": 10,
          "elemTypes": {
            "box": {"x": [1]}, "cup": {"x": "dome", "combine": "radial"},
            "disc": {"x": [1], "combine": "radial"}
          },
          "elemTree": {"type": "box", "children": [{
            "cellX": 2, "cellY": 1, "type": "disc", "vScale": 3, "deck": {"under": "cup"}
          }]}
        }

    To mend: let both primitives be radial, or none of them.
    """
    found = _unlike_faces(subject, subject.tree)
    for index, pointer, name, is_round in found:
        message = f"the element is radial, and {quote(name)} is not."
        if is_round:
            message = f"{quote(name)} is radial, and the element is not."
        yield Remark(pointer, message, "Let both be radial, or none of them.", element=index)
    if not subject.uses.has_root or subject.uses.circles:
        return
    for name in subject.uses.parts_in_use:  # a name of the terrain may hide that of a library
        root = subject.uses.part(name)
        own = root.home is subject.document
        if own or not any(_unlike_faces(subject, root.tree, root.element)):
            continue
        leading = subject.uses.parts_leading_to(lambda one, root=root: one == root)  # type: ignore[misc]
        user = next(u for u in subject.uses.within(subject.uses.root) if u.part in leading)
        yield Remark(
            "/part",
            f"with names of this file, one face in the part {quote(name)} is radial, and the other "
            "is not.",
            "Rename the primitive that hides that of the library.",
            element=user.element,
        )


def _unlike_faces(
    subject: Subject, tree: Tree, root: int | None = None
) -> Iterator[tuple[int, str, str, bool]]:
    """Yield the element, pointer, name and roundness of faces that are unlike the element."""
    for index, pointer, name in faces_of(tree):
        if root is not None and tree.root_of[index] != root:
            continue
        own, other = (subject.primitives.get(one) for one in (tree.value("type", index), name))
        if own is None or other is None:
            continue
        is_round = other.combine == "radial"
        known = not any(
            subject.left_out(f"/elemTypes/{escape(str(one))}", "combine")
            for one in (tree.value("type", index), name)
        )
        if known and is_round != (own.combine == "radial"):
            yield index, pointer, name, is_round
