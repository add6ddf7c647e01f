"""XML read with the line of every element; a document type is refused."""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.parsers import expat

from kerfpath._repr import short_repr
from kerfpath.errors import InputError

__all__ = ["SCHEMA", "Element", "parse"]

SCHEMA = "http://www.w3.org/2001/XMLSchema-instance"
"""Namespace of the attributes with the prefix xsi: here."""


@dataclass(slots=True, kw_only=True)
class Element:
    """One element: its place, tag, attributes and content."""

    file: str
    line: int
    tag: str
    attributes: dict[str, str]
    children: list[Element] = field(default_factory=list)
    text: str = ""

    __repr__ = short_repr

    def fault(self, message: str, line: int | None = None) -> InputError:
        """Return an error with the place of this element, or of a line of its text."""
        return InputError(f"{self.file}, line {self.line if line is None else line}: {message}")

    def take(self, **expected: str) -> None:
        """Check that the attributes are these and no others."""
        if self.attributes != expected:
            raise self.fault(f"expected {_show(self.tag, expected)}, got {self.shown()}")

    def only(self, *tags: str) -> list[Element]:
        """Return the children, which must have these tags in this order."""
        if [child.tag for child in self.children] != list(tags) or self.text.strip():
            raise self.fault(f"expected {' and '.join(tags) or 'nothing'} in {self.shown()}")
        return self.children

    def each(self, tag: str) -> list[Element]:
        """Return the children, which must all have this tag."""
        for child in self.children:
            if child.tag != tag:
                raise child.fault(f"expected <{tag}>, got {child.shown()}")
        if self.text.strip():
            raise self.fault(f"text is not expected in {self.shown()}")
        return self.children

    def shown(self) -> str:
        """Return the beginning of the element, on one line."""
        return _show(self.tag, self.attributes)


def parse(file: str, text: str, tag: str, namespace: str) -> Element:
    """Return the root of a document; it must have the tag `tag` in `namespace`.

    Raises
    ------
    InputError
        The text is not XML, has a document type, a processing instruction, or another root.
    """
    top = Element(file=file, line=1, tag="", attributes={})
    stack = [top]
    parser = expat.ParserCreate(namespace_separator=" ")
    parser.buffer_text = True

    def start(name: str, attributes: dict[str, str]) -> None:
        space, _, local = name.rpartition(" ")
        if space != namespace:
            raise InputError(f"{file}, line {parser.CurrentLineNumber}: <{local}> is not expected")
        plain = {key.replace(f"{SCHEMA} ", "xsi:"): value for key, value in attributes.items()}
        made = Element(file=file, line=parser.CurrentLineNumber, tag=local, attributes=plain)
        stack[-1].children.append(made)
        stack.append(made)

    def end(name: str) -> None:
        stack.pop()

    def characters(data: str) -> None:
        stack[-1].text += data

    def refuse(*_: object) -> None:
        raise InputError(
            f"{file}, line {parser.CurrentLineNumber}: a document type or a processing instruction "
            "is not expected in a project"
        )

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = parser.ProcessingInstructionHandler = refuse
    try:
        parser.Parse(text.encode("utf-8", "surrogatepass"), True)
    except expat.ExpatError as error:
        raise InputError(f"{file}, line {error.lineno}: not XML ({error})") from None
    except (ValueError, LookupError) as error:  # an encoding that the parser does not have
        raise InputError(f"{file}, line {parser.CurrentLineNumber}: not XML ({error})") from None
    root = top.children[0]
    if root.tag != tag:
        raise root.fault(f"expected <{tag}>, got {root.shown()}")
    return root


def _show(tag: str, attributes: dict[str, str]) -> str:
    said = "".join(f" {key}={value!r}" for key, value in attributes.items())
    return f"<{tag}{said[:60]}>"
