"""Results as named values."""

from __future__ import annotations

import json
from dataclasses import dataclass
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, Literal, final

from hybank._keywords import checked

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
    fields = dict(record(text))
    if fields.get("figures"):
        fields["figures"] = Figures(**fields["figures"])
    return globals()[name](**fields)


class Comparison(Record):
    """A record against a reference: ``record[n] = gain * reference(n - lag) + offset + error``.

    Attributes
    ----------
    lag_samples, gain, offset
        A ``value`` and the ``half_width`` of its 95 % interval each. The offset is added to the record.
    lag_seconds
        The lag.
    snr_db
        Reference over error, after lag, gain and offset are taken out.
    snr_unaligned_db
        The same sample by sample.
    error_rms, largest_error, largest_error_at
        Root mean square and largest value of the error, and the sample where that is.
    compared
        Samples that were compared.
    unsettled_ends
        ``samples`` at either end that are left out too, and the ``raise_db`` of the error by them; only if there are any.
    error_bands
        Rms of the error in equal bands.
    spectrum
        That of the error: hertz, dB of full scale.
    """

    def __repr__(self):
        return f"Comparison(snr_db={self.snr_db:.2f}, lag_samples={self.lag_samples.value:.6f}, gain={self.gain.value:.8f})"

    @checked
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
    """The worst-case error gamma with its bounds, in normalised time; None where a bound is not known.

    Attributes
    ----------
    norm
        Norm computed from the coefficients.
    upper
        An upper bound of the true norm.
    lower
        Computed lower bound for all banks of this method and size; None if unknown.
    noncausal
        Computed lower bound for all banks, of any latency; None if unknown.
    worst_case
        An upper bound over all errors that the spec allows for.
    """

    norm: float | None
    upper: float | None
    lower: float | None
    noncausal: float | None
    worst_case: float | None = None

    def __repr__(self):
        return f"Gamma(norm={self.norm}, upper={self.upper}, lower={self.lower}, noncausal={self.noncausal})"


@final
@dataclass(frozen=True, slots=True)
class Figures:
    """A bank in the user's terms.

    Attributes
    ----------
    band
        The band of the figures, ``low_hertz`` to ``high_hertz``, and the ``source`` that says so.
    snr
        Signal-to-noise ratio: ``total_db`` with all parts that the spec states, and the parts ``signal_db``,
        ``bits_db``, ``noise_db`` and ``jitter_db`` of the converters, and ``delays_db``, ``gains_db`` and ``offsets_db`` of
        uncertain values, None without.
    snr_16_bits_db
        With 16-bit converters; None where the spec states noise.
    image
        The largest image of a tone in the band, ``db`` relative to it, and the ``hertz`` of the tone; None where a tone is
        lost. Of uncertain delays and gains the rms.
    image_at_worst
        The same at worst within the half-widths of uncertain delays and gains; None where all are exact.
    gain_error
        The same for the largest error of gain and phase.
    target_vanishes
        The target is zero somewhere in the band; the tones there are left out.
    usual_ways
        The best one first: ``way`` ("one-channel", "interleaving", "own-correction", "cubic-spline"; last
        "least-squares", which has taps as the bank has), ``channel`` (from 1) of the first one, ``snr_db`` and
        ``sfdr_db``, None of one channel.
    gain_over_usual_ways_db
        The gain over the best of them, for the same converters.
    any_input
        gamma for inputs of any spectrum; None for a spec without signal.
    """

    band: Record
    snr: Record
    snr_16_bits_db: float | None
    image: Record | None
    image_at_worst: Record | None
    gain_error: Record | None
    target_vanishes: bool
    usual_ways: list[Record]
    gain_over_usual_ways_db: float | None
    any_input: float | None

    def __repr__(self):
        levels = {name: found and found.db for name, found in (("image", self.image), ("gain_error", self.gain_error))}
        return f"Figures(snr={self.snr.total_db}, image={levels['image']}, gain_error={levels['gain_error']})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class FuseReport:
    """What happened while a bank was run on an array.

    Attributes
    ----------
    plan
        The ``algorithm`` ("direct", "overlap-save", "parallel-form" or "dense"), the number type ``numbers`` of the sums
        ("f32" or "f64"), the instruction set ``isa`` of the kernels, and ``extra_latency``, the output samples by which
        the algorithm is later than the bank; for FIR banks the ``multiply_adds`` per output sample, for transforms
        ``transform`` and ``block``, their frames.
    channels, ratio
        N and M.
    frames, samples
        Input frames and output samples.
    rate
        Output samples per second.
    latency_dropped
        Output samples dropped at the beginning.
    captures
        Whether the captures agree with the spec of the bank.
    peak
        Largest magnitude of the output, of full scale.
    clipped
        Output samples that saturated.
    replaced
        Input samples that were NaN or infinite and became 0.
    state_resets
        Times that the state of a recursion was not finite and became 0.
    seconds
        How long it took.
    warnings
        What was tolerated. Each is a ``UserWarning``, too.
    missing, gaps
        Missing samples, and the gaps (channel from 1, first sample, length, predicted SNR in dB); None unless they
        were estimated.
    mask
        0 where no missing sample affects the output, else its predicted SNR in dB, from 1 to 255; None unless they
        were estimated.
    """

    plan: Record
    channels: int
    ratio: int
    frames: int
    samples: int
    rate: float
    latency_dropped: int
    captures: str
    peak: float
    clipped: int
    replaced: int
    state_resets: int
    seconds: float
    warnings: list[str]
    missing: int | None
    gaps: list[tuple[int, int, int, float]] | None
    mask: NDArray[np.uint8] | None

    def __repr__(self):
        names = ("latency_dropped", "peak", "clipped", "replaced")
        shown = ", ".join(f"{name}={getattr(self, name)!r}" for name in names)
        return f"FuseReport(algorithm={self.plan.algorithm!r}, {shown})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Verified:
    """Proven bounds of gamma.

    Attributes
    ----------
    upper
        Gamma of this bank is at most this.
    attained
        Gamma of this bank is at least this.
    states
        Order of the certificate.
    digest
        The file has a digest, and it matches; None for a bank in memory.
    certificate_in_file
        The certificate came with the bank; otherwise it was found now.
    worst_case
        No errors within the uncertainty of the spec make gamma larger; None if the bank states nothing of them.
    """

    upper: float
    attained: float
    states: int
    digest: bool | None
    certificate_in_file: bool
    worst_case: float | None = None

    def __repr__(self):
        return f"Verified(attained={self.attained}, upper={self.upper})"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Analysis:
    """The error of a bank with given delays.

    Attributes
    ----------
    gamma
        The worst-case gain, in normalised time.
    peak_hertz
        Frequency of the worst case, modulo the slow rate.
    noncausal
        No bank has a smaller gamma with these front ends and delays; None where that is not known.
    rms_error
        Rms of the error for white noise of unit density at the analog input.
    noise_gain
        Rms of the output noise for independent noise of unit rms on all slow samples.
    output_noise
        Rms of the output noise for the noise of the converters in the spec.
    scale
        gamma of zero output and of plain interleaving, and the rms of the reference.
    figures
        The figures of the bank with its own delays.
    with_errors
        The signal-to-noise ratio and the largest image with the delays that are given; None without any.
    worst_case
        A proven bound of gamma over the box of errors, and the largest gamma found; None without a box.
    """

    gamma: float
    peak_hertz: float
    noncausal: float | None
    rms_error: float
    noise_gain: float
    output_noise: float
    scale: Record
    figures: Figures
    with_errors: Record | None = None
    worst_case: Record | None = None

    def __repr__(self):
        names = ("gamma", "peak_hertz", "noncausal", "rms_error", "noise_gain", "output_noise")
        return f"Analysis({', '.join(f'{name}={getattr(self, name)}' for name in names)})"


@final
@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Capture:
    """What virtual converters capture.

    Attributes
    ----------
    channels
        Slow samples, (N, T); complex for a complex signal. A list of arrays for converters with rates of their own.
    target
        Samples of the ideal fast converter, M T of them, in line with the output of `Bank.fuse`.
    clipped
        Samples of each converter that were clipped at full scale.
    """

    channels: Any
    target: NDArray[Any]
    clipped: list[int]


@final
@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """How recordings lie in time. Arrays have one value per channel; half-widths are in the spec.

    Attributes
    ----------
    spec
        The spec with these values, as TOML.
    reference
        The reference channel, from 1.
    skip, frames
        Samples to leave out at the beginning of each recording, and samples of each that remain.
    pieces, measured
        Pieces that were compared, and those of them that gave delays.
    delay
        Seconds, at the first frame.
    drift_ppm
        By how many ppm each clock is fast.
    gain, offset
        Gain and offset of each channel.
    steps
        Per channel where its recording lost samples: each step has the ``samples`` among which it lies (``start``,
        ``end``), and how many were ``lost``, below 0 for samples that came in. ``skip`` counts samples after the lost
        ones were put back.
    track
        The delays over time as JSON lines.
    alone
        The best ``channel`` alone, its ``snr_db``, and ``together_db`` of all, whatever the filters are.
    one_suffices
        Whether that channel suffices.
    moves
        Whether delays move so much that fixed taps lose by it.
    warnings
        What a reader of the values must know. Each is a ``UserWarning``, too.
    """

    spec: str
    reference: int
    skip: list[int]
    frames: int
    pieces: int
    measured: int
    delay: NDArray[np.float64]
    drift_ppm: NDArray[np.float64]
    gain: NDArray[np.float64]
    offset: NDArray[np.float64]
    steps: list[list[Record]]
    track: str
    alone: Record
    one_suffices: bool
    moves: bool
    warnings: list[str]

    def __repr__(self):
        return f"<hybank.Alignment of {len(self.skip)} channels: {self.frames} frames>"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Merged:
    """One recording of several. Arrays have one value per recording.

    Attributes
    ----------
    samples, rate
        The result, and its samples per second.
    first, begin
        The sample of the first recording, from 0, at whose instant the result begins, and that instant in seconds
        after its first sample.
    start
        Seconds by which each recording began after the first one.
    drift_ppm, gain
        By how many ppm each clock is fast, and each gain; None for samples with times.
    noise
        Rms of the noise of each recording.
    steps
        Where each recording lost samples, as in `Alignment`.
    snr_db, worst_second_db, worst_second_at
        The predicted SNR, that of the worst second, and when this begins.
    alone_db, mean_db
        What each recording has alone, and the mean of these.
    one_suffices
        The recording, from 1, that alone does as well.
    warnings
        What a reader must know. Each is a ``UserWarning``, too.
    """

    samples: NDArray[np.float64]
    rate: float
    first: int
    begin: float
    start: NDArray[np.float64]
    drift_ppm: NDArray[np.float64] | None
    gain: NDArray[np.float64] | None
    noise: NDArray[np.float64]
    steps: list[list[Record]]
    snr_db: float
    worst_second_db: float
    worst_second_at: float
    alone_db: list[float]
    mean_db: float
    one_suffices: int | None
    warnings: list[str]

    def __repr__(self):
        return f"<hybank.Merged of {len(self.start)} recordings: {len(self.samples)} samples, {self.snr_db:.1f} dB>"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """What a calibration found. Arrays have one value per channel; it is NaN where the spec's value stands.

    Attributes
    ----------
    spec
        The spec with these values and their intervals, as TOML.
    delay, delay_sigma
        Seconds, and their standard deviations.
    gain, gain_sigma
        Gains, and their standard deviations.
    offset, offset_sigma
        Offsets, and their standard deviations.
    cutoff, cutoff_sigma
        Factors of the cut-off frequencies, and their standard deviations.
    reference
        The reference channel, from 1.
    tones
        Tones that were used: ``frequency`` in hertz with a ``value`` and the ``half_width`` of its 95 % interval, the
        Nyquist ``zone`` of the slow rate, from 1, and ``amplitude`` in the reference channel.
    modulus_samples
        Delays are known modulo this many fast periods; None if tones do not leave such a second value.
    frames
        Frames that took part.
    clipped
        Clipped samples of each channel, which were left out.
    misfit
        1 where the model fits to the noise; None if there are no degrees of freedom left.
    nonlinearity
        Coefficients a_2, a_3, .. of each channel, or the entries of its table; none where they do not help. None if they
        were not asked for.
    notes
        What the values mean.
    warnings
        Why they are doubtful. Each is a ``UserWarning``, too.
    """

    spec: str
    delay: NDArray[np.float64]
    delay_sigma: NDArray[np.float64]
    gain: NDArray[np.float64]
    gain_sigma: NDArray[np.float64]
    offset: NDArray[np.float64]
    offset_sigma: NDArray[np.float64]
    cutoff: NDArray[np.float64]
    cutoff_sigma: NDArray[np.float64]
    reference: int
    tones: list[Record]
    modulus_samples: float | None
    frames: int
    clipped: list[int]
    misfit: float | None
    nonlinearity: list[list[float]] | None
    notes: list[str]
    warnings: list[str]

    def __repr__(self):
        misfit = "None" if self.misfit is None else f"{self.misfit:.3f}"
        return f"<hybank.Calibration of {len(self.clipped)} channels: misfit {misfit}>"


@final
@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """The figures of a converter from the record of a tone.

    What was estimated has a ``value`` and the ``half_width`` of its 95 % interval.

    Attributes
    ----------
    samples, left_out, clipped
        Samples of the record, those that are not finite, and those at the rails.
    rate_hertz
        Samples per second.
    converters
        Those that take turns; 1 for a single one.
    full_scale
        Amplitude of full scale.
    offset
        The constant part; of complex samples that of the real parts.
    quadrature
        Of complex samples: the ``offset`` of the imaginary parts, and ``imbalances``, one per tone: the ``gain`` of the
        imaginary part relative to the real one, the error of their quadrature ``phase_radians``, and
        ``image_rejection_db``. None for real samples.
    tones
        ``frequency_hertz`` in its own Nyquist zone, ``alias_hertz`` where the spectrum shows it, ``amplitude``,
        ``level_dbfs``, and ``phase_radians`` at the first sample.
    sinad_db
        Signal over everything else but the constant.
    enob_from_sinad, enob_full_scale
        Effective number of bits, of this tone and of one of full scale.
    snr_db
        Signal over what no line explains.
    thd_db, harmonics
        Harmonics over signal, up to this order.
    thd_straightened_db
        The same without a static nonlinearity of each converter; None where no curve helps.
    interleaving_db
        Interleaving spurs over signal; None for a single converter.
    sfdr_db
        Largest tone over largest line.
    sfdr_without_interleaving_db
        The same without lines that only interleaving explains; None for a single converter.
    noise_density_dbfs_per_hertz
        Noise per hertz relative to a sine of full scale.
    window, noise_bandwidth_bins
        The window of the spectrum, and its equivalent noise bandwidth.
    spurs
        Lines beside the tones, largest first: ``frequency_hertz``, ``amplitude``, ``level_dbc`` relative to the largest
        tone, ``above_noise``, ``causes``, and these as the text ``cause``.
    hidden
        Causes of spurs that cannot be seen, because they coincide with a tone or with the constant.
    unsettled_ends
        ``samples`` at either end that raise the noise by ``raise_db``; None if the ends are as the rest.
    warnings
        What a reader of the figures must know. Each is a ``UserWarning``, too.
    figures
        The figures as a report shows them: name, value, unit, meaning.
    spectrum
        Hertz, and dB relative to full scale.
    """

    samples: int
    left_out: int
    clipped: int
    rate_hertz: float
    converters: int
    full_scale: float
    offset: Record
    tones: list[Record]
    sinad_db: float
    enob_from_sinad: float
    enob_full_scale: float
    snr_db: float
    thd_db: float
    thd_straightened_db: float | None
    harmonics: int
    interleaving_db: float | None
    sfdr_db: float
    sfdr_without_interleaving_db: float | None
    noise_density_dbfs_per_hertz: float
    window: str
    noise_bandwidth_bins: float
    spurs: list[Record]
    hidden: list[Record]
    unsettled_ends: Record | None
    warnings: list[str]
    figures: list[tuple[str, str, str, str]]
    spectrum: tuple[NDArray[np.float64], NDArray[np.float64]]
    quadrature: Record | None = None

    def __repr__(self):
        names = ("sinad_db", "enob_from_sinad", "snr_db", "thd_db", "sfdr_db")
        return f"Measurement({', '.join(f'{name}={getattr(self, name):.2f}' for name in names)})"

    def _repr_html_(self):
        from hybank import _show

        return _show.measured(self)

    @checked
    def plot(self, ax: Any = None) -> Any:
        """Draw the spectrum with its spurs by matplotlib.

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
        >>> m = hb.measure(0.9 * np.cos(0.3 * np.arange(4096)), 48e3)
        >>> ax = m.plot()  # doctest: +SKIP
        """
        from hybank import _show

        return _show.spectrum(self, ax)


@final
@dataclass(frozen=True, slots=True, eq=False)
class Geometry:
    """The geometry that was estimated from tracks.

    Attributes
    ----------
    matches, inliers
        Points that both of the first two views see, and those of them within the threshold of the fundamental matrix.
    sampson_rms
        Root mean square Sampson distance of the inliers, pixels.
    sightings, resection_inliers
        Points from which the virtual camera was estimated, and those of them within the threshold of the camera.
    resection_rms
        Root mean square reprojection error of these, pixels.
    order_agreement
        Share of the guessed calibrations that agree on the order of depth.
    order_by
        What decided the order of depth.
    """

    matches: int
    inliers: int
    sampson_rms: float
    sightings: int
    resection_inliers: int
    resection_rms: float
    order_agreement: float
    order_by: Literal["given", "calibrations", "colours", "both", "nothing"]


@final
@dataclass(frozen=True, slots=True, eq=False, repr=False)
class View:
    """A rendered view.

    Attributes
    ----------
    image
        Intensities 0 to 255: (H, W), or (H, W, 3) if an image has colours.
    depth
        Depth at the virtual camera, NaN in holes: (H, W). Without cameras only its order has a meaning.
    mask
        0 where a view saw the pixel, 1 in cracks, 2 where no view saw it, 3 where only guessed depth shows it: (H, W).
    coverage
        Share of the pixels that samples cover.
    region
        True where the view was rendered: (H, W). Without cameras that is the convex hull of the points.
    geometry
        The estimated geometry of views without cameras; None for others.
    """

    image: NDArray[np.float32]
    depth: NDArray[np.float32]
    mask: NDArray[np.uint8]
    coverage: float
    region: NDArray[np.bool_]
    geometry: Geometry | None
