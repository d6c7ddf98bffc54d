"""The C library by ctypes: the bits of the Python package."""

import ctypes
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT


@pytest.fixture(scope="module")
def library():
    folder = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    paths = [folder / profile / "libhybank.so" for profile in ("release", "debug")]
    found = next((path for path in paths if path.exists()), None)
    if found is None:
        pytest.skip("no libhybank.so: cargo build -p hybank-capi")
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


NUMBERS = {"float", "double", "int16_t"}
PASSED = {"int", "size_t", "ptrdiff_t", "void", "const char *", "hybank *", "const hybank *"} | {
    f"{const}{number} *" for number in NUMBERS for const in ("", "const ")
}


def test_tools_with_a_parser_of_their_own_read_the_header():
    """MATLAB's loadlibrary takes prototypes of numbers, texts, pointers to numbers and to structures without bit fields,
    unions, functions as arguments and pointers to pointers. pycparser is another parser of old C."""
    pycparser = pytest.importorskip("pycparser")
    from pycparser import c_ast, c_generator

    header = ROOT / "capi" / "include" / "hybank.h"
    command = ["cc", "-x", "c", "-std=c89", "-E", "-P", "-D__attribute__(x)=", "-D__extension__=", header]
    text = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    written, functions = c_generator.CGenerator(), {}
    for declared in pycparser.CParser().parse(text).ext:
        if isinstance(declared, c_ast.Decl) and isinstance(declared.type, c_ast.FuncDecl):
            result, arguments = declared.type.type, declared.type.args.params
            functions[declared.name] = [kind(written, part) for part in [result, *(a.type for a in arguments)]]
    assert len(functions) == 14
    assert {part for parts in functions.values() for part in parts} <= PASSED, functions
    assert functions["hybank_process"] == ["ptrdiff_t", "hybank *", "const float *", "size_t", "float *"]


def kind(written, declared):
    """A type without the name of what has it."""
    part = declared
    while not hasattr(part, "declname"):
        part = part.type
    part.declname = None
    return " ".join(written.visit(declared).split())
