"""Results as named values."""

from __future__ import annotations

import json
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal, final

if TYPE_CHECKING:
    from collections.abc import Iterator, KeysView

    import numpy as np
    from numpy.typing import NDArray


class Record(SimpleNamespace):
    """Named values, with the names that ``--json`` of the command line has."""

    def __getattr__(self, name: str) -> Any:
        """Only for names that are not there."""
        raise AttributeError(f"{type(self).__name__} has no {name!r}, but {', '.join(vars(self))}")

    def __getitem__(self, name: str) -> Any:
        return vars(self)[name]

    def __iter__(self) -> Iterator[str]:
        return iter(vars(self))

    def __len__(self) -> int:
        return len(vars(self))

    def keys(self) -> KeysView[str]:
        """The names, so that ``dict(record)`` makes a dictionary."""
        return vars(self).keys()


def record(text):
    """The records of a JSON text."""
    return json.loads(text, object_hook=lambda fields: Record(**fields))


def result(name, text):
    """The result of a class from the JSON text of a report with its fields."""
    return globals()[name](**record(text))


def lines(readings):
    """Readings of delays, mappings or records, as JSON lines."""
    return "\n".join(json.dumps(dict(reading), default=_plain) for reading in readings)


def _plain(value):
    if isinstance(value, Record):
        return dict(value)
    return value.tolist()


class Comparison(Record):
    """A record against a reference: ``record[n] = gain * reference(n - lag) + offset + error``.

    ``lag_samples``, ``gain`` and ``offset`` have a ``value`` and its standard deviation ``sigma``; ``snr_db`` is that
    after they are taken out, ``snr_unaligned_db`` that sample by sample. ``spectrum`` is that of the error: hertz, dB of
    full scale.
    """

    def __repr__(self):
        return f"Comparison(snr_db={self.snr_db:.2f}, lag_samples={self.lag_samples.value:.6f}, gain={self.gain.value:.8f})"

    def plot(self, ax: Any = None) -> Any:
        """Draw the spectrum of the error with matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure if left out.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import numpy as np
        >>> x = np.cos(0.3 * np.arange(4096))
        >>> ax = hb.measure(1.001 * x, 48e3, ref=x).plot()  # doctest: +SKIP
        """
        from hybank import _show

        return _show.spectrum(self, ax)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Gamma:
    """The worst-case error gamma with its bounds, in normalised time; None where a bound is not known."""

    # Norm computed from the coefficients.
    norm: float | None
    # An upper bound of the true norm.
    upper: float | None
    # A lower bound for all banks of this method and size.
    lower: float | None
    # A lower bound for all banks.
    noncausal: float | None
    # An upper bound over all errors that the spec allows for.
    worst_case: float | None = None
    # The same while the taps follow the delays; None for a bank whose taps do not.
    tracked: float | None = None

    def __repr__(self):
        return f"Gamma(norm={self.norm}, upper={self.upper}, lower={self.lower}, noncausal={self.noncausal})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Figures:
    """A bank in the user's terms: ratios in decibels, frequencies in hertz."""

    # The band of the figures: low and high end.
    band: tuple[float, float]
    # Signal-to-noise ratio with all parts that the spec states.
    snr: float
    # Its parts: from the signal, from the converters' noise, from uncertain delays; None without.
    snr_signal: float
    snr_noise: float | None
    snr_delays: float | None
    # With 16-bit converters; None where the spec states noise.
    snr_16_bits: float | None
    # The largest image of a tone in the band and the frequency of the tone; None where a tone is lost.
    image: float | None
    image_frequency: float | None
    # The largest error of gain and phase of a tone, relative to it, and the frequency of the tone.
    gain_error: float | None
    gain_error_frequency: float | None
    # The simple ways, the best one first: name, channel (from 1) and signal-to-noise ratio.
    simple: list[tuple[Literal["one-channel", "interleaving", "cubic-spline"], int | None, float]]
    # The gain over the best of them, for the same converters.
    gain_over_simple: float | None
    # gamma for inputs of any spectrum; None for a spec without signal.
    any_input: float | None

    def __repr__(self):
        return f"Figures(snr={self.snr}, image={self.image}, gain_error={self.gain_error})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class FuseReport:
    """What happened while a bank was run on an array."""

    # `direct`, `overlap-save`, `parallel-form` or `dense`.
    algorithm: str
    # Number type of the sums: `f32` or `f64`.
    numbers: str
    # Instruction set of the kernels.
    isa: str
    # Output samples dropped at the beginning.
    latency_dropped: int
    # Output samples that saturated.
    clipped: int
    # Input samples that were NaN or infinite and became 0.
    replaced: int
    # Times that the state of a recursion was not finite and became 0.
    state_resets: int
    # Missing samples, and the gaps (channel from 1, first frame, length); None unless gaps were filled.
    missing: int | None
    gaps: list[tuple[int, int, int]] | None
    # True where a missing sample affects the output; None unless gaps were filled.
    mask: NDArray[np.bool_] | None
    # What was known of the delays, a record per measurement; None unless they were followed.
    track: list[Record] | None = None

    def __repr__(self):
        names = ("algorithm", "numbers", "isa", "latency_dropped", "clipped", "replaced")
        return f"FuseReport({', '.join(f'{name}={getattr(self, name)!r}' for name in names)})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Verified:
    """Proven bounds of gamma."""

    # No bank of the class `lower_banks` has a smaller gamma.
    lower: float
    lower_banks: Literal["any", "causal", "fir_of_this_length"]
    # Gamma of this bank is at most this.
    upper: float
    # Gamma of this bank is at least this.
    attained: float
    # No bank has a smaller gamma.
    noncausal: float
    # Order of the certificate.
    states: int
    # The file has a digest, and it matches; None for a bank in memory.
    digest: bool | None
    # The certificate came with the bank; otherwise it was found now.
    certificate_in_bank: bool

    def __repr__(self):
        return f"Verified(lower={self.lower}, upper={self.upper}, lower_banks={self.lower_banks!r})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """The error of a bank with given delays."""

    # The worst-case gain, in normalised time.
    gamma: float
    # Frequency of the worst case, modulo the slow rate.
    peak_hertz: float
    # No bank has a smaller gamma with these front ends and delays; None where that is not known.
    noncausal: float | None
    # Rms of the error for white noise of unit density at the analog input.
    rms_error: float
    # Rms of the output noise for independent noise of unit rms on all slow samples.
    noise_gain: float
    # Rms of the output noise for the noise of the converters in the spec.
    output_noise: float
    # gamma of zero output and of plain interleaving, and the rms of the reference.
    scale: Record
    # A proven upper bound of gamma; None unless asked for, as all below.
    certified: Record | None = None
    # The worst case over the box of errors, proven from both sides.
    worst_case: Record | None = None
    # The derivatives of gamma with respect to the delays.
    sensitivity: Record | None = None
    # What jitter adds to gamma at most.
    jitter: Record | None = None
    # gamma along the delays of the box.
    sweep: Record | None = None

    def __repr__(self):
        names = ("gamma", "peak_hertz", "noncausal", "rms_error", "noise_gain", "output_noise")
        return f"Analysis({', '.join(f'{name}={getattr(self, name)}' for name in names)})"


@final
@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Capture:
    """What virtual converters capture."""

    # Slow samples, (N, T); complex for a complex signal. A list of arrays for converters with rates of their own.
    channels: Any
    # Samples of the ideal fast converter, M T of them, in line with the output of `Bank.fuse`.
    target: NDArray[Any]
    # Samples of each converter that were clipped at full scale.
    clipped: list[int]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """How recordings lie in time. Arrays have one value per channel; half-widths are in the spec."""

    # The spec with these values, as TOML.
    spec: str
    # Samples to leave out at the beginning of each recording, and samples of each that remain.
    skip: list[int]
    frames: int
    # Seconds, at the first frame.
    delay: NDArray[np.float64]
    # By how many ppm each clock is fast.
    drift_ppm: NDArray[np.float64]
    gain: NDArray[np.float64]
    offset: NDArray[np.float64]
    # The delays over time as JSON lines: what `hybank fuse --track` reads.
    track: str
    # The best channel alone and all together in dB, whatever the filters are, and whether one suffices.
    alone_db: float
    together_db: float
    one_suffices: bool
    # What a reader of the values must know.
    warnings: list[str]

    def __repr__(self):
        return f"<hybank.Alignment of {len(self.skip)} channels: {self.frames} frames>"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """What a calibration found. Arrays have one value per channel; it is NaN where the spec's value stands.

    ``.._sigma`` are standard deviations.
    """

    # The spec with these values and their intervals, as TOML.
    spec: str
    # Seconds.
    delay: NDArray[np.float64]
    delay_sigma: NDArray[np.float64]
    gain: NDArray[np.float64]
    gain_sigma: NDArray[np.float64]
    offset: NDArray[np.float64]
    offset_sigma: NDArray[np.float64]
    # Factors of the cut-off frequencies.
    cutoff: NDArray[np.float64]
    cutoff_sigma: NDArray[np.float64]
    # The reference channel, from 1.
    reference: int
    # Tones that were used, in hertz.
    tones: list[float]
    # Frames that took part.
    frames: int
    # Clipped samples of each channel, which were left out.
    clipped: list[int]
    # 1 where the model fits to the noise; None if there are no degrees of freedom left.
    misfit: float | None
    # What a reader of the values must know.
    warnings: list[str]

    def __repr__(self):
        misfit = "None" if self.misfit is None else f"{self.misfit:.3f}"
        return f"<hybank.Calibration of {len(self.clipped)} channels: misfit {misfit}>"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """The figures of a converter from the record of a tone."""

    # Signal over everything else but the constant, in dB.
    sinad: float
    # Effective number of bits, of this tone and of one of full scale.
    enob: float
    enob_full_scale: float
    # Signal over what no line explains, harmonics over signal, interleaving spurs over signal, in dB.
    snr: float
    thd: float
    # None for a single converter.
    interleaving: float | None
    # Largest tone over largest line, in dB.
    sfdr: float
    # Noise per hertz relative to a sine of full scale, in dB.
    noise_density: float
    # The constant part; of complex samples that of the real and of the imaginary parts.
    offset: float | complex
    # Tones: frequency in hertz, amplitude, phase in radians at the first sample.
    tones: list[tuple[float, float, float]]
    # Lines beside the tones, largest first: frequency in hertz, level in dB relative to the largest tone, causes.
    spurs: list[tuple[float, float, str]]
    # Of complex samples, per tone: gain of the imaginary part relative to the real one, error of their quadrature in
    # radians, and image rejection in dB. None for real samples.
    imbalances: list[tuple[float, float, float]] | None
    # Samples at the rails, and samples that are not finite.
    clipped: int
    left_out: int
    # The figures as a report shows them: name, value, unit, meaning.
    figures: list[tuple[str, str, str, str]]
    # The spectrum: hertz, and dB relative to full scale.
    spectrum: tuple[NDArray[np.float64], NDArray[np.float64]]

    def __repr__(self):
        names = ("sinad", "enob", "snr", "thd", "sfdr")
        return f"Measurement({', '.join(f'{name}={getattr(self, name):.2f}' for name in names)})"

    def _repr_html_(self):
        from hybank import _show

        return _show.measured(self)

    def plot(self, ax: Any = None) -> Any:
        """Draws the spectrum with its spurs by matplotlib.

        Parameters
        ----------
        ax : matplotlib.axes.Axes, optional
            Where to draw; a new figure if left out.

        Returns
        -------
        matplotlib.axes.Axes

        Examples
        --------
        >>> import numpy as np
        >>> m = hb.measure(np.cos(0.3 * np.arange(4096)), 48e3)
        >>> ax = m.plot()  # doctest: +SKIP
        """
        from hybank import _show

        return _show.spectrum(self, ax)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """The geometry that was estimated from tracks."""

    # Points that both of the first two views see, and those of them within the threshold of the fundamental matrix.
    matches: int
    inliers: int
    # Root mean square Sampson distance of the inliers, pixels.
    sampson_rms: float
    # Points from which the virtual camera was estimated, and those of them within the threshold of the camera.
    sightings: int
    resection_inliers: int
    # Root mean square reprojection error of these, pixels.
    resection_rms: float
    # Share of the guessed calibrations that agree on the order of depth.
    order_agreement: float
    # What decided the order of depth.
    order_by: Literal["given", "calibrations", "colours", "both", "nothing"]


@final
@dataclass(frozen=True, slots=True, eq=False, repr=False)
class View:
    """A rendered view."""

    # Intensities 0 to 255: (H, W), or (H, W, 3) if an image has colours.
    image: NDArray[np.float32]
    # Depth at the virtual camera, NaN in holes: (H, W). Without cameras only its order has a meaning.
    depth: NDArray[np.float32]
    # 0 where a view saw the pixel, 1 in cracks, 2 where no view saw it, 3 where only guessed depth shows it: (H, W).
    mask: NDArray[np.uint8]
    # Share of the pixels that samples cover.
    coverage: float
    # True where the view was rendered: (H, W). Without cameras that is the convex hull of the points.
    region: NDArray[np.bool_]
    # The estimated geometry of views without cameras; None for others.
    geometry: Geometry | None
