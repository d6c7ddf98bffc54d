"""Hybrid multirate filter banks: several slow converters with fractional delays as one fast one.

``design`` makes a ``Bank``; ``Bank.fuse`` runs it on an array or on files, ``Bank.stream`` block by block.
``hybank.dask`` does both on many machines, ``hybank.ibr`` renders views.
"""

import importlib

from hybank import _functions
from hybank._functions import align, analyze, calibrate, import_taps, load, measure, merge, simulate, verify
from hybank._hybank import Bank, HybankError, Recording, SpecError, Stream, __version__
from hybank._inputs import Captures, read
from hybank._keywords import check_methods
from hybank._results import (
    Alignment,
    Analysis,
    Calibration,
    Capture,
    Comparison,
    Figures,
    FuseReport,
    Gamma,
    Measurement,
    Merged,
    Record,
    Verified,
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
    "Alignment",
    "Analysis",
    "Bank",
    "Calibration",
    "Capture",
    "Captures",
    "Channel",
    "Comparison",
    "Figures",
    "FuseReport",
    "Gamma",
    "HybankError",
    "Measurement",
    "Merged",
    "Record",
    "Recording",
    "Signal",
    "SpecError",
    "Stream",
    "Verified",
    "__version__",
    "align",
    "analyze",
    "bessel",
    "butterworth",
    "calibrate",
    "cascade",
    "chebyshev1",
    "chebyshev2",
    "design",
    "elliptic",
    "import_taps",
    "load",
    "measure",
    "merge",
    "rc",
    "read",
    "simulate",
    "ss",
    "tf",
    "verify",
    "zpk",
]

for _kind in (Bank, Stream, Recording):
    check_methods(_kind)
Bank.export = _functions.format_by_name(Bank.export)

# The parts that need more than NumPy, or that few programs need, are imported when they are used.
_PARTS = ("dask", "gnuradio", "ibr")


def __getattr__(name):
    if name in _PARTS:
        return importlib.import_module(f"hybank.{name}")
    raise AttributeError(f"module 'hybank' has no attribute {name!r}")


def __dir__():
    return sorted([*__all__, *_PARTS])
