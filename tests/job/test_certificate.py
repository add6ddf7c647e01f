"""A certificate in plan.json: written and read to the last bit, every fault in one line."""

import json

import numpy as np
import pytest
from pydantic import ValidationError

from kerfpath import InputError
from kerfpath.certificate import Certificate, Stage
from kerfpath.job.plan_file import (
    TYPES,
    CertificateData,
    _model,
    certificate_entry,
    read_certificate,
)


@pytest.fixture
def certificate():
    rng = np.random.default_rng(1)
    sizes = {"node": (9,), "posture": (9,), "level": (9,), "index": (9,), "lift": (9, 6)}
    parts = {name: rng.integers(0, 9, size).astype(TYPES[name]) for name, size in sizes.items()}
    parts["value"] = rng.normal(size=(9, 2))
    parts["dual"] = rng.normal(size=(9, 2, 6)).astype(np.float32)
    return Certificate(
        bound=7.25, stages=(Stage(**parts), Stage(**parts, multipliers=rng.normal(size=(5, 6))))
    )


def test_it_is_read_as_it_was_written(certificate):
    entry = certificate_entry(certificate)
    text = json.dumps(entry, allow_nan=False)
    assert text == json.dumps(certificate_entry(certificate), allow_nan=False)
    _model(CertificateData).model_validate(json.loads(text))
    read = read_certificate(json.loads(text))
    assert read.bound == certificate.bound
    for one, two in zip(certificate.stages, read.stages, strict=True):
        for name in TYPES:
            a, b = getattr(one, name), getattr(two, name)
            assert (a is None) == (b is None)
            if a is not None:
                assert a.dtype == b.dtype
                np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(
    ("name", "key", "value", "words"),
    [
        ("value", "type", "<f4", "stage 0: value: expected numbers of type <f8, got '<f4'"),
        ("value", "shape", [9, 3], "value: expected 216 bytes"),
        ("value", "shape", [-9, -2], "expected the shape of an array"),
        ("value", "shape", [10**6, 10**6], "expected the shape of an array"),
        ("value", "shape", [18], r"expected value for \(9,\) nodes, got the shape \(18,\)"),
        ("dual", "zlib_base64", "!!!!", "dual: cannot be unpacked"),
        ("dual", "zlib_base64", "AAAA", "dual: cannot be unpacked"),
        ("lift", "zlib_base64", "", "lift: expected 54 bytes"),
    ],
)
def test_a_fault_is_one_line(certificate, name, key, value, words):
    entry = certificate_entry(certificate)
    entry["stages"][0][name][key] = value
    with pytest.raises(InputError, match=words) as error:
        read_certificate(entry)
    assert "\n" not in str(error.value)


def test_what_is_cut_off_or_goes_on_is_refused(certificate):
    for change in (lambda text: text[:-8], lambda text: text[:8]):
        entry = certificate_entry(certificate)
        packed = entry["stages"][0]["node"]
        packed["zlib_base64"] = change(packed["zlib_base64"])
        with pytest.raises(InputError, match="node: "):
            read_certificate(entry)


def test_keys_and_types_are_strict(certificate):
    model = _model(CertificateData)
    for change in ({"bound": "7"}, {"stages": None}, {"more": 1}):
        with pytest.raises(ValidationError):
            model.model_validate(certificate_entry(certificate) | change)
