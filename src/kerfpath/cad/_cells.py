"""Read tables from text: delimiters, comments, decimal commas and numbers."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from kerfpath._repr import short_repr
from kerfpath.errors import InputError

__all__ = ["TableCells", "cells_of"]

COMMENTS = ("#", "%", "//")


@dataclass(frozen=True, slots=True, kw_only=True)
class TableCells:
    """The cells of a table, and the line number of each row."""

    lines: Sequence[int]
    rows: Sequence[Sequence[str]]
    has_decimal_comma: bool

    __repr__ = short_repr

    def is_numbers(self, row: int) -> bool:
        """Return whether all cells of a row are numbers, so that it is no header."""
        try:
            for cell in self.rows[row]:
                _number(cell, self.has_decimal_comma)
        except ValueError:
            return False
        return True

    def is_number(self, row: int, column: int) -> bool:
        """Return whether a cell is a number."""
        try:
            _number(self.rows[row][column], self.has_decimal_comma)
        except (ValueError, IndexError):
            return False
        return True

    def without_header(self) -> TableCells:
        """Return the table without its first row."""
        return TableCells(
            lines=self.lines[1:], rows=self.rows[1:], has_decimal_comma=self.has_decimal_comma
        )

    def require_width(self, columns: int) -> None:
        """Raise InputError if a row has another number of cells."""
        for line, row in zip(self.lines, self.rows, strict=True):
            if len(row) != columns:
                raise InputError(f"line {line}: expected {columns} columns, got {len(row)}")

    def number(self, row: int, column: int, name: str) -> float:
        """Return a cell as a finite number; `name` is the name of its column.

        Raises
        ------
        InputError
            A cell that is not a finite number (the message has line and column).
        """
        where, cell = f"line {self.lines[row]}, column {name}", self.rows[row][column]
        try:
            value = _number(cell, self.has_decimal_comma)
        except ValueError:
            raise InputError(f"{where}: expected a number, got {cell[:40]!r}") from None
        if not np.isfinite(value):
            raise InputError(f"{where}: expected a finite number, got {cell!r}")
        return value


def cells_of(content: bytes, expected: str) -> TableCells:
    """Return the cells of a table, split at the delimiter of its first line.

    Raises
    ------
    InputError
        Not text, no rows (the message lists the `expected` columns), quotes that span lines.
    """
    numbered = [
        (number, line)
        for number, line in enumerate(re.split(r"\r\n|\r|\n", _text(content)), start=1)
        if line.strip() and not line.lstrip().startswith(COMMENTS)
    ]
    if not numbered:
        raise InputError(f"holds no rows; expected columns {expected}")
    delimiter = next((d for d in (";", "\t", "|", ",") if d in numbered[0][1]), None)
    lines = [number for number, _ in numbered]
    if delimiter is None:
        rows = [line.split() for _, line in numbered]
    else:
        try:
            rows = [
                [cell.strip() for cell in row]
                for row in csv.reader((line for _, line in numbered), delimiter=delimiter)
            ]
        except csv.Error as error:
            raise InputError(f"cannot be split into columns ({error})") from None
        if len(rows) != len(lines):
            raise InputError("a quoted cell runs over several lines; remove its quotes")
    return TableCells(lines=lines, rows=rows, has_decimal_comma=delimiter in (";", "\t", "|"))


def _text(content: bytes) -> str:
    wide = content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE))
    try:
        return content.decode("utf-16" if wide else "utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise InputError(f"line {line}: expected text in UTF-8; save the table as UTF-8") from None


def _number(cell: str, has_decimal_comma: bool) -> float:
    if has_decimal_comma and "," in cell:
        if "." in cell:
            raise ValueError(cell)
        cell = cell.replace(",", ".")
    if "_" in cell:  # Python accepts it between digits
        raise ValueError(cell)
    return float(cell)
