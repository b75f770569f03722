"""What all results come to: one verdict, and one sentence that says what binds."""

from __future__ import annotations

from collections.abc import Sequence

from terratool.traversability.reporting import wording
from terratool.traversability.results import MapSummary, Reason, Route, Verdict

_RANK = {Verdict.GO: 0, Verdict.CAUTION: 1, Verdict.UNKNOWN: 2, Verdict.NO_GO: 3}
"""Of routes, from the best to the worst."""


def verdict_of(summary: MapSummary, routes: Sequence[Route]) -> Verdict:
    """The verdict of the worst route; without one, of the ground by its best headings.

    That is go where all of the ground is, no-go where nothing is better than that, unknown where
    nothing is better than that, and caution in between. Where it would stand over the edge of the
    terrain, nothing is said of the ground; that counts only where there is nothing else.
    """
    if routes:
        return max((route.verdict for route in routes), key=_RANK.__getitem__)
    counts = {verdict: count for verdict, count in summary.counts.items() if count}
    inner = counts.get(Verdict.NO_GO, 0) - summary.reasons.get(Reason.EDGE, 0)
    if inner <= 0 and counts.keys() - {Verdict.NO_GO}:
        counts.pop(Verdict.NO_GO, None)
    if len(counts) == 1:
        return next(iter(counts))
    if counts.get(Verdict.GO) or counts.get(Verdict.CAUTION):
        return Verdict.CAUTION
    return Verdict.UNKNOWN if not counts else Verdict.NO_GO


def sentence_of(summary: MapSummary, routes: Sequence[Route]) -> str:
    """The verdict for people, and what binds most."""
    if routes:
        worst = max(routes, key=lambda route: _RANK[route.verdict])
        line = wording.route_line(worst)
        return f"{line} {worst.note}" if worst.note else line
    if not summary.pixels:
        return "There is no ground to drive on."
    go, caution, no_go, unknown = (
        summary.fraction(verdict)
        for verdict in (Verdict.GO, Verdict.CAUTION, Verdict.NO_GO, Verdict.UNKNOWN)
    )
    known = {reason: count for reason, count in summary.reasons.items() if reason != Reason.NONE}
    rim = ""
    if known.keys() == {Reason.EDGE} and not caution:
        edge = wording.share(no_go)
        rim = f", but for the edge of the terrain, on {edge}, where the vehicle would stand over it"
    if go == 1.0 or (rim and go and not unknown):
        return f"All of the ground is go, with the best heading at each place{rim}."
    if unknown == 1.0 or (rim and unknown and not go):
        return f"Nothing is known of the ground: its surfaces lack what the formulas need{rim}."
    parts = [f"{wording.share(go)} of the ground is go"]
    parts += [f"{wording.share(caution)} caution"] if caution else []
    parts += [f"{wording.share(no_go)} no-go"] if no_go else []
    parts += [f"{wording.share(unknown)} unknown"] if unknown else []
    text = f"{', '.join(parts[:-1])} and {parts[-1]}" if parts[1:] else parts[0]
    if not known:
        return f"{text}."
    most = max(known, key=lambda reason: (known[reason], -reason))
    part = wording.share(known[most] / summary.pixels)
    return f"{text}; what binds most is {most.label}, on {part}."
