"""Specs as Python writes them: mappings with the keys of a spec file. Everything is checked by the Rust library."""

from collections.abc import Mapping

from hybank._hybank import design as _design
from hybank._keywords import checked

_DESIGN_KEYS = (
    "method", "taps", "target_snr_db", "target_sfdr_db", "gamma_margin", "bits", "fraction_bits", "loss_db",
    "order", "reduction_loss_db", "noise",
)
# Every form of a filter has one of these keys.
_FILTER_KEYS = ("family", "num", "den", "zeros", "poles", "a", "cascade")


def _given(**entries):
    return {key: value for key, value in entries.items() if value is not None}


@checked
def design(
    source=None, /, *, name=None, fast_rate=None, fast_period=None, ratio=None, latency=None, target=None, channels=None,
    channel=None, signal=None, uncertainty=None, full_scale=None, fit=None, design=None, method=None, taps=None,
    target_snr_db=None, target_sfdr_db=None, gamma_margin=None, bits=None, fraction_bits=None, loss_db=None,
    order=None, reduction_loss_db=None, noise=None, replace=None, proof=True, limit=True, progress=None
):
    """Design the bank of a spec: a path, a TOML text of several lines, a mapping, or keywords.

    The keywords are the keys of a spec file. Ctrl-C interrupts the design.

    Parameters
    ----------
    source : str or os.PathLike or mapping, optional
        A spec; leave it out to give keywords.
    name : str, optional
        Name of the spec.
    fast_rate, fast_period : float or str, optional
        Rate of the output in hertz, or its period in seconds; one of them.
    ratio : int, optional
        M, fast samples per slow sample.
    latency : int, optional
        Latency in fast samples; chosen if left out.
    target : dict
        Filter of the ideal fast converter: `butterworth`, `tf`, `zpk`, ..
    channels, channel : list of Channel
        The converters; two names of one key.
    signal : float or str or pair or dict or Signal, optional
        The band of the signal, or the filter of its spectrum.
    uncertainty : dict, optional
        Half-widths of 95 % intervals: `delay`, `gain`, `cutoff`, `offset`, `reference`.
    full_scale : float or str, optional
        Full scale of captures whose format does not say it.
    fit : list of str, optional
        What `calibrate` fits.
    design : dict, optional
        The keys below as a table.
    method : {"fir", "iir", "h2", "sinc", "separation"}, optional
        Design method.
    taps : int, optional
        Taps per channel.
    target_snr_db : float, optional
        In place of taps: the fewest taps for this signal-to-noise ratio.
    target_sfdr_db : float, optional
        The same for the distance of the largest image of a tone.
    gamma_margin : float, optional
        Share by which gamma may exceed its minimum.
    bits : int or list, optional
        Integer taps of so many bits.
    fraction_bits : int, optional
        A tap is its integer times 2^-fraction_bits.
    loss_db : float, optional
        Integer taps of the fewest bits that lose at most so many decibels of SNR.
    order : int, optional
        At most so many states (methods iir and h2).
    reduction_loss_db : float, optional
        The fewest states whose error is at most so many decibels above that of the full bank.
    noise : float, optional
        Noise of all converters.
    replace : dict, optional
        With `source`: `latency` and the keys from `method` on, in place of those of the spec.
    proof : bool
        Search a proof of gamma.
    limit : bool
        End the design after ten minutes with the best bank so far.
    progress : callable, optional
        ``progress(step)`` is called for every step.

    Returns
    -------
    Bank

    Examples
    --------
    >>> bank = hb.design(
    ...     fast_rate=48e3, ratio=2, target=hb.butterworth(4, 9e3), channels=[hb.Channel(25e-6), hb.Channel(12.5e-6)],
    ...     latency=4, method="fir", taps=8,
    ... )
    >>> bank.method, bank.taps.shape
    ('fir', (2, 8))
    """
    given = dict(locals())
    keywords = {
        key: value for key, value in given.items()
        if value is not None and key not in ("source", "replace", "proof", "limit", "progress")
    }
    replaced = dict(replace or {})
    latency = replaced.pop("latency", None)
    if source is None:
        if replace is not None:
            raise TypeError("replace: it changes the keys of a spec; give a spec, or the keys themselves")
        source = _of_keywords(keywords)
    elif keywords:
        raise TypeError(
            f"give a spec or keywords, not both: {', '.join(keywords)}; replace={{..}} changes keys of [design]"
        )
    return _design(source, replaced, latency, proof, limit, progress)


def _of_keywords(keywords):
    spec = {key: value for key, value in keywords.items() if key not in _DESIGN_KEYS}
    if "channels" in spec:
        spec["channel"] = spec.pop("channels")
    target = spec.get("target")
    if target is not None and "filter" not in target:
        spec["target"] = {"filter": target}
    if spec.get("signal") is not None:
        spec["signal"] = _signal(spec["signal"])
    table = {key: keywords[key] for key in _DESIGN_KEYS if key in keywords}
    return {**spec, "design": {**spec.get("design", {}), **table}}


def _signal(given):
    """The table ``[signal]``: of a band, of a filter, or as it is."""
    if not isinstance(given, Mapping):
        return Signal(given)
    # The filter of a band-pass has a key ``band``, too.
    return Signal(filter=given) if any(key in given for key in _FILTER_KEYS) else given


class Signal(dict):
    """The analog signal: its band, or its spectrum as a filter.

    Parameters
    ----------
    band : float or str or pair, optional
        The highest frequency, or two, in hertz or with units.
    filter : dict, optional
        The spectrum as a filter.
    floor_db : float, optional
        How far the spectrum is down outside of the band.
    rms : float, optional
        How large the signal is, of full scale.

    Examples
    --------
    >>> hb.Signal("8 kHz", floor_db=60)
    {'band': '8 kHz', 'floor_db': 60}
    """

    @checked
    def __init__(self, band=None, filter=None, *, floor_db=None, rms=None):
        super().__init__(_given(band=band, filter=filter, floor_db=floor_db, rms=rms))


class Channel(dict):
    """One slow converter, and what differs from the default.

    Parameters
    ----------
    delay : float or str, optional
        Seconds, or a text with a unit.
    filter : dict, optional
        The front end; that of the target if left out.
    delay_samples : float, optional
        The delay in fast samples.
    rate : float or str, optional
        The converter's own sample rate.
    noise : float, optional
        Rms of its noise, of full scale.
    bits : int, optional
        Its bits.
    jitter : float or str, optional
        Its aperture jitter, rms.
    gain, offset : float, optional
        It delivers gain x + offset.

    Examples
    --------
    >>> hb.Channel(25e-6, bits=12)
    {'delay': 2.5e-05, 'bits': 12}
    """

    @checked
    def __init__(
        self, delay=None, filter=None, *, delay_samples=None, rate=None, noise=None, bits=None, jitter=None, gain=None,
        offset=None
    ):
        super().__init__(
            _given(
                delay=delay, filter=filter, delay_samples=delay_samples, rate=rate, noise=noise, bits=bits,
                jitter=jitter, gain=gain, offset=offset,
            )
        )


def _passband(cutoff):
    """One frequency is the cutoff of a low-pass, two are the edges of a band-pass, as in scipy.signal."""
    is_band = isinstance(cutoff, (list, tuple)) or getattr(cutoff, "ndim", 0) == 1
    return {"band": list(cutoff)} if is_band else {"cutoff": cutoff}


_FAMILY = """{summary}

    Parameters
    ----------
    order : int
        Poles of the low-pass; a band-pass has twice as many.
    cutoff : float or str or pair
        {cutoff}; two frequencies make a band-pass. Hertz, or texts with units.
{more}
    Returns
    -------
    dict

    Examples
    --------
    >>> hb.{name}({example})["family"]
    '{name}'
    """


def _family(summary, cutoff, example, **more):
    """Documents a family of filters, whose pages differ in a few words."""

    def documented(function):
        lines = "".join(f"    {key} : float\n        {text}.\n" for key, text in more.items())
        page = _FAMILY.format(summary=summary, cutoff=cutoff, more=lines, name=function.__name__, example=example)
        function.__doc__ = page if function.__name__ != "rc" else page.replace(
            "    order : int\n        Poles of the low-pass; a band-pass has twice as many.\n", ""
        )
        return checked(function)

    return documented


@_family("Low-pass with the flattest magnitude.", "Where it is at -3 dB", "4, 9e3")
def butterworth(order, cutoff):
    return _given(family="butterworth", order=order, **_passband(cutoff))


@_family("Low-pass with equal ripples in the pass band.", "End of the ripples", "4, 9e3, 0.5", ripple_db="Size of the ripples")
def chebyshev1(order, cutoff, ripple_db):
    return _given(family="chebyshev1", order=order, ripple_db=ripple_db, **_passband(cutoff))


@_family(
    "Low-pass with equal ripples in the stop band.", "Begin of the stop band", "3, 9e3, 40",
    attenuation_db="Least attenuation there",
)
def chebyshev2(order, cutoff, attenuation_db):
    return _given(family="chebyshev2", order=order, attenuation_db=attenuation_db, **_passband(cutoff))


@_family(
    "Low-pass with equal ripples in both bands.", "End of the pass band", "3, 9e3, 0.5, 40",
    ripple_db="Size of the ripples in the pass band", attenuation_db="Least attenuation in the stop band",
)
def elliptic(order, cutoff, ripple_db, attenuation_db):
    return _given(
        family="elliptic", order=order, ripple_db=ripple_db, attenuation_db=attenuation_db, **_passband(cutoff)
    )


@_family("Low-pass with the flattest group delay.", "Where its phase is half of that at high frequencies", "4, 9e3")
def bessel(order, cutoff):
    return _given(family="bessel", order=order, **_passband(cutoff))


@_family("One pole, or with two frequencies a resonator.", "Where it is at -3 dB", "9e3")
def rc(cutoff):
    return _given(family="rc", **_passband(cutoff))


@checked
def tf(num, den):
    """A transfer function.

    Parameters
    ----------
    num, den : array_like
        Coefficients in descending powers of s (rad/s).

    Returns
    -------
    dict

    Examples
    --------
    >>> hb.tf([1], [1, 2, 1])
    {'num': [1], 'den': [1, 2, 1]}
    """
    return _given(num=num, den=den)


@checked
def zpk(zeros, poles, gain):
    """A transfer function by its roots.

    Parameters
    ----------
    zeros, poles : array_like
        Roots in rad/s, complex or as pairs.
    gain : float
        The factor before them.

    Returns
    -------
    dict

    Examples
    --------
    >>> hb.zpk([], [-1 + 1j, -1 - 1j], 2)["poles"]
    [(-1.0, 1.0), (-1.0, -1.0)]
    """
    return _given(zeros=_roots(zeros), poles=_roots(poles), gain=gain)


def _roots(roots):
    return [(complex(root).real, complex(root).imag) if not hasattr(root, "__len__") else root for root in roots]


@checked
def ss(a, b, c):
    """A state space dx/dt = a x + b f, out = c x.

    Parameters
    ----------
    a, b, c : array_like
        The matrices.

    Returns
    -------
    dict

    Examples
    --------
    >>> hb.ss([[-1]], [[1]], [[1]])
    {'a': [[-1]], 'b': [[1]], 'c': [[1]]}
    """
    return _given(a=a, b=b, c=c)


@checked
def cascade(*stages):
    """Filters one after the other.

    Parameters
    ----------
    *stages : dict
        The filters.

    Returns
    -------
    dict

    Examples
    --------
    >>> len(hb.cascade(hb.rc(9e3), hb.rc(20e3))["cascade"])
    2
    """
    return {"cascade": list(stages)}
