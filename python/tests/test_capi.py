"""The C library by ctypes: the bits of the Python package."""

import ctypes
import os
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT


@pytest.fixture(scope="module")
def library():
    folders = [Path(os.environ.get("CARGO_TARGET_DIR", "none")), ROOT / "capi" / "target"]
    paths = [folder / profile / "libhybank.so" for folder in folders for profile in ("release", "debug")]
    found = next((path for path in paths if path.exists()), None)
    if found is None:
        pytest.skip("no libhybank.so: cargo build in capi/")
    library = ctypes.CDLL(str(found))
    library.hybank_open.restype = ctypes.c_void_p
    library.hybank_error.restype = ctypes.c_char_p
    for name in ("process", "process_int16", "flush", "flush_int16"):
        getattr(library, f"hybank_{name}").restype = ctypes.c_ssize_t
    for name in ("channels", "ratio", "latency", "flush_frames"):
        getattr(library, f"hybank_{name}").restype = ctypes.c_size_t
    return library


@pytest.mark.parametrize("name", ["thesis-fir", "thesis-iir", "vibration-3x"])
@pytest.mark.parametrize("dtype, suffix", [("f4", ""), ("i2", "_int16")])
def test_c_has_the_bits_of_python(library, filters, random, name, dtype, suffix):
    import hybank as hb

    path = filters / f"{name}.json"
    bank = hb.load(path)
    handle = ctypes.c_void_p(library.hybank_open(str(path).encode(), b"auto", 0))
    assert handle.value, library.hybank_error()
    s = bank.stream(axis=0, dtype=dtype)
    assert [library.hybank_channels(handle), library.hybank_ratio(handle)] == [bank.channels, bank.ratio]
    assert library.hybank_latency(handle) == s.latency
    x = random.standard_normal((1000, bank.channels))
    x = (9000 * x).astype(dtype) if dtype == "i2" else x.astype(dtype)
    y = np.zeros(1000 * bank.ratio, dtype)
    process = getattr(library, f"hybank_process{suffix}")
    pointer = lambda array: array.ctypes.data_as(ctypes.c_void_p)  # noqa: E731
    assert process(handle, pointer(x), ctypes.c_size_t(1000), pointer(y)) == len(y)
    np.testing.assert_array_equal(y, s.process(x))
    tail = np.zeros(library.hybank_flush_frames(handle) * bank.ratio, dtype)
    assert getattr(library, f"hybank_flush{suffix}")(handle, pointer(tail)) == len(tail)
    np.testing.assert_array_equal(tail, s.flush())
    library.hybank_close(handle)


def test_failures_have_a_text(library):
    assert not library.hybank_open(b"none.json", b"auto", 0)
    assert b"none.json" in library.hybank_error()
