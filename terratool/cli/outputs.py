"""Reports of findings on standard output and in files, as options or settings want them."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

import click
from msgspec import Struct

from terratool.cli.config import Config
from terratool.cli.report import REPORTERS, ValidationReport, is_report
from terratool.cli.saying import say_block
from terratool.errors import RequestError
from terratool.output import (
    is_same_file,
    make_folder,
    refuse_existing,
    refuse_missing_folder,
    refuse_unmade_folder,
    whole_file,
)
from terratool.text.display import quote
from terratool.text.meaning import guess


class ReportPlan(Struct, frozen=True):
    """Formats of a report, and where each goes.

    Attributes:
        form: format on standard output.
        outputs: formats with their files.
        settings: settings that name the files of `outputs`; None where the user does.
    """

    form: str
    outputs: tuple[tuple[str, str], ...] = ()
    settings: Config | None = None

    @classmethod
    def of(cls, given: tuple[str, ...], wanted: tuple[str, ...], settings: Config) -> ReportPlan:
        """Plan of the formats that are given, or else of those that settings want.

        One for standard output stands in place of that of the settings, and files in place of their
        files.

        Raises:
            click.UsageError: a format is unknown, or two go to one place.
            RequestError: the settings name a file that they may not.
            WriteError: a file cannot be written.
        """
        own = any("=" in text for text in given)
        said = [text for text in given if "=" not in text]
        said = said or [text for text in wanted if "=" not in text]
        form = None
        outputs = []
        for text in [*said, *(text for text in (given if own else wanted) if "=" in text)]:
            name, separator, out = text.partition("=")
            if name not in REPORTERS:
                raise click.UsageError(
                    f"There is no format {quote(name)}. There is {', '.join(REPORTERS)}. "
                    f"{guess(name, REPORTERS)}".rstrip()
                )
            if separator:
                out = out if own else settings.output_path(out)
                refuse_existing(Path(out), overwrite=True)
                (refuse_missing_folder if own else refuse_unmade_folder)(Path(out))
                outputs.append((name, out))
            elif form is None:
                form = name
            else:
                raise click.UsageError(
                    f"Standard output takes one format, not {form} and {name}. Give one of them a "
                    f"file: --format {name}=FILE."
                )
        written = [os.path.realpath(out) for _, out in outputs]
        if len(set(written)) < len(written):
            raise click.UsageError("Two formats go to one file. Give each a file of its own.")
        return cls(form or "text", tuple(outputs), None if own else settings)

    def refuse_outputs(self) -> None:
        """Refuse outputs that settings, which may be a stranger's, may not name.

        Raises:
            RequestError: the settings name a file that is no report, or lies elsewhere.
        """
        if self.settings is None:
            return
        for _, out in self.outputs:
            self.settings.refuse_output(out)
            if Path(out).exists() and not is_report(out):
                raise RequestError(
                    f"{out}: is there, and is no report of terratool, as {self.settings.file} has "
                    "it.",
                    "Remove it, or name it on the command line.",
                )

    def writes(self, name: str) -> bool:
        """Whether a file is one of the outputs."""
        return any(is_same_file(out, name) for _, out in self.outputs)

    def write(self, report: ValidationReport, texts: Mapping[str, str] = {}) -> None:
        """Write a report to files and standard output.

        Args:
            report: the findings.
            texts: texts in place of those of the report, by format.

        Raises:
            WriteError: a file cannot be written.
        """
        self.refuse_outputs()  # links may be new since the first look
        for form, out in self.outputs:
            if self.settings is not None:
                make_folder(Path(out))  # none is there in a fresh clone
            with whole_file(out, overwrite=True) as part:
                text = click.unstyle(texts[form] if form in texts else REPORTERS[form](report))
                part.write_text(text + "\n", encoding="utf-8", newline="\n")
        text = texts[self.form] if self.form in texts else REPORTERS[self.form](report)
        say_block(text, machine=self.form != "text")
