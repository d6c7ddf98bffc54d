"""Pickles and copies of results, by their attributes."""

import copyreg
import inspect
from types import SimpleNamespace

from hybank import _hybank

_RESULTS = (
    "Alignment", "Analysis", "Calibration", "Capture", "Figures", "FuseReport", "Gamma", "Geometry", "Measurement",
    "Verified", "View",
)


def _reduced(result):
    kind = type(result)
    names = [name for name, member in vars(kind).items() if inspect.isdatadescriptor(member)]
    attributes = SimpleNamespace(**{name: getattr(result, name) for name in names})
    return _hybank.restored, (kind.__name__, attributes)


for _name in _RESULTS:
    copyreg.pickle(getattr(_hybank, _name), _reduced)
