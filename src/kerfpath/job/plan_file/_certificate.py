"""Certificates in plan.json: their arrays, packed."""

from __future__ import annotations

import base64
import binascii
import math
import zlib
from collections.abc import Mapping
from typing import cast

import numpy as np
from numpy.typing import NDArray

from kerfpath.certificate import Certificate, Stage
from kerfpath.errors import InputError
from kerfpath.job.plan_file._layout import ArrayData, CertificateData, StageData

__all__ = ["certificate_entry", "read_certificate"]

TYPES: Mapping[str, str] = {
    "node": "<i4",
    "posture": "<i1",
    "level": "<i1",
    "index": "<i4",
    "lift": "<i1",
    "value": "<f8",
    "dual": "<f4",
    "multipliers": "<f8",
}
"""Number type of each array of a stage, little-endian; its bytes are row by row."""
LARGEST = 1 << 30
"""Size of the largest array that is unpacked, in bytes."""


def certificate_entry(certificate: Certificate) -> CertificateData:
    """Return the plan.json entry of a certificate."""
    stages = [
        {
            name: None if (part := getattr(stage, name)) is None else _packed(part, kind)
            for name, kind in TYPES.items()
        }
        for stage in certificate.stages
    ]
    return {"bound": certificate.bound, "stages": cast(list[StageData], stages)}


def read_certificate(data: CertificateData) -> Certificate:
    """Return the certificate of such an entry.

    Raises
    ------
    InputError
        An array differs from its stated type or size, or from the number of cells of its stage.
    """
    return Certificate(
        bound=data["bound"],
        stages=tuple(_stage(s, each) for s, each in enumerate(data["stages"])),
    )


def _stage(number: int, data: StageData) -> Stage:
    where = f"certificate, stage {number}"
    arrays: dict[str, NDArray[np.generic] | None] = {}
    for name, kind in TYPES.items():
        packed = cast(ArrayData | None, data[name])  # type: ignore[literal-required]  # one of TYPES
        arrays[name] = None if packed is None else _unpacked(packed, kind, f"{where}: {name}")
    C = arrays["node"].shape[:1] if arrays["node"] is not None else ()
    for name, part in arrays.items():
        if part is not None and name != "multipliers" and part.shape[:1] != C:
            raise InputError(f"{where}: expected {name} for {C} nodes, got the shape {part.shape}")
    return Stage(**arrays)  # type: ignore[arg-type]  # each of its type


def _packed(part: NDArray[np.generic], kind: str) -> ArrayData:
    raw = np.ascontiguousarray(part, dtype=kind).tobytes()
    return {
        "type": kind,
        "shape": list(part.shape),
        "zlib_base64": base64.b64encode(zlib.compress(raw, 6)).decode(),
    }


def _unpacked(data: ArrayData, kind: str, where: str) -> NDArray[np.generic]:
    if data["type"] != kind:
        raise InputError(f"{where}: expected numbers of type {kind}, got {data['type']!r}")
    shape = data["shape"]
    size = math.prod(shape) * np.dtype(kind).itemsize
    if min(shape, default=0) < 0 or size > LARGEST:
        raise InputError(f"{where}: expected the shape of an array, got {shape}")
    try:
        packed = base64.b64decode(data["zlib_base64"], validate=True)
        opened = zlib.decompressobj()
        raw = opened.decompress(packed, size + 1)
    except (binascii.Error, ValueError, zlib.error) as error:
        raise InputError(f"{where}: cannot be unpacked ({error})") from None
    if len(raw) != size or not opened.eof or opened.unused_data:
        raise InputError(f"{where}: expected {size} bytes of shape {shape}, got another number")
    return np.frombuffer(raw, dtype=kind).reshape(shape)
