"""Write the tables of docs/validation.md and its picture anew; or, with `fit`, print the fit."""

from __future__ import annotations

import sys

if sys.argv[1:] == ["fit"]:
    from tests.validation.fit import report

    sys.stdout.write(report() + "\n")
elif sys.argv[1:]:
    raise SystemExit("usage: python -m tests.validation [fit]")
else:
    from tests.validation.page import PAGE, renewed
    from tests.validation.picture import PICTURE, picture

    PICTURE.write_text(picture(), "utf-8")
    PAGE.write_text(renewed(PAGE.read_text("utf-8")), "utf-8")
