"""Axes of time: the rate that they say, whether they fit a bank, and how they are divided."""

import numpy as np

from hybank._hybank import HybankError

# Two rates are the same up to this share, as for files.
_SAME = 1e-6
# Times are rounded, but a lost sample makes a step of two.
_UNEVEN = 0.75
# A division in one of these units is rounded: dates in nanoseconds already span only some centuries.
_FINE = ("ns", "ps", "fs", "as")


def seconds(times):
    """Times since the first one in seconds, and the last digit that they state."""
    since = times - times[0]
    if times.dtype.kind not in "mM":
        return since.astype(float), float(np.spacing(np.abs(times).max())) if times.dtype.kind == "f" else 0.0
    unit, count = np.datetime_data(since.dtype)
    return since / np.timedelta64(1, "s"), np.timedelta64(count, unit) / np.timedelta64(1, "s")


def check(bank, times, name):
    """Refuse times that are not those of the frames of a bank. Floats are in seconds; whole numbers count samples."""
    times = np.asarray(times)
    if bank.fast_period == 1.0 or len(times) < 2 or times.dtype.kind not in "mMf":
        return
    since, digit = seconds(times)
    steps, usual = np.diff(since), np.median(np.diff(since))
    is_even = (np.abs(steps - usual) <= _UNEVEN * usual + digit) & (steps >= 0)
    if not (usual > 0 and is_even.all()):
        k = int(np.argmin(is_even))
        raise HybankError(
            f"{name}: {steps[k]:.6g} s lie between samples {k} and {k + 1}, and {usual:.6g} s between most; "
            "put NaN where samples were lost, as reindex() does, and give gaps=True, or leave the times out"
        )
    frames, wanted = (len(times) - 1) / since[-1], 1 / (bank.ratio * bank.fast_period)
    # Both ends are rounded by half of what their digit is, or of what the steps scatter.
    rounding = max(digit, np.ptp(steps)) / since[-1]
    if abs(frames - wanted) > _SAME * wanted + frames * rounding:
        raise HybankError(
            f"{name}: the times are those of {frames:.9g} Hz, but the bank is designed for frames of {wanted:.9g} Hz; "
            "give times in seconds, record at that rate, or design a bank for this one"
        )


def check_rate(bank, captures, converters):
    """Refuse recordings of another rate than the bank's, read without it; `converters` take turns in one of them."""
    if captures.rate is None or captures.output_rate is not None or bank.fast_period == 1.0:
        return
    wanted = 1 / (bank.ratio * bank.fast_period)
    if len(captures) == len(bank.samples):
        wanted *= bank.samples[0]
    wanted *= converters or 1
    # WAV headers hold whole hertz, and tables of few digits say less.
    if captures.rate != round(wanted) and abs(captures.rate - wanted) > 1e-3 * wanted:
        raise HybankError(
            f"the sample rate of the recordings is {captures.rate:.9g} Hz, but the bank is designed for {wanted:.9g} Hz; "
            "record at that rate or design a bank for this one"
        )


def finer(times, ratio):
    """The times of M samples for each frame: each frame's period is divided evenly."""
    times = np.asarray(times)
    if len(times) < 2:
        raise HybankError("a time axis of fewer than two frames says no rate; give an array of NumPy")
    if times.dtype.kind not in "mMiuf":
        raise HybankError(f"a time axis of {times.dtype} cannot be divided; give numbers or times")
    is_time = times.dtype.kind in "mM"
    if is_time and np.datetime_data(times.dtype)[0] not in _FINE and (np.diff(times).astype(np.int64) % ratio).any():
        times = times.astype(f"{times.dtype.kind}8[ns]")
    since = times - times[0]
    unit = since.dtype
    since = since.astype(np.int64 if is_time else float)
    periods = np.diff(since, append=2 * since[-1] - since[-2])
    parts = periods[:, None] * np.arange(ratio) / ratio
    parts = np.round(parts).astype(np.int64) if is_time else parts
    parts = since[:, None] + parts
    return (times[0] + (parts.astype(unit) if is_time else parts)).reshape(-1)
