"""XML without its dangers: no document types, so no entities that expand without a limit or read other files.

The standard library's parser (expat) with the line of each element, which `xml.etree` does not have.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from xml.parsers import expat

from ual.routes._route import FaultError


@dataclass(slots=True)
class Element:
    """One element. Names are without their namespaces, which differ between versions and are often not declared."""

    name: str
    line: int
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    pieces: list[str] = field(default_factory=list)

    @property
    def text(self) -> str:
        """Its own text, without spaces around it."""
        return "".join(self.pieces).strip()

    def all(self, *names: str) -> Iterator[Element]:
        """Yields the elements of these names in it, at any depth, in their order."""
        waiting = [self]
        while waiting:
            element = waiting.pop()
            if element.name in names:
                yield element
            waiting += reversed(element.children)

    def own(self, name: str) -> list[Element]:
        """Returns its children of this name."""
        return [child for child in self.children if child.name == name]

    def value(self, name: str, otherwise: str = "") -> str:
        """Returns the text of its first child of this name."""
        return next((child.text for child in self.own(name)), otherwise)


def parsed(document: str) -> Element:
    """Parses a document. Raises `FaultError`."""
    root = Element("", 0, {})
    open_elements = [root]
    parser = expat.ParserCreate("utf-8")  # whatever its declaration says: it is decoded already
    parser.buffer_text = True

    def start(name: str, attributes: dict[str, str]) -> None:
        element = Element(_local(name), parser.CurrentLineNumber, {_local(k): v for k, v in attributes.items()})
        open_elements[-1].children.append(element)
        open_elements.append(element)

    def text(piece: str) -> None:
        open_elements[-1].pieces.append(piece)

    def refuse_type(_: str, system_id: str | None, public_id: str | None, has_subset: bool) -> None:
        if system_id or public_id or has_subset:
            raise FaultError("has a document type declaration, whose entities can expand without a limit: delete it")

    parser.StartElementHandler = start
    parser.EndElementHandler = lambda _: open_elements.pop()
    parser.CharacterDataHandler = text
    parser.StartDoctypeDeclHandler = refuse_type
    try:
        parser.Parse(document.lstrip().encode("utf-8"), True)
    except expat.ExpatError as error:
        raise FaultError(f"is not valid XML: {error}") from None
    return root.children[0]


def _local(name: str) -> str:
    return name.rpartition(":")[2]
