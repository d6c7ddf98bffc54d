"""What is done with banks and captures beside fusing them."""

import functools
import inspect
import os

import numpy as np

from hybank import _hybank, _inputs
from hybank._keywords import checked, need_numbers
from hybank._results import Comparison


@checked
def load(path):
    """Reads a bank file.

    Parameters
    ----------
    path : str or os.PathLike
        The bank file, as `hybank design` and `Bank.save` write it.

    Returns
    -------
    Bank

    Examples
    --------
    >>> bank = hb.load("thesis-fir.json")
    >>> bank.ratio, bank.latency
    (2, 10)
    """
    return _hybank.load(path)


@checked
def verify(bank, *, search=False):
    """Prove the gamma of a bank, from its spec and its coefficients alone.

    Parameters
    ----------
    bank : Bank or str or os.PathLike
        A bank, or the path of its file, whose digest is checked too.
    search : bool
        Look for a proof if the bank has none.

    Returns
    -------
    Verified
        Proven bounds of gamma.

    Raises
    ------
    HybankError
        The bank has no proof, or the proof fails.

    Examples
    --------
    >>> proof = hb.verify("thesis-fir.json")
    >>> proof.attained <= proof.upper, proof.digest
    (True, True)
    """
    return _hybank.verify(bank, search)


@checked
def analyze(bank, *, delay_error=None, delay_box=None, gain_box=None, cutoff_box=None, reference=None):
    """The error of a bank, with its own delays or with others, and its worst case over boxes of errors.

    Parameters
    ----------
    bank : Bank or str or os.PathLike
        A bank, or the path of its file.
    delay_error : float or str or list, optional
        True delays minus those of the bank: seconds or texts such as "10ps", one for all or one per channel.
    delay_box, gain_box, cutoff_box : float or str or list, optional
        Bound the worst case over delays (seconds or "10ps"), gains and cut-offs (0.01 or "1%") that are off by up to
        this much, one value for all channels but the reference or one per channel.
    reference : int or "none", optional
        The channel, from 1, to which the errors are relative; the first one where one value is given for all.

    Returns
    -------
    Analysis

    Examples
    --------
    >>> found = hb.analyze(bank, delay_box=0.01)
    >>> found.gamma <= found.worst_case.attained <= found.worst_case.upper
    True
    """
    return _hybank.analyze(bank, delay_error, delay_box, gain_box, cutoff_box, reference)


@checked
def simulate(
    source, signal, *, imaginary=None, channel=None, samples=None, gain=1.0, rate=None, noise=0.0, bits=None, jitter=None,
    drift=None, delay_error=None, gain_error=None, cutoff_error=None, offset=None, seed=0
):
    """What virtual converters capture of an analog signal.

    Parameters
    ----------
    source : Bank or str or os.PathLike or mapping
        A bank or a spec.
    signal : str or array_like
        ``step@0.3``, ``tones:440Hz,1kHz``, ``chirp:50Hz..8kHz@2s``, ``ctones:-2kHz`` or a sum of them with ``+``; the
        name of a recording (.wav); or samples of a periodic, band-limited signal.
    imaginary : str or array_like, optional
        The imaginary part of a complex signal.
    channel : int, optional
        The channel of a recording, from 1.
    samples : int, optional
        Fast samples, rounded up to whole frames; to the end of the signal, at least 200, if left out.
    gain : float
        Factor of the analog signal.
    rate : float, optional
        Rate of given samples in hertz; the fast rate if left out.
    noise : float
        Rms of white noise on every sample, of full scale.
    bits : int, optional
        Round to so many bits, 2 to 24.
    jitter : float or str, optional
        Aperture jitter, rms: seconds, "2ps" or "0.01samples".
    drift : float or list, optional
        Parts per million by which the clocks are too fast.
    delay_error : float or str or list, optional
        True delays minus those of the spec.
    gain_error, cutoff_error : float or str or list, optional
        Relative errors: 0.01 or "1%".
    offset : float or list, optional
        Added to the offsets of the spec, of full scale.
    seed : int
        Of noise and jitter.

    Returns
    -------
    Capture
        ``channels`` (N, T), ``target`` (M T,) on the time axis of ``Bank.fuse``, and ``clipped``.

    Examples
    --------
    >>> ideal = hb.simulate(bank, "tones:0.3", samples=400)
    >>> real = hb.simulate(bank, "tones:0.3", samples=400, bits=8, gain_error=["1%", 0])
    >>> ideal.channels.shape, bool((real.channels[0] != ideal.channels[0]).any())
    ((2, 200), True)
    """
    need_numbers(drift=drift, offset=offset, rate=rate)
    if _inputs.is_file(signal):
        captures = _inputs.read(signal, channel=channel)
        signal, rate = captures.mono(), captures.rate if rate is None else rate
        if not _is_hertz(source):
            rate = None
    elif channel is not None:
        raise _hybank.HybankError("channel: the signal is no recording; leave it out")
    return _hybank.simulate(
        source, signal, imaginary, samples, gain, rate, noise, bits, jitter, drift, delay_error, gain_error, cutoff_error,
        offset, seed,
    )


def _is_hertz(source):
    """False for a bank in normalised time, whose recordings have any rate."""
    return not isinstance(source, _hybank.Bank) or source.fast_period != 1.0


@checked
def align(x, spec, *, reference=None, within=None, axis=-1):
    """When recordings began, how their clocks drift, their polarities, gains and offsets.

    Parameters
    ----------
    x : list of array_like, or array_like, shape (N, T), or list of files
        One recording per channel, in a list of any lengths, of a broad sound (noise, speech, music).
    spec : Bank or str or os.PathLike or mapping
        The nominal values.
    reference : int, optional
        The channel whose clock is the time, from 1.
    within : float, optional
        How far apart the recordings began at most, in seconds.
    axis : int
        The axis of time of an array.

    Returns
    -------
    Alignment
        The spec with these values, and the samples to leave out.

    Examples
    --------
    >>> sound = "tones:" + ",".join(f"{100 * 1.07**k:.1f}Hz" for k in range(65))
    >>> spec = {"fast_rate": 48e3, "ratio": 2, "target": {"filter": hb.butterworth(4, 9e3)},
    ...         "channel": [hb.Channel(delay=25e-6), hb.Channel(delay=12.5e-6)]}
    >>> recorded = hb.simulate(spec, sound, samples=48_000).channels
    >>> hb.align([recorded[0][500:], recorded[1]], spec).skip
    [0, 500]
    """
    return _hybank.align(_inputs.recordings(x, axis, spec), spec, reference, within)


@checked
def merge(x, rate=None, *, times=None, output_rate=None, band=None, flat=False, within=None):
    """One recording of several of one event, by recorders with clocks of their own, at a higher rate.

    Parameters
    ----------
    x : list of array_like, or list of files
        One recording each, of any length. The clock of the first is that of the result.
    rate : float or list of float, optional
        Samples per second, of all or of each. Files, and samples with times, have theirs.
    times : list of array_like, optional
        When the samples of each recording were taken, in seconds on one clock.
    output_rate : float, optional
        Samples per second of the result.
    band : float, optional
        The highest frequency of the signal, in hertz; measured if left out.
    flat : bool
        Take the spectrum as flat over the band.
    within : float, optional
        How far apart the recordings began at most, in seconds.

    Returns
    -------
    Merged

    Examples
    --------
    >>> times = [np.arange(2000) / 100, np.arange(2000) / 100 + 3.3e-3]
    >>> f = np.arange(0.5, 60, 0.73)
    >>> sensors = [np.cos(2 * np.pi * np.outer(t, f) + f**2).sum(1) for t in times]
    >>> merged = hb.merge(sensors, times=times, output_rate=200)
    >>> merged.rate, merged.one_suffices
    (200.0, None)
    """
    x, rates = _inputs.with_rates(x, rate, times)
    times = None if times is None else [np.asarray(one, float).tolist() for one in times]
    return _hybank.merge(x, rates, times, output_rate, band, flat, within)


@checked
def calibrate(
    x, spec, *, tones=None, waveform=None, rate=None, blind=False, fit=("delay", "gain", "offset"), reference=None,
    clip=None, interleaved=None, axis=-1, full_scale=None, nonlinearity=None
):
    """Delays, gains and offsets of the channels from captures, with their standard deviations.

    Parameters
    ----------
    x : array_like, shape (N, T), or list of files
        The captures. Dimensions with names, and columns of a DataFrame, may stand in any order.
    spec : Bank or str or os.PathLike or mapping
        The nominal values.
    tones : list of float or str, optional
        Frequencies of the tones that the captures hold, hertz or texts such as "1.2kHz"; found if left out.
    waveform : array_like, optional
        The waveform that was played, in place of tones.
    rate : float, optional
        Its rate in hertz; the fast rate if left out.
    blind : bool
        The captures hold any signal that leaves fewer aliases occupied than there are channels.
    fit : list of str
        "delay", "gain", "offset", "cutoff", or "cutoff:2" for the second stages of cascades.
    reference : int, optional
        The channel, from 1, to which the others are relative.
    clip : float, optional
        Samples of this size and more are left out. Otherwise those at the ends of their range are: that of integers, and
        1 for floats none of which is beyond.
    interleaved : int, optional
        x is one recording in which so many converters take turns.
    axis : int
        The axis of time.
    full_scale : float or str, optional
        Full scale of the converters: "12bits", "u12bits" or a number; that of the spec or its bits if left out.

    nonlinearity : int or "table", optional
        Also find the static nonlinearity of each converter by tones: a polynomial up to this order (2 to 32), or a table
        with a value for each code.

    Returns
    -------
    Calibration

    Examples
    --------
    >>> capture = hb.simulate(bank, "tones:0.3,1.1", samples=2000, delay_error=[0, 0.01], noise=1e-6)
    >>> found = hb.calibrate(capture.channels, bank, tones=[0.3 / 6.283185307, 1.1 / 6.283185307])
    >>> float(found.delay[1].round(4)), found.reference
    (0.61, 1)
    """
    need_numbers(rate=rate)
    # A spec may be a mapping or a path; the order of its converters is that of their delays.
    x, axis = _inputs.plain(x, axis, spec, interleaved)
    return _hybank.calibrate(
        x, spec, tones, waveform, rate, blind, list(fit), reference, clip, axis, full_scale, nonlinearity
    )


@checked
def measure(
    y, rate=None, *, ref=None, tones=None, interleaved=1, harmonics=10, full_scale=None, window="bh7", skip=0
):
    """The quality of a record of a tone, or its error against a reference.

    Parameters
    ----------
    y : array_like, shape (T,), or file
        The record.
    rate : float, optional
        Samples per second; a file states it, an array needs it.
    ref : array_like or file, optional
        A record of the same signal to compare with, of the same rate.
    tones : list of float or str, optional
        Tones of the record, hertz or texts such as "9kHz"; the largest one if left out.
    interleaved : int
        Converters that take turns in the record: tells which spurs are interleaving spurs.
    harmonics : int
        Highest order of the harmonics in THD.
    full_scale : float or str, optional
        Full scale of the converter: "12bits", "u12bits" or a number; figures are those of samples of full scale 1.
    window : {"bh7", "bh4", "hann", "none"}
        Window of the spectrum.
    skip : int
        Samples at either end that are not measured.

    Returns
    -------
    Measurement, or Comparison with ``ref``

    Examples
    --------
    >>> import numpy as np
    >>> n = np.arange(4096)
    >>> m = hb.measure(0.9 * np.cos(0.3 * n) + 1e-3 * np.cos(0.6 * n), 48e3)
    >>> round(m.thd_db, 1)
    -59.1
    >>> c = hb.measure(np.cos(0.3 * n), 48e3, ref=0.5 * np.cos(0.3 * n))
    >>> round(c.gain.value, 6)
    2.0
    """
    need_numbers(rate=rate)
    y, rate = _inputs.record(y, rate)
    if ref is None:
        return _hybank.measure(y, rate, tones, interleaved, harmonics, full_scale, window, skip)
    if tones is not None:
        raise _hybank.HybankError("tones: a comparison measures no tones; call measure without ref for them")
    ref, _ = _inputs.record(ref, rate)
    found, spectrum = _hybank.compare(y, ref, rate, window, skip, full_scale)
    return Comparison(**dict(found), spectrum=spectrum)


@checked
def import_taps(spec, taps, *, latency=None, proof=True):
    """The bank of FIR filters from another tool, with its gamma and the proof.

    Parameters
    ----------
    spec : Bank or str or os.PathLike or mapping
        Front ends, delays, rates and latency; its design settings do not matter.
    taps : array_like, shape (N, L)
        Taps at the fast rate, a row for each channel.
    latency : int, optional
        Fast samples, in place of that of the spec.
    proof : bool
        Search a proof of gamma.

    Returns
    -------
    Bank

    Examples
    --------
    >>> same = hb.import_taps(bank, bank.taps)
    >>> abs(same.gamma.norm / bank.gamma.norm - 1) < 1e-6
    True
    """
    import numpy as np

    return _hybank.import_taps(spec, np.asarray(taps, float).tolist(), latency, proof)


# What the ending of a name says that is to be written.
_BY_ENDING = {"h": "c", "v": "verilog", **{name: name for name in ("csv", "mat", "coe", "mem")}}


def format_by_name(export):
    """``Bank.export`` that takes the format from the name of the file if none is given, as the command line does."""

    @functools.wraps(export)
    def call(self, path, *, format=None, **keywords):
        if format is None:
            ending = os.path.splitext(os.fspath(path))[1][1:].lower()
            if ending not in _BY_ENDING:
                raise _hybank.HybankError(
                    f"{os.fspath(path)}: the name does not say which format it is to have; give format=\"c\", \"verilog\", "
                    '"csv", "mat", "coe", "mem" or "sos"'
                )
            format = _BY_ENDING[ending]
        return export(self, path, format=format, **keywords)

    shown = inspect.signature(export)
    parameters = [one.replace(default=None) if one.name == "format" else one for one in shown.parameters.values()]
    call.__signature__ = shown.replace(parameters=parameters)
    return checked(call)
