"""What a bank computes, by definition and independent of the library."""

import numpy as np


def polyphase_sum(taps, ratio, x):
    """y[kM + p] = sum over i and j of f_i[p + jM] x_i[k - j], in double precision."""
    channels, frames = x.shape
    y = np.zeros(frames * ratio, dtype=np.result_type(x.dtype, float))
    for i in range(channels):
        for n, tap in enumerate(taps[i]):
            j, p = divmod(n, ratio)
            if j < frames:
                y[j * ratio + p :: ratio] += tap * x[i, : frames - j]
    return y


def aligned(taps, ratio, latency, x):
    """The same without the latency: the first samples are dropped, the last ones come from zeros."""
    flush = -(-latency // ratio)
    padded = np.concatenate([x, np.zeros((x.shape[0], flush), dtype=x.dtype)], axis=1)
    return polyphase_sum(taps, ratio, padded)[latency : latency + x.shape[1] * ratio]


def assert_identical(y, want):
    """The same values, number type and shape. (``strict`` of NumPy's own function needs NumPy 1.24.)"""
    assert (y.dtype, y.shape) == (want.dtype, want.shape)
    np.testing.assert_array_equal(y, want)
