"""Options of Python's verbs: those of the records that commands fill in, too, by name.

A verb takes its options as keywords. Their names, types, defaults and meanings are read off the
record that the verb fills in, so that they stand once. Errors of the layers below name options as
the command line does; verbs say them as Python does.
"""

from __future__ import annotations

import contextlib
import functools
import inspect
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass
from pathlib import Path
from typing import Any, NamedTuple, ParamSpec, TypeVar

import msgspec
from msgspec import NODEFAULT

from terratool.api.values import fitted
from terratool.authoring.starters.build import hint_for
from terratool.errors import RequestError, TerratoolError

P = ParamSpec("P")
R = TypeVar("R")
T = TypeVar("T")
C = TypeVar("C", bound=type)

REQUIRED = inspect.Parameter.empty
"""Default of an option that has to be given."""


class NamedOption(NamedTuple):
    """Option of a verb.

    Attributes:
        name: name of the keyword.
        annotation: type, as it is written where the record stands.
        default: default; `REQUIRED` for none.
        descr: meaning, in words.
        home: module in which the names of the annotation are known.
    """

    name: str
    annotation: str
    default: Any
    descr: str
    home: str

    @property
    def parameter(self) -> inspect.Parameter:
        """Parameter of a signature."""
        return inspect.Parameter(
            self.name, inspect.Parameter.KEYWORD_ONLY,
            default=self.default, annotation=self.annotation,
        )  # fmt: skip


# --- records --------------------------------------------------------------------------------------

_ENTRY = re.compile(r"^    (\w[\w, ]*): (.+(?:\n {8}.+)*)", re.MULTILINE)
"""Entry of the section `Attributes:` of a docstring, without its indentation."""


def _meanings(record: type) -> dict[str, str]:
    """Meanings of a record's attributes, from its docstring."""
    _, _, entries = inspect.cleandoc(record.__doc__ or "").partition("Attributes:\n")
    found = {}
    for entry in _ENTRY.finditer(entries):
        words = re.sub(r"\s+", " ", entry[2])
        found.update(dict.fromkeys(entry[1].split(", "), words))
    return found


def options_of(record: type) -> dict[str, NamedOption]:
    """Options of a record, a dataclass or a struct, by name, those of its bases first."""
    homes: dict[str, str] = {}
    annotations: dict[str, str] = {}
    meanings: dict[str, str] = {}
    for one in reversed(record.__mro__):
        own = inspect.get_annotations(one)
        homes.update(dict.fromkeys(own, one.__module__))
        annotations.update(own)
        meanings.update(_meanings(one) if own else {})
    return {
        name: NamedOption(name, annotations[name], default, meanings.get(name, ""), homes[name])
        for name, default in _defaults(record).items()
    }


def _defaults(record: type) -> dict[str, Any]:
    """Defaults of a record's attributes, `REQUIRED` where there is none."""
    if is_dataclass(record):
        return {
            one.name: REQUIRED if one.default is MISSING else one.default for one in fields(record)
        }
    return {
        one.name: REQUIRED if one.default is NODEFAULT else one.default
        for one in msgspec.structs.fields(record)
    }


def fill(record: type[T], options: Mapping[str, Any], **more: Any) -> T:
    """Fill in a record with those of some options that it has, and with more."""
    known = options_of(record)
    return record(**{name: one for name, one in options.items() if name in known}, **more)


def listed(value: Any) -> tuple[Any, ...]:
    """Words or paths as a tuple, where one by itself counts as a list of one."""
    return (value,) if isinstance(value, str | Path) else tuple(value)


# --- verbs ----------------------------------------------------------------------------------------


def takes(
    *records: type,
    only: Iterable[str] = (),
    without: Iterable[str] = (),
    called: str = "",
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator of a function with `**options`, which has those of some records from then on.

    The function has its own parameters, and then the options, in its signature and its docstring.
    An unknown option is refused in a sentence, and all errors speak Python.

    Args:
        records: records whose attributes are options.
        only: names of the options that are taken; all if empty.
        without: names of attributes that are no options.
        called: name of the function for users; its own if empty.
    """
    options: dict[str, NamedOption] = {}
    for record in records:
        options |= options_of(record)
    kept = set(only) or set(options)
    wanted = {name: one for name, one in options.items() if name in kept - set(without)}
    return takes_options(wanted, called=called)


def takes_options(
    options: Mapping[str, NamedOption], called: str = "", free: str = ""
) -> Callable[[Callable[P, R]], Callable[P, R]]:
    """Decorator of a function with `**options`, which has these from then on; see `takes`.

    Values of another type than their options have are refused, and others converted: see `fitted`.

    Args:
        options: options by name.
        called: name of the function for users; its own if empty.
        free: beginning of names that are taken whatever follows, where options are keys of a text;
            of their values the reader says what is wrong.
    """

    def decorate(function: Callable[P, R]) -> Callable[P, R]:
        own, name = _spoken_signature(function), called or function.__name__
        named = [one for one in own.parameters.values() if one.kind is not one.VAR_KEYWORD]
        mine = _parameters_of(function)
        known = {**mine, **options}
        checked = mine if free else known
        places = sum(one.kind is not one.KEYWORD_ONLY for one in named)

        @functools.wraps(function)
        def call(*args: P.args, **given: P.kwargs) -> R:
            refuse_unknown(name, (n for n in given if not (free and n.startswith(free))), known)
            if len(args) > places:
                function(*args, **given)  # raises Python's own error
            fit = [fitted_to(mine[n], one) for n, one in zip(mine, args, strict=False)]
            more: Any = {n: fitted_to(checked.get(n), one) for n, one in given.items()}
            with spoken_errors(known):
                return function(*fit, *args[len(fit) :], **more)  # type: ignore[arg-type]

        parameters = [*named, *(one.parameter for one in options.values())]
        parameters.sort(key=lambda one: one.kind)
        call.__signature__ = own.replace(parameters=parameters)  # type: ignore[attr-defined]
        call.__doc__ = _with_options(function.__doc__ or "", options)
        call.__options__ = options  # type: ignore[attr-defined]
        if called and function.__name__ != "__init__":
            call.__name__ = call.__qualname__ = function.__qualname__ = called
        return call

    return decorate


def _parameters_of(function: Callable[..., Any]) -> dict[str, NamedOption]:
    """Parameters of a function itself, in their order, as options."""
    return {
        one.name: NamedOption(
            one.name, "" if one.annotation is one.empty else one.annotation, one.default, "",
            function.__module__,
        )
        for one in inspect.signature(function).parameters.values()
        if one.kind is not one.VAR_KEYWORD
    }  # fmt: skip


def fitted_to(option: NamedOption | None, value: Any) -> Any:
    """Value as its option has it; as it is where nothing is known of that.

    Raises:
        RequestError: the value is of another type.
    """
    return value if option is None else fitted(option.name, value, option.annotation, option.home)


_INNER = re.compile(r"\bUser(?=Terrain\b)|(?<=\bDefinition)Builder\b|(?<=\bElement)Builder\b")
"""Parts of names of classes that users know without."""


def _spoken_signature(function: Callable[..., Any]) -> inspect.Signature:
    """Signature in which classes have the names that users know."""

    def known(annotation: Any) -> Any:
        return _INNER.sub("", annotation) if isinstance(annotation, str) else annotation

    own = inspect.signature(function)
    parameters = [one.replace(annotation=known(one.annotation)) for one in own.parameters.values()]
    return own.replace(parameters=parameters, return_annotation=known(own.return_annotation))


def refuse_unknown(what: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a keyword that a verb does not have, and name the most similar one.

    Raises:
        RequestError: a keyword is unknown.
    """
    names = [name for name in known if name != "self"]
    for name in given:
        if name not in names:
            raise RequestError(f"{what} takes no {name!r}.", hint_for(name, names))


def _with_options(doc: str, options: Mapping[str, NamedOption]) -> str:
    """Docstring with the meanings of options in place of its line on `**options`."""
    entries = [f"    {one.name}: {one.descr}" for one in options.values()]
    lines = inspect.cleandoc(doc).split("\n")
    places = [n for n, line in enumerate(lines) if line.startswith("    **options:")]
    for place in places:
        lines[place : place + 1] = entries
    return "\n".join(lines)


def public(name: str) -> Callable[[C], C]:
    """Decorator of a class that users know by another name, as one of the package itself."""

    def decorate(kind: C) -> C:
        kind.__name__ = kind.__qualname__ = name
        kind.__module__ = "terratool"
        for own, member in vars(kind).items():
            while inspect.isfunction(member):
                member.__qualname__ = f"{name}.{own}"  # Python's own errors say it
                member = getattr(member, "__wrapped__", None)
        return kind

    return decorate


# --- errors ---------------------------------------------------------------------------------------

_FLAG = re.compile(
    r"(?<![\w./-])--([a-z][a-z0-9-]*[a-z0-9])(?![\w/-]|\.\w)"
    r"(?: ([A-Z][\w.]*(?:[ ,][A-Z][\w.]*)*)\b)?"
)
"""Option of the command line, and what stands for its values."""
_WORD = re.compile(r" ([a-z0-9][a-z0-9-]*)")
_WORDS = ("compress", "dtype", "frame", "layers", "model", "origin", "prefer", "target")
"""Options after which a message may have a value as a word."""
_LISTED = "terratool validate lists"
"""Beginning of a hint on the findings that a message leaves out."""
_OTHERWISE = {"from": "start", "origin_at": "origin"}
"""Names in Python of options that have another one there, unless the verb has that, too."""


@contextlib.contextmanager
def spoken_errors(known: Mapping[str, NamedOption]) -> Iterator[None]:
    """Have errors within the block name options as Python does."""
    try:
        yield
    except TerratoolError as error:
        error.message, error.hint = (spoken(one, known) for one in (error.message, error.hint))
        error.args = (error.message,)
        raise


def spoken(text: str, known: Mapping[str, NamedOption]) -> str:
    """Text in which options of the command line are those of Python: --solid is solid=True.

    Args:
        text: sentence of an error.
        known: options of the verb that it is about; others stay as they are.
    """
    text = text.replace(_LISTED, "The error's `findings` list")
    parts, end = [], 0
    for flag in _FLAG.finditer(text):
        name, value = _name_of(flag[1], known)
        if not name or flag.start() < end:
            continue
        stop = flag.end()
        if value:
            stop, said = flag.end(1), f"{name}={value}"
        elif flag[2]:
            said = f"{name}=…"
        elif (
            name in _WORDS
            and flag[1].replace("-", "_") not in _OTHERWISE
            and (word := _WORD.match(text, flag.end()))
        ):
            several = known[name].annotation.startswith("Sequence")
            stop, said = word.end(), f'{name}=["{word[1]}"]' if several else f'{name}="{word[1]}"'
        else:
            said = name
        parts += [text[end : flag.start()], said]
        end = stop
    return "".join([*parts, text[end:]])


def _name_of(flag: str, known: Mapping[str, NamedOption]) -> tuple[str, str]:
    """Name of an option in Python, and the value of a switch; two empty texts for neither."""
    word = flag.replace("-", "_")
    word = word if word in known else _OTHERWISE.get(word, word)
    value = "True"
    if word.startswith("no_") and word not in known:
        word, value = word.removeprefix("no_"), "False"
    name = next((one for one in (word, f"{word}s") if one in known), "")
    if not name:
        return "", ""
    switch = isinstance(known[name].default, bool) or known[name].annotation == "bool | None"
    return name, value if switch else ""
