"""Write programs into folders, all files or none, and remove those of an earlier program."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.files import write_whole

MANIFEST = ".kerfpath.json"
"""File that lists the program files that were written into a folder: program and hash of each."""


@dataclass(frozen=True, slots=True, kw_only=True)
class FolderChanges:
    """Changes to the files of a folder.

    Parameters
    ----------
    written : tuple of Path
        The new files, the one to start first.
    removed : tuple of Path
        Files that were written for an earlier program and do not belong to the new one.
    edited : tuple of Path
        Such files that were edited since then, and are therefore kept.
    """

    written: tuple[Path, ...]
    removed: tuple[Path, ...] = ()
    edited: tuple[Path, ...] = ()

    __repr__ = short_repr


def replace_program(
    folder: str | os.PathLike[str],
    files: Mapping[str, str],
    program: Sequence[str],
    *,
    only: str | None = None,
) -> FolderChanges:
    """Write files into a folder, and remove those of the earlier program that is replaced.

    Only files that this function has written and listed in `MANIFEST` are removed, and only if they
    were not edited since. Files that already have the right text are not written again.

    Parameters
    ----------
    folder : path
    files : mapping of str to str
        Text of each file by its name; the file to start is the first.
    program : sequence of str
        Names of the files of the program, the one to start first. If it is empty, there is no
        program now, and the earlier ones are removed before anything is written.
    only : str, optional
        Replace only the program that is started with this file, and write nothing if one of its
        files was edited. Default: replace all programs of the folder.

    Raises
    ------
    InputError
        A file cannot be written or removed, or was edited.
    """
    folder = Path(folder)
    ours = _read_list(folder)
    old = {n: entry for n, entry in ours.items() if only is None or entry["of"] == only}
    there = [n for n in old if n not in program and (folder / n).is_file()]
    edited = [n for n in there if _hash((folder / n).read_bytes()) != old[n]["sha256"]]
    if edited and only is not None:
        raise InputError(
            f"{folder / edited[0]} belongs to the earlier program {only} and was edited since; it "
            "must not stay beside the new one, so move it away"
        )
    stale = [n for n in there if n not in edited]
    if not program:
        _remove(folder, stale)
    new = {n: text for n, text in files.items() if not _holds(folder / n, text)}
    write_files(folder, new)
    if program:
        _remove(folder, stale)
    kept = {n: entry for n, entry in ours.items() if n not in old or n in edited}
    kept |= {
        n: {"of": program[0], "sha256": _hash(files[n].encode("utf-8"))} for n in program
    }  # fmt: skip
    _write_list(folder, kept, needed=only is None or len(program) > 1 or bool(ours))
    return FolderChanges(
        written=tuple(folder / n for n in files),
        removed=tuple(folder / n for n in stale),
        edited=tuple(folder / n for n in edited),
    )


def write_files(folder: str | os.PathLike[str], files: Mapping[str, str]) -> list[Path]:
    """Write files into a folder, all or none, and return their paths; the first is written last.

    The program that is started therefore never calls a missing file. All texts go to temporary
    files first, so that a full disk leaves everything as it was.

    Raises
    ------
    InputError
        A file cannot be written.
    """
    paths = {name: Path(folder) / name for name in files}
    for path in paths.values():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise InputError(f"{path.parent}: cannot create the folder ({error})") from None
    _write({paths[name]: files[name] for name in reversed(list(files))})
    return list(paths.values())


def write_program(path: str | os.PathLike[str], text: str) -> None:
    """Write `text` to the file at `path` atomically.

    The text goes to a temporary file first, so that no controller ever loads half a program.

    Raises
    ------
    InputError
        The file cannot be written.
    """
    target = Path(path)
    if not target.name:
        raise InputError(f"cannot write the program to {str(path)!r}: expected a file name")
    _write({target: text})


def _write(texts: Mapping[Path, str]) -> None:
    try:
        write_whole({path: text.encode("utf-8") for path, text in texts.items()})
    except OSError as error:
        raise InputError(
            f"cannot write the program to {error.filename}: {error.strerror}"
        ) from None


def _read_list(folder: Path) -> dict[str, dict[str, str]]:
    """Return the files in the manifest; none if it does not exist or is not valid."""
    if not (folder / MANIFEST).is_file():
        return {}
    try:
        found = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["programs"]
        entries = {str(n): {k: str(e[k]) for k in ("of", "sha256")} for n, e in found.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return {}
    inside = folder.resolve()
    return {n: e for n, e in entries.items() if (folder / n).resolve().is_relative_to(inside)}


def _write_list(folder: Path, entries: Mapping[str, Mapping[str, str]], *, needed: bool) -> None:
    if entries and needed:
        text = json.dumps({"programs": dict(entries)}, indent=1, sort_keys=True) + "\n"
        if not _holds(folder / MANIFEST, text):
            write_program(folder / MANIFEST, text)
    else:
        with suppress(OSError):
            (folder / MANIFEST).unlink(missing_ok=True)


def _remove(folder: Path, names: Sequence[str]) -> None:
    """Remove files, and folders that this leaves empty.

    Raises
    ------
    InputError
        A file cannot be removed.
    """
    for name in names:
        try:
            (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise InputError(
                f"{folder / name} belongs to an earlier program and cannot be removed "
                f"({error.strerror}); remove it yourself"
            ) from None
        if (parent := (folder / name).parent) != folder:
            with suppress(OSError):
                parent.rmdir()


def _holds(path: Path, text: str) -> bool:
    """Return whether the file exists and has exactly this text."""
    try:
        return path.is_file() and path.read_bytes() == text.encode("utf-8")  # a FIFO would wait
    except OSError:
        return False


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
