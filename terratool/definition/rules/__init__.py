"""Rules: generators of remarks whose docstrings are their manual pages.

A rule is registered by `rule` with its code, a name and a default severity. The runner alone adds
code, severity and position. Codes that only the reader can report (syntax, duplicate keys, types)
are registered by `reader_rule`, so that every code is listed and explained in one place.

Codes: TT1xx the text and its keys, TT2xx names and elements, TT3xx primitives, TT4xx surfaces,
TT5xx vehicles, TT6xx tracks, TT7xx libraries, parts, free places and copies, TT8xx grids of
training tiles, TT9xx sensors.
"""

from __future__ import annotations

from terratool.definition.rules import (  # noqa: F401, importing them registers their rules
    curricula,
    curves,
    decks,
    files,
    free,
    grids,
    hiding,
    libraries,
    names,
    parts,
    placement,
    presence,
    reading,
    scales,
    scatter,
    sensors,
    shapes,
    steps,
    storeys,
    surfaces,
    tracks,
    trimming,
    unseen,
    usage,
    vehicle_gear,
    vehicle_geometry,
    vehicle_limits,
    vehicle_wheels,
)
from terratool.definition.rules.base import Rule, registry

RULES: dict[str, Rule] = dict(sorted(registry.items()))
"""Rules by code, in the order of the codes."""
