"""A parser of XML for files from strangers."""

from __future__ import annotations

from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat


class EntityError(ValueError):
    """A text declares or uses entities of its own."""


def hardened(separator: str | None = None) -> expat.XMLParserType:
    """A parser that reads no other file and expands nothing.

    A document type may be named, as X3D does it, but is neither fetched nor may it declare
    anything. The handlers refuse what defusedxml does with `forbid_external` and, of document types
    with a content, `forbid_dtd`; a package for these few lines would have to be installed by all.

    Args:
        separator: between the address of a namespace and a name; None to leave prefixes alone.

    Raises:
        EntityError: by parsing, where there is more.
    """
    parser = expat.ParserCreate(namespace_separator=separator)
    parser.SetParamEntityParsing(expat.XML_PARAM_ENTITY_PARSING_NEVER)
    parser.buffer_text = True
    parser.StartDoctypeDeclHandler = _doctype
    parser.EntityDeclHandler = _entity
    parser.UnparsedEntityDeclHandler = _entity
    parser.ExternalEntityRefHandler = _entity
    parser.SkippedEntityHandler = _entity
    return parser


def tree_of(text: bytes) -> Element:
    """The elements of a text, without comments.

    Raises:
        EntityError: it declares or uses entities.
        ExpatError: it is no XML.
    """
    builder = TreeBuilder()
    parser = hardened()
    parser.StartElementHandler = builder.start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text, True)
    return builder.close()


def _doctype(_name: str, _system: str | None, _public: str | None, has_content: bool) -> None:
    if has_content:
        _entity()


def _entity(*_: object) -> NoReturn:
    raise EntityError("the file declares or uses entities of its own, which are not read")
