"""Memory that is asked for before libraries are that end the process where they get none."""

import mmap

__all__ = ["require_memory"]


def require_memory(size: int) -> None:
    """Raise MemoryError unless `size` more bytes can be had.

    Libraries written in Rust (Clarabel, pydantic) abort instead of raising an error.
    """
    try:
        mmap.mmap(-1, size).close()
    except OSError as error:
        raise MemoryError(f"{size / 1e6:.0f} MB are not free") from error
