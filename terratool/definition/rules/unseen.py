"""Rules on decks and bores that change nothing, as far as many points show."""

from __future__ import annotations

from collections.abc import Iterator

from terratool.definition.findings import Remark
from terratool.definition.rules.base import Subject, rule, storeys_of


@rule("TT223", "buried-deck", "note")
def buried_deck(subject: Subject) -> Iterator[Remark]:
    """A deck lies wholly within the ground, so that nothing of it is seen.

    The heights of the compiled terrain are looked at, at up to 33 × 33 points of the deck and in
    the middle of each element on it, so a small corner may be overlooked. Ground is all that is
    solid there, other decks included. Of a deck in a part, and of one that stands for several, all
    places count together. Terrains of more than 65,536 elements, libraries by themselves, and texts
    with errors are not looked at.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "vScale": 3, "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 2,
            "deck": {"thickness": 0.5, "datum": true}
          }]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "vScale": 3, "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 2, "deck": {"thickness": 0.5}
          }]}
        }

    To mend: raise the deck, or remove it. Where it counts from 0, by datum, it may be meant to
    count from the ground.
    """
    yield from _unseen(
        subject,
        "deck",
        "the deck lies within the ground: nothing of it is seen at any of {count:,} points.",
        (
            "Raise it, or remove it.",
            'Raise it, or leave out "datum" to have it count from the ground.',
        ),
    )


@rule("TT224", "idle-bore", "note")
def idle_bore(subject: Subject) -> Iterator[Remark]:
    """A bore meets no ground, so that it takes nothing away.

    It may lie above the ground, or where the ground is void. Points are those of TT223.

    Fails:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "vScale": 3, "children": [
            {"cellX": 2, "cellY": 1, "type": "box", "vScale": 1, "bore": {"height": 2}}
          ]}
        }

    Passes:

        {
          "size": 10, "elemTypes": {"box": {"x": [1]}},
          "elemTree": {"type": "box", "vScale": 3, "children": [{
            "cellX": 2, "cellY": 1, "type": "box", "vScale": 1,
            "bore": {"height": 1.5, "datum": true}
          }]}
        }

    To mend: lower the bore, or remove it. Without datum its floor counts from the ground, so a
    vScale above 0 lifts it out of that.
    """
    yield from _unseen(
        subject,
        "bore",
        "the bore meets no ground: it takes nothing away at any of {count:,} points.",
        ('Lower it, or add "datum" to have it count from 0.', "Lower it, or remove it."),
    )


def _unseen(subject: Subject, kind: str, message: str, hints: tuple[str, str]) -> Iterator[Remark]:
    """Yield a remark on each deck or each bore that is nowhere met; the second hint is of datum."""
    found = {one.pointer: one.points for one in subject.unseen}
    for index, key, storey in storeys_of(subject.tree) if found else ():
        count = found.get(subject.tree.pointer(index), 0)
        if key == kind and count:
            hint, said = hints[storey.datum is True], message.format(count=count)
            yield Remark(f"/{key}", said, hint, on_key=True, element=index)
