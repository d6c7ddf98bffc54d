"""Warnings at the line that called the package."""

import sys
import warnings


def warn(text):
    """Warn of a text, as if by the nearest caller outside of the package."""
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").split(".")[0] == "hybank":
        frame, level = frame.f_back, level + 1
    warnings.warn(text, UserWarning, stacklevel=level)
