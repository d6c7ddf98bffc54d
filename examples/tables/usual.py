"""The usual ways to use several converters as one, in numpy, as one would write them by hand.

What they know of the converters comes from the same captures: sines fitted to each converter.
"""

import numpy as np


def fit_tone(channels, slow_rate, frequency):
    """Offsets and phasors (cosine and sine amplitude as a complex number) of a tone in each channel."""
    n = np.arange(channels.shape[1])
    angle = 2 * np.pi * frequency / slow_rate * n
    columns = np.stack([np.cos(angle), -np.sin(angle), np.ones_like(angle)], axis=1)
    fitted = np.linalg.lstsq(columns, channels.T, rcond=None)[0]
    return fitted[2], fitted[0] + 1j * fitted[1]


def refine(channels, slow_rate, frequency):
    """The frequency of the tone, to a small part of a cycle per record."""
    count = channels.shape[1]
    for _ in range(4):
        quarter = count // 4
        first = fit_tone(channels[:, :quarter], slow_rate, frequency)[1]
        last = fit_tone(channels[:, -quarter:], slow_rate, frequency)[1]
        start = 2 * np.pi * frequency / slow_rate * (count - quarter)
        turn = np.angle(np.sum(last * np.conj(first) * np.exp(-1j * start)))
        frequency += turn / (2 * np.pi) * slow_rate / (count - quarter)
    return frequency


class Errors:
    """Delays (s, beyond those of the drawing), gains and offsets; converter `reference` has none."""

    def __init__(self, captures, rate, reference):
        delays, gains, offsets = [], [], []
        for interleaved, tones in captures:
            ways = interleaved.shape[1]
            channels, slow_rate = interleaved.T, rate / ways
            rest = channels.copy()
            for tone in tones:
                tone = refine(rest, slow_rate, tone)
                offset, phasors = fit_tone(rest, slow_rate, tone)
                n = np.arange(rest.shape[1])
                rest = rest - np.real(phasors[:, None] * np.exp(2j * np.pi * tone / slow_rate * n))
                ratios = phasors / phasors[reference]
                nominal = 2 * np.pi * tone * (np.arange(ways) - reference) / rate
                phases = np.angle(ratios * np.exp(-1j * nominal))
                delays.append(-phases / (2 * np.pi * tone))
                gains.append(np.abs(ratios))
                offsets.append(rest.mean(axis=1))
        weights = np.repeat([2 * np.pi * tone for _, tones in captures for tone in tones], 1) ** 2
        self.delays = np.average(delays, axis=0, weights=weights)
        self.gains = np.mean(gains, axis=0)
        self.offsets = np.mean(offsets, axis=0)

    def levelled(self, interleaved):
        """The samples in turn, without offsets and with equal gains."""
        return ((interleaved - self.offsets) / self.gains).reshape(-1)


def spline(errors, interleaved, rate):
    """A cubic spline through the samples at their true instants."""
    from scipy.interpolate import CubicSpline

    samples = errors.levelled(interleaved)
    instants = np.arange(samples.size) - np.tile(errors.delays * rate, interleaved.shape[0])
    return CubicSpline(instants, samples)(np.arange(samples.size))


def delay_filters(errors, interleaved, rate, taps=64):
    """Each sample moved to its instant by the derivative of all, which a filter of `taps` gives; twice."""
    samples = errors.levelled(interleaved)
    k = np.arange(-(taps // 2), taps // 2 + 1)
    with np.errstate(divide="ignore"):
        ideal = np.where(k == 0, 0.0, (-1.0) ** k / k)
    filter_ = ideal * np.kaiser(k.size, 8)
    moved, delays = samples, np.tile(errors.delays * rate, interleaved.shape[0])
    for _ in range(3):
        moved = samples + delays * np.convolve(moved, filter_, mode="same")
    return moved
