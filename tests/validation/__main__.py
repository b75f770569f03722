"""Write the tables of docs/validation.md and its picture anew."""

from __future__ import annotations

from tests.validation.page import PAGE, renewed
from tests.validation.picture import PICTURE, picture

PICTURE.write_text(picture(), "utf-8")
PAGE.write_text(renewed(PAGE.read_text("utf-8")), "utf-8")
