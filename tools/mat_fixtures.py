"""Writes the MATLAB files in fuzz/seeds/mat with SciPy; tests and the fuzz target read them.

Sample k of channel c is ((7 k + 3 c) mod 11 - 5) / 8, times 8 in arrays of integers.
"""

import pathlib

import numpy as np
import scipy.io

FOLDER = pathlib.Path(__file__).parent.parent / "fuzz" / "seeds" / "mat"
k, c = np.meshgrid(np.arange(40), np.arange(2))
x = ((7 * k + 3 * c) % 11 - 5) / 8  # (channels, samples)


def save(name, variables, **options):
    scipy.io.savemat(FOLDER / f"{name}.mat", variables, **options)


save("double", {"x": x})
save("compressed", {"x": x.T, "fs": 24000.0}, do_compression=True)
save("single", {"x": x[0].astype("f4")})
save("int16", {"x": (8 * x).astype("i2").T})
save("int8", {"x": (8 * x).astype("i1")})
save("complex", {"z": x[:1] + 1j * x[1:]}, do_compression=True)
save(
    "several",
    {"left": x[0], "right": x[1], "note": "text", "cells": np.array([1, "b"], dtype=object), "u": np.arange(3, dtype="u8")},
)
save("sparse", {"s": __import__("scipy.sparse", fromlist=["csc_array"]).csc_array(x)})


def element(kind, data):
    return kind.to_bytes(4, "little") + len(data).to_bytes(4, "little") + data + bytes(-len(data) % 8)


# Numbers of class double that are stored as int16, as MATLAB does where it loses nothing; SciPy does not write
# them. It reads them back.
parts = [
    element(6, (6).to_bytes(4, "little") + bytes(4)),
    element(5, (40).to_bytes(4, "little") + (2).to_bytes(4, "little")),
    element(1, b"x"),
    element(3, (8 * x).astype("<i2").tobytes()),
]
header = b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM"
(FOLDER / "stored.mat").write_bytes(header + element(14, b"".join(parts)))
assert (scipy.io.loadmat(FOLDER / "stored.mat")["x"] == 8 * x.T).all()
