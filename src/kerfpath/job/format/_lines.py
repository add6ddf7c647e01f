"""Locate keys and values in a TOML text, so that messages can name their line."""

from __future__ import annotations

import tomllib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import tree_sitter_toml
from tree_sitter import Language, Node, Parser

__all__ = ["Position", "TomlPlaces"]

_TOML = Language(tree_sitter_toml.language())
_HEADERS = ("table", "table_array_element")
_KEYS = ("bare_key", "quoted_key", "dotted_key")
_VALUES = (
    "array",
    "boolean",
    "float",
    "inline_table",
    "integer",
    "local_date",
    "local_date_time",
    "local_time",
    "offset_date_time",
    "string",
)


class Position(NamedTuple):
    """Line and column (in characters) in a text, both counted from 1."""

    line: int
    column: int


@dataclass
class _Place:
    """One table, array or value: the node it starts at, and what lies inside it by key or index."""

    node: Node
    inside: dict[str | int, _Place] = field(default_factory=dict)
    is_array_of_tables: bool = False

    def reach(self, keys: Iterable[str], node: Node) -> _Place:
        """Return the place at `keys` below this one; new tables on the way start at `node`."""
        place = self.latest()
        for key in keys:
            place = place.inside.setdefault(key, _Place(node)).latest()
        return place

    def latest(self) -> _Place:
        """Return what further keys refer to: of an array of tables its last element, as in TOML."""
        return self.inside[len(self.inside) - 1] if self.is_array_of_tables else self


class TomlPlaces:
    """The places of all keys and values of a TOML document.

    Parameters
    ----------
    text : str
        A valid TOML document.
    """

    def __init__(self, text: str) -> None:
        source = text.encode()
        self._lines = source.split(b"\n")
        self._root = _tree(source)

    def locate(self, where: Sequence[str | int]) -> Position:
        """Return the position of the item at `where`, or of the table that should hold it.

        Parameters
        ----------
        where : sequence of str and int
            Keys, and indices from 0, from the document down: ``("contour", 1, "speed_m_min")``.
            A key is located at its start, an array element at its value, a table at its header,
            and a table that is missing at line 1.
        """
        place = self._root
        row, column = 0, 0
        for step in where:
            if step not in place.inside:
                break
            place = place.inside[step]
            row, column = place.node.start_point
        before = self._lines[row][:column].decode(errors="replace")
        return Position(row + 1, len(before) + 1)


def _tree(source: bytes) -> _Place:
    """Return the places of the whole document."""
    document = Parser(_TOML).parse(source).root_node
    root = _Place(document)
    waiting = [(document, root)]
    while waiting:  # no recursion: a document may nest deeper than Python's stack
        node, place = waiting.pop()
        for child, where in _children(node, place, root):
            waiting.append((child, where))
    return root


def _children(node: Node, place: _Place, root: _Place) -> Iterator[tuple[Node, _Place]]:
    """Yield the tables and values directly inside `node` with their places, made on the way."""
    if node.type == "document":
        for child in node.named_children:
            if child.type == "pair":
                yield from _children(child, root, root)
            elif child.type in _HEADERS:
                # A table's pairs belong to the element that is the last one now, not later.
                here = _open_table(child, root)
                for pair in child.named_children:
                    if pair.type == "pair":
                        yield from _children(pair, here, root)
    elif node.type == "pair":
        key = next((c for c in node.named_children if c.type in _KEYS), None)
        value = next((c for c in node.named_children if c.type in _VALUES), None)
        if key is not None and value is not None:
            yield value, place.reach(_keys(key), node)
    elif node.type == "array":
        elements = (c for c in node.named_children if c.type in _VALUES)
        for i, element in enumerate(elements):
            yield element, place.inside.setdefault(i, _Place(element))
    elif node.type == "inline_table":
        for pair in node.named_children:
            if pair.type == "pair":
                yield from _children(pair, place, root)


def _open_table(header: Node, root: _Place) -> _Place:
    """Return the place of the table that `header` opens."""
    key = next((c for c in header.named_children if c.type in _KEYS), None)
    if key is None:
        return _Place(header)
    *above, last = _keys(key)
    parent = root.reach(above, header)
    if header.type == "table":
        place = parent.inside.setdefault(last, _Place(header))
        place.node = header  # a sub-table may have named it earlier; its own header wins
        return place
    tables = parent.inside.setdefault(last, _Place(header))
    tables.is_array_of_tables = True
    return tables.inside.setdefault(len(tables.inside), _Place(header))


def _keys(key: Node) -> list[str]:
    """Return the parts of a bare, quoted or dotted key, read by TOML's own rules."""
    text = (key.text or b"").decode()
    if key.type == "bare_key":
        return [text]
    found, keys = tomllib.loads(f"{text} = 0"), []
    while isinstance(found, dict):
        ((name, found),) = found.items()
        keys.append(name)
    return keys
