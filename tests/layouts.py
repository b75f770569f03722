"""Helpers that write JSON with given spacing and note, character by character, where all stands."""

from __future__ import annotations

import json
from typing import Any

from hypothesis import strategies as st

from terratool.text.display import escape

characters = st.characters(exclude_categories=["Cs"])
texts = st.text(characters, max_size=8)
scalars = st.one_of(
    st.none(),
    st.booleans(),
    st.integers(-(10**40), 10**40),
    st.floats(allow_nan=False, allow_infinity=False),
    texts,
)
values = st.recursive(
    scalars,
    lambda inner: (
        st.lists(inner, max_size=4) | st.dictionaries(texts | st.just("a/b~c"), inner, max_size=4)
    ),
    max_leaves=20,
)
gaps = st.sampled_from(["", "", " ", "\t", "\n", "\r\n", "\r", " \n\t ", "\n\r\n"])


class Cursor:
    """Line and column, counted one character at a time; LF, CR and CRLF end a line."""

    def __init__(self) -> None:
        self.line, self.column, self._before = 1, 1, ""

    def after(self, text: str) -> tuple[int, int]:
        for char in text:
            if char == "\r" or (char == "\n" and self._before != "\r"):
                self.line, self.column = self.line + 1, 1
            elif char != "\n":
                self.column += 1
            self._before = char
        return self.line, self.column


class Layout:
    """Writes a value with the spacing it is given, and notes where each value and key begins."""

    def __init__(self, spaces: Any, ascii_only: bool) -> None:
        self.text, self.places, self.keys = "", {}, {}
        self._cursor, self._spaces, self._ascii = Cursor(), spaces, ascii_only

    def write(self, text: str) -> tuple[int, int]:
        here = (self._cursor.line, self._cursor.column)
        self.text += text
        self._cursor.after(text)
        return here

    def space(self) -> None:
        self.write(self._spaces())

    def value(self, value: Any, pointer: str = "") -> None:
        if isinstance(value, dict | list):
            self.places[pointer] = self.write("{" if isinstance(value, dict) else "[")
            for index, key in enumerate(value):
                self.write("," if index else "")
                self.space()
                here = f"{pointer}/{escape(key) if isinstance(value, dict) else index}"
                if isinstance(value, dict):
                    self.keys[here] = self.write(json.dumps(key, ensure_ascii=self._ascii))
                    self.space()
                    self.write(":")
                    self.space()
                self.value(value[key] if isinstance(value, dict) else key, here)
                self.space()
            self.space()
            self.write("}" if isinstance(value, dict) else "]")
        else:
            self.places[pointer] = self.write(json.dumps(value, ensure_ascii=self._ascii))
