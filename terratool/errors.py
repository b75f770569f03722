"""Errors that a user can cause: exceptions with one sentence, a hint and an exit code."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from terratool.definition.findings import Finding

DAMAGED = "It may be cut short: write it again, or fetch it again."
"""Hint for a file that ends too early, or whose parts do not fit together."""


def reason(error: OSError) -> str:
    """Return the system's reason for an error, in lower case."""
    return (error.strerror or str(error)).lower()


class TerratoolError(Exception):
    """Base of all errors that a user can cause.

    Args:
        message: one sentence that says what is wrong and where.
        hint: one sentence that says what to do; may be empty.
    """

    exit_code = 3

    def __init__(self, message: str, hint: str = "") -> None:
        super().__init__(message)
        self.message = message
        self.hint = hint

    def __str__(self) -> str:
        return f"{self.message} {self.hint}".rstrip()


class ReadError(TerratoolError):
    """A file cannot be read."""

    @classmethod
    def of(
        cls, name: object, error: OSError, hint: str = "Check the path and its permissions."
    ) -> ReadError:
        """Return the error for a file that the system does not read."""
        return cls(f"{name}: cannot be read ({reason(error)}).", hint)


class WriteError(TerratoolError):
    """A file cannot be written, or may not be overwritten."""

    @classmethod
    def of(
        cls,
        name: object,
        error: OSError,
        hint: str = "Check the folder, its permissions and the space on the disk.",
    ) -> WriteError:
        """Return the error for a file that the system does not write."""
        return cls(f"{name}: cannot be written ({reason(error)}).", hint)


class RequestError(TerratoolError):
    """A request makes no sense for this terrain."""

    exit_code = 2


class DefinitionError(TerratoolError):
    """A text was read, but is no valid terrain or vehicle; `findings` says why."""

    exit_code = 1

    def __init__(self, message: str, hint: str = "", findings: tuple[Finding, ...] = ()) -> None:
        super().__init__(message, hint)
        self.findings = findings


class MissedError(TerratoolError):
    """A result is not as good as was asked for, so that nothing was written."""

    exit_code = 1


def interruption(error: BaseException | None) -> BaseException | None:
    """Return the Ctrl-C or signal among the causes of an error; None without one.

    C code that is interrupted may raise an error of its own.
    """
    while error is not None:
        if not isinstance(error, Exception):
            return error
        error = error.__cause__ or error.__context__
    return None


class StoreysWarning(UserWarning):
    """A result is of the ground alone, without the decks and bores of the terrain."""


def warn_outside(message: str, category: type[Warning]) -> None:
    """Warn at the line outside of the package that led here."""
    import inspect
    import warnings

    level, frame = 1, inspect.currentframe()
    while frame is not None and frame.f_globals.get("__name__", "").startswith("terratool."):
        frame, level = frame.f_back, level + 1
    warnings.warn(message, category, stacklevel=level)
