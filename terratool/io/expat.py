"""XML parsing for untrusted files."""

from __future__ import annotations

from typing import NoReturn
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat


class EntityError(ValueError):
    """Raised for an XML text that declares or uses entities."""


def hardened_parser(separator: str | None = None) -> expat.XMLParserType:
    """Create an expat parser that opens no other file and expands no entity.

    A document type may be named, as in X3D, but is not fetched and may have no internal subset. The
    handlers refuse what defusedxml does with `forbid_external` and, for an internal subset,
    `forbid_dtd`; these few lines spare every installation that dependency. Parsing raises an
    EntityError for a text with entities.

    Args:
        separator: text between namespace address and local name; None to keep prefixes as written.
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
    """Parse an XML text into its root element, without comments.

    Raises:
        EntityError: the text declares or uses entities.
        ExpatError: the text is no XML.
    """
    builder = TreeBuilder()
    parser = hardened_parser()
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
