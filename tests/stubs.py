"""Write the stub of the package, with the options of each verb: `python -m tests.stubs [--check]`.

What the verbs take is read off the records that they fill in. A type checker cannot see that, nor
the names that are imported when they are first used; so both stand in terratool/__init__.pyi.
"""

from __future__ import annotations

import ast
import builtins
import inspect
import re
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, get_overloads

import terratool
from terratool.api.starting import starter_options
from terratool.authoring.starters.build import KINDS

STUB = Path(terratool.__file__).with_suffix(".pyi")
HEAD = '"""Robot terrains from a small JSON text. Written by `make stubs`."""\n'
STANDARD = {
    "Any": "typing", "Literal": "typing", "Sequence": "collections.abc",
    "Mapping": "collections.abc",
}  # fmt: skip
NAME = re.compile(r'"[^"]*"|\'[^\']*\'|(?<![\w.])[A-Za-z_]\w*')
"""A text, which names nothing, or a name that no dot stands before."""
WRITTEN = ("load", "Terrain", "new", "Definition", "Element", "check", "import_terrain",
           "import_primitive", "map_scans")  # fmt: skip
"""Public names whose options are written out; others are imported as they are."""


@cache
def imports_of(module: str) -> dict[str, tuple[str, str]]:
    """Module and name there of each name that a module knows; an empty name for a module."""
    path = inspect.getsourcefile(import_module(module))
    assert path is not None
    tree = ast.parse(Path(path).read_text("utf-8"))
    found = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module:
            found.update({one.asname or one.name: (node.module, one.name) for one in node.names})
        elif isinstance(node, ast.Import):
            found.update({one.asname or one.name: (one.name, "") for one in node.names})
    for one in tree.body:
        names = [one.name] if isinstance(one, ast.ClassDef | ast.FunctionDef) else []
        if isinstance(one, ast.Assign):
            names = [target.id for target in one.targets if isinstance(target, ast.Name)]
        found.update({name: (module, name) for name in names})
    return found


class StubWriter:
    """Writer of the stub, which gathers what is to be imported."""

    def __init__(self) -> None:
        self.imports: set[str] = set()
        self.public = {tuple(home.split(":")): name for name, home in terratool._HOMES.items()}

    def text(self) -> str:
        """Text of the stub, not yet formatted."""
        lines: list[str] = []
        for name, home in terratool._HOMES.items():
            module, _, own = home.partition(":")
            if name not in WRITTEN:
                self.imports.add(f"from {module} import {own} as {name}")
                continue
            found = getattr(terratool, name)
            if name == "new":
                lines += self.starters()
            elif inspect.isclass(found):
                lines += self.class_of(name, found)
            else:
                lines += self.function(found, "")
        listed = [f'    "{name}",' for name in terratool.__all__]
        self.imports.add("from terratool._version import __version__ as __version__")
        imports = sorted(self.imports)
        return "\n".join([HEAD, *imports, "", "__all__ = [", *listed, "]", "", *lines, ""])

    def starters(self) -> Iterator[str]:
        """Lines of `new`, one overload for each kind."""
        self.imports |= {"from typing import Literal, overload"}
        for kind in KINDS:
            yield "@overload"
            yield from ["def new(", f'    kind: Literal["{kind}"],', "    *,"]
            for one in starter_options(kind).values():
                yield f"    {one.name}: {self.annotation(one.annotation, one.home)} = ...,"
            yield from [") -> str:", f'    """{KINDS[kind].descr}"""', ""]

    def class_of(self, name: str, kind: type) -> Iterator[str]:
        """Lines of a class, its public methods and properties."""
        bases = [base for base in kind.__bases__ if base is not object]
        for base in bases:
            self.imports.add(f"from {base.__module__} import {base.__name__}")
        yield f"class {name}({', '.join(base.__name__ for base in bases)}):"
        yield f'    """{first_line(kind)}"""'
        yield ""
        for own, member in vars(kind).items():
            if own.startswith("_") and own != "__init__":
                continue
            if isinstance(member, property):
                assert member.fget is not None
                given = inspect.signature(member.fget).return_annotation
                yield "    @property"
                yield f"    def {own}(self) -> {self.annotation(given, member.fget.__module__)}:"
                yield from [f'        """{first_line(member)}"""', ""]
            elif inspect.isfunction(member):
                yield from self.function(member, "    ")

    def function(self, function: Callable[..., Any], indent: str) -> Iterator[str]:
        """Lines of a function, or of its overloads."""
        plain = inspect.unwrap(function)
        whole = inspect.signature(function)
        forms = overloads_of(plain)
        for form in forms or [plain]:
            own = inspect.signature(form)
            parameters = {one.name: one for one in own.parameters.values()
                          if one.kind is not one.VAR_KEYWORD}  # fmt: skip
            if len(parameters) < len(own.parameters):  # it takes options
                left = inspect.signature(plain).parameters
                parameters |= {n: one for n, one in whole.parameters.items() if n not in left}
            if forms:
                self.imports.add("from typing import overload")
                yield f"{indent}@overload"
            yield f"{indent}def {function.__name__}("
            options = getattr(function, "__options__", {})
            starred = False
            for one in parameters.values():
                if one.kind is one.KEYWORD_ONLY and not starred:
                    starred = True
                    yield f"{indent}    *,"
                yield f"{indent}    {self.parameter(one, options, plain.__module__)},"
            result = self.annotation(str(own.return_annotation), plain.__module__)
            yield f"{indent}) -> {result}:"
            yield f'{indent}    """{first_line(function)}"""'
            yield ""

    def parameter(self, one: inspect.Parameter, options: Any, module: str) -> str:
        """A parameter with its type and its default."""
        if one.annotation is one.empty:
            return one.name
        home = options[one.name].home if one.name in options else module
        text = f"{one.name}: {self.annotation(str(one.annotation), home)}"
        return text if one.default is one.empty else f"{text} = {default_of(one.default)}"

    def annotation(self, text: str, module: str) -> str:
        """A type whose names are known in the stub."""

        def known(found: re.Match[str]) -> str:
            name = found[0]
            if name[0] in "\"'" or hasattr(builtins, name):
                return name
            home = imports_of(module).get(name) or (STANDARD[name], name)
            if home in self.public:
                return self.public[home]
            if not home[1]:
                self.imports.add(f"import {home[0]}")
                return name
            if name in terratool.__all__:
                self.imports.add(f"from {home[0]} import {home[1]} as Model{name}")
                return f"Model{name}"
            self.imports.add(f"from {home[0]} import {home[1]}")
            return name

        return NAME.sub(known, text)


def overloads_of(function: Callable[..., Any]) -> Sequence[Callable[..., Any]]:
    """Overloads of a function, which are known by the name that it was written with."""
    assert inspect.isfunction(function)
    said, function.__qualname__ = function.__qualname__, function.__code__.co_qualname
    try:
        return get_overloads(function)
    finally:
        function.__qualname__ = said


def first_line(documented: Any) -> str:
    """First line of a docstring."""
    return (inspect.getdoc(documented) or "").split("\n")[0]


def default_of(value: Any) -> str:
    """A default as it is written; dots for one that is no plain value."""
    plain = isinstance(value, str | int | float | bool | tuple | None)
    return repr(value) if plain and value == value else "..."


def formatted(text: str) -> str:
    """The text as ruff lays it out, with its imports in order."""
    command = [sys.executable, "-m", "ruff"]
    name = ["--stdin-filename", str(STUB)]
    checked = [*command, "check", "--select", "I", "--fix", "--quiet", *name, "-"]
    for one in (checked, [*command, "format", "--quiet", *name, "-"]):
        text = subprocess.run(
            one, input=text, capture_output=True, text=True, check=True, encoding="utf-8"
        ).stdout
    return text


def same(one: str, other: str) -> bool:
    """Whether two stubs say the same, however they are laid out."""

    def parts(text: str) -> tuple[set[str], list[str]]:
        body = ast.parse(text).body
        imports = set()
        for node in body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                imports |= {f"{getattr(node, 'module', '')} {ast.dump(n)}" for n in node.names}
        rest = [ast.dump(n) for n in body if not isinstance(n, ast.Import | ast.ImportFrom)]
        return imports, rest

    return parts(one) == parts(other)


def main() -> int:
    """Write the stub, or with --check say whether it is up to date; 1 if it is not."""
    text = StubWriter().text()
    if "--check" in sys.argv:
        if same(text, STUB.read_text("utf-8")):
            return 0
        print(f"{STUB} is out of date. Run make stubs.")
        return 1
    STUB.write_text(formatted(text), encoding="utf-8", newline="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
