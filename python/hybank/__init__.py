"""Hybrid multirate filter banks: several slow converters with fractional delays as one fast one.

``design`` makes a ``Bank``; ``Bank.fuse`` runs it on an array, ``Bank.stream`` block by block. ``hybank.dask`` does both
on many machines, ``hybank.ibr`` renders views.
"""

import importlib

from hybank import _pickles  # noqa: F401
from hybank._hybank import (
    Analysis,
    Bank,
    Calibration,
    Capture,
    Figures,
    FuseReport,
    Gamma,
    HybankError,
    Measurement,
    Recording,
    SpecError,
    Stream,
    Verified,
    __version__,
    analyze,
    calibrate,
    load,
    measure,
    simulate,
    verify,
)
from hybank._spec import (
    Channel,
    Signal,
    bessel,
    butterworth,
    cascade,
    chebyshev1,
    chebyshev2,
    design,
    elliptic,
    rc,
    ss,
    tf,
    zpk,
)

__all__ = [
    "Analysis",
    "Bank",
    "Calibration",
    "Capture",
    "Channel",
    "Figures",
    "FuseReport",
    "Gamma",
    "HybankError",
    "Measurement",
    "Recording",
    "Signal",
    "SpecError",
    "Stream",
    "Verified",
    "__version__",
    "analyze",
    "bessel",
    "butterworth",
    "calibrate",
    "cascade",
    "chebyshev1",
    "chebyshev2",
    "design",
    "elliptic",
    "load",
    "measure",
    "rc",
    "simulate",
    "ss",
    "tf",
    "verify",
    "zpk",
]


def __getattr__(name):
    """The parts that need more than NumPy, or that few programs need, are imported when they are used."""
    if name in ("dask", "gnuradio", "ibr"):
        return importlib.import_module(f"hybank.{name}")
    raise AttributeError(f"module 'hybank' has no attribute {name!r}")
