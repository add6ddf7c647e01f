"""Write programs and other sets of files into folders, and tell which files belong together.

The files of a set are renamed one after another, so a killed process may leave new files beside
old ones. Before the first of them `MANIFEST` is renamed: it has the hash of each new file, and the
hashes of what was in its place before. By these every reader tells a file of the set from one that
was edited since, which is no fault, and from one that is left of an earlier set, which is one.
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from pathlib import Path

from kerfpath.arrays import short_repr
from kerfpath.errors import InputError
from kerfpath.files import only_writer, write_whole

MANIFEST = ".kerfpath.json"
"""File that lists the files that were written into a folder: the set and the hash of each."""
REMEMBERED = 20
"""Number of earlier contents of each file that are told from edits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Entry:
    """What the manifest says about a file.

    Parameters
    ----------
    of : str
        First file of its set: of a program, the file to start.
    program : bool
        Whether it belongs to a program.
    sha256 : str
        Hash of its content; empty if the set has no such file any more.
    earlier : tuple of str
        Hashes of contents that were replaced, the last ones.
    """

    of: str
    program: bool
    sha256: str
    earlier: tuple[str, ...] = ()

    def replaced(self, there: str, by: _Entry | None = None) -> _Entry:
        """Return the entry of the next set, or of no file, where the content `there` was."""
        by = by or replace(self, sha256="")
        known = dict.fromkeys([*self.earlier, self.sha256, there])
        return replace(
            by, earlier=tuple(k for k in known if k not in ("", by.sha256))[-REMEMBERED:]
        )


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
    others = [n for n in files if n not in program]

    def is_old(entry: _Entry) -> bool:
        return only in (None, entry.of) if entry.program else others[:1] == [entry.of]

    return _replace(Path(folder), files, program, is_old, keep=only is None)


def write_set(folder: str | os.PathLike[str], files: Mapping[str, str]) -> list[Path]:
    """Write files that belong together into a folder, as `replace_program` does; return the paths.

    Files of the earlier set with the same first file are removed, unless they were edited.

    Raises
    ------
    InputError
        A file cannot be written or removed.
    """
    first = next(iter(files))
    return list(_replace(Path(folder), files, (), lambda e: e.of == first, keep=True).written)


def require_one_set(path: Path) -> None:
    """Require that no file beside a file, or of its set, is left of an earlier set.

    An edited file is none, and neither is a missing one.

    Raises
    ------
    InputError
        A file of the folder has a content that a later run has replaced, or was to replace.
    """
    for folder in (path.parent, path.parent.parent):
        listed = _read_list(folder)
        if folder != path.parent and path.relative_to(folder).as_posix() not in listed:
            continue
        for name, entry in listed.items():
            if _hash_of(folder / name) in entry.earlier:
                raise InputError(
                    f"{folder / name} is left of an earlier run and does not belong to the files "
                    "beside it (a later run was stopped while it wrote, or the old file was put "
                    "back): run it again, or move the old file away"
                )


def _replace(
    folder: Path, files: Mapping[str, str], program: Sequence[str],
    is_old: Callable[[_Entry], bool], *, keep: bool,
) -> FolderChanges:  # fmt: skip
    """Write a set in place of the old ones; `keep` their edited files, or else refuse them."""
    _make_folder(folder)
    with _explained({}), only_writer(folder):
        _make_folders(folder, files)
        listed = _read_list(folder)
        old = [n for n, e in listed.items() if n not in files and is_old(e)]
        there = {n: _hash_of(folder / n) for n in {*files, *old}}
        known = {n: ("", listed[n].sha256, *listed[n].earlier) for n in old}
        edited = [n for n in old if there[n] not in known[n] and listed[n].sha256]
        if edited and not keep:
            raise InputError(
                f"{folder / edited[0]} belongs to the earlier program {listed[edited[0]].of} and "
                "was edited since; it must not stay beside the new one, so move it away"
            )
        stale = [n for n in old if there[n] and there[n] in known[n]]
        new = {n: text.encode("utf-8") for n, text in files.items()}
        entries = {n: e for n, e in listed.items() if n not in old or n in edited}
        for n in old:
            if n not in edited:
                entries[n] = listed[n].replaced(there[n])
        for part in (True, False):
            names = [n for n in files if (n in program) is part]
            for n in names:
                entry = _Entry(of=names[0], program=part, sha256=_hash(new[n]))
                entries[n] = listed.get(n, entry).replaced(there[n], entry)
        contents: dict[Path, bytes | None] = {}
        list_text = _list_of(entries)
        if (listed or len(files) > 1 or keep) and _hash_of(folder / MANIFEST) != _hash(list_text):
            contents[folder / MANIFEST] = list_text
        removed: dict[Path, bytes | None] = dict.fromkeys(folder / n for n in stale)
        if not program:
            contents |= removed
        contents |= {folder / n: new[n] for n in reversed(list(files)) if there[n] != _hash(new[n])}
        contents |= removed
        _write(contents)
        for parent in {path.parent for path in removed} - {folder}:
            with suppress(OSError):
                parent.rmdir()
    return FolderChanges(
        written=tuple(folder / n for n in files),
        removed=tuple(removed),
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
    _make_folders(Path(folder), files)
    _write({paths[name]: files[name].encode("utf-8") for name in reversed(list(files))})
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
    _write({target: text.encode("utf-8")})


def _make_folders(folder: Path, names: Iterable[str]) -> None:
    """Make the folders of files in a folder.

    Raises
    ------
    InputError
        A folder cannot be made, or is a link that leads out of the folder.
    """
    for parent in dict.fromkeys((folder / name).parent for name in names):
        _make_folder(parent)
        if not parent.resolve().is_relative_to(folder.resolve()):
            raise InputError(f"{parent}: expected a folder in {folder}, got a link; remove it")


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot create the folder ({error})") from None


def _write(contents: Mapping[Path, bytes | None]) -> None:
    with _explained(contents):
        write_whole(contents)


@contextmanager
def _explained(contents: Mapping[Path, bytes | None]) -> Iterator[None]:
    """Turn an OSError of writing into an InputError that names the file."""
    try:
        yield
    except OSError as error:
        if contents.get(Path(error.filename), b"") is None:
            raise InputError(
                f"{error.filename} belongs to an earlier program and cannot be removed "
                f"({error.strerror}); remove it yourself"
            ) from None
        raise InputError(
            f"cannot write the program to {error.filename}: {error.strerror}"
        ) from None


def _read_list(folder: Path) -> dict[str, _Entry]:
    """Return the files in the manifest; none if it does not exist or is not valid."""
    if not (folder / MANIFEST).is_file():
        return {}
    try:
        found = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))["files"]
        entries = {
            str(name): _Entry(
                of=str(entry["of"]),
                program=bool(entry["program"]),
                sha256=str(entry["sha256"]),
                earlier=tuple(map(str, entry["earlier"])),
            )
            for name, entry in found.items()
        }
        inside = folder.resolve()
        return {n: e for n, e in entries.items() if (folder / n).resolve().is_relative_to(inside)}
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return {}


def _list_of(entries: Mapping[str, _Entry]) -> bytes:
    """Return the content of the manifest."""
    files = {name: asdict(entry) for name, entry in entries.items()}
    return (json.dumps({"files": files}, indent=1, sort_keys=True) + "\n").encode()


def _hash_of(path: Path) -> str:
    """Return the hash of a regular file, which is not a link; empty if there is none."""
    try:
        return _hash(path.read_bytes()) if path.is_file() and not path.is_symlink() else ""
    except OSError:
        return ""


def _hash(data: bytes) -> str:
    return hashlib.sha256(data).hexdigest()
