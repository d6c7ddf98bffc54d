"""Hybrid multirate filter banks: several slow converters with fractional delays as one fast one.

``design`` makes a ``Bank``; ``Bank.fuse`` runs it on an array, ``Bank.stream`` block by block.
"""

from hybank._hybank import (
    Analysis,
    Bank,
    Capture,
    FuseReport,
    Gamma,
    HybankError,
    SpecError,
    Stream,
    Verified,
    __version__,
    analyze,
    load,
    simulate,
    verify,
)
from hybank._spec import (
    Channel,
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
    "Capture",
    "Channel",
    "FuseReport",
    "Gamma",
    "HybankError",
    "SpecError",
    "Stream",
    "Verified",
    "__version__",
    "analyze",
    "bessel",
    "butterworth",
    "cascade",
    "chebyshev1",
    "chebyshev2",
    "design",
    "elliptic",
    "load",
    "rc",
    "simulate",
    "ss",
    "tf",
    "verify",
    "zpk",
]
