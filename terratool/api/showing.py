"""Terrains as they show themselves: a few lines, and in notebooks a table with a picture."""

from __future__ import annotations

import base64
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING

from terratool.errors import RequestError
from terratool.field.coarse import reads_all
from terratool.field.summary import height_range
from terratool.field.terrain import Terrain
from terratool.io.crs import shown_crs
from terratool.report.numbers import without_noise
from terratool.report.wording import count_of, decks_and_bores, join_words
from terratool.text.display import printable

if TYPE_CHECKING:
    from terratool.viewing.options import RenderOptions

_NAMED = 12
"""Most surfaces that are listed by name."""
_SIZE, _DPI = 560, 110.0
"""Longer side of the picture in a notebook, pixels, and its pixels per inch."""


class ShownTerrain(Terrain):
    """A terrain that says what it is, in a terminal and in a notebook."""

    @cached_property
    def relief(self) -> tuple[float, float] | None:
        """Lowest and highest height, of many points; None where all is void, or too much."""
        low, high, _ = height_range(self)
        return None if low is None or high is None else (low, high)

    @property
    def _no_relief(self) -> str:
        return "none, all is void" if reads_all(self) else "not looked at, a raster is too large"

    @property
    def _storeys_fact(self) -> dict[str, str]:
        """Numbers of decks and bores in words, by their title; empty for none."""
        own = self.storeys
        return {} if own is None else {"storeys": decks_and_bores(own.decks, own.bores)}

    @property
    def facts(self) -> dict[str, str]:
        """Size, elements, surfaces, relief and reference system, each in words."""
        from terratool.viewing.plan import unit_of

        unit, relief = unit_of(self), self.relief
        names = [printable(name) for name in self.surfaces]
        if len(names) > _NAMED:
            names[_NAMED - 1 :] = [f"{len(names) - _NAMED + 1:,} more"]
        return {
            "size": f"{_sides(self)} {unit}",
            "elements": f"{self.all_elements:,}",
            **self._storeys_fact,
            "surfaces": join_words(names) or "none",
            "relief": _range(relief, unit) if relief is not None else self._no_relief,
            "crs": "none" if self.crs is None else printable(shown_crs(self.crs).strip('"')),
        }

    def __repr__(self) -> str:
        descr = f": {printable(self.descr)}" if self.descr else ""
        return f"<Terrain of {_sides(self)}, {count_of(self.all_elements, 'element')}{descr}>"

    def __str__(self) -> str:
        lines = [f"{name:<10}{text}" for name, text in self.facts.items()]
        return "\n".join([printable(self.descr)] * bool(self.descr) + lines)

    def _repr_html_(self) -> str:
        """Table and small picture, for notebooks; the table alone without Matplotlib."""
        rows = "".join(
            f"<tr><th style='text-align: left'>{name}</th>"
            f"<td style='text-align: left'>{escape(text)}</td></tr>"
            for name, text in self.facts.items()
        )
        title = f"<b>{escape(printable(self.descr))}</b>" if self.descr else ""
        picture, png = "", self._picture
        if png is not None:
            data = base64.b64encode(png).decode("ascii")
            picture = f'<img alt="plan of the terrain" src="data:image/png;base64,{data}"/>'
        return f"<div>{title}<table>{rows}</table>{picture}</div>"

    def _repr_png_(self) -> bytes | None:
        """Small picture, for notebooks; None without Matplotlib."""
        return self._picture

    @cached_property
    def _picture(self) -> bytes | None:
        """PNG of a plan, drawn when it is first asked for; None where it cannot be drawn."""
        from terratool.viewing.render import png_of

        try:
            return png_of(self, _small())
        except RequestError:
            return None


def _small() -> RenderOptions:
    """Options of the picture in a notebook."""
    from terratool.viewing.options import RenderOptions

    return RenderOptions(pixels=_SIZE, dpi=_DPI, title="")


def _sides(terrain: Terrain) -> str:
    """Sides of a terrain in words."""
    return " × ".join(f"{side:.6g}" for side in terrain.size)


def _range(relief: tuple[float, float], unit: str) -> str:
    """Lowest and highest height in words."""
    low, high = (f"{height:.4g}".replace("-", "−") for height in without_noise(*relief))
    return f"{low} to {high} {unit if unit != '°' else ''}".rstrip()
