"""Specs as Python writes them: mappings with the keys of a spec file. Everything is checked by the Rust library."""

from collections.abc import Mapping

from hybank._hybank import design as _design

_DESIGN_KEYS = (
    "method", "taps", "target_snr_db", "gamma_margin", "solver", "bits", "fraction_bits", "order",
    "reduction_loss_db", "noise", "tracking",
)
# Every form of a filter has one of these keys.
_FILTER_KEYS = ("family", "num", "den", "zeros", "poles", "a", "cascade")


def _given(**entries):
    return {key: value for key, value in entries.items() if value is not None}


def design(source=None, /, *, proof=True, limits=True, progress=None, **keywords):
    """Design the bank of a spec: a path, a TOML text of several lines, a mapping, or keywords.

    Keywords are those of a spec file, with ``channels`` for the list of channels, a filter for ``target``, a band, a
    filter or a ``Signal`` for ``signal``, and the keys of the table ``[design]`` beside the others. ``progress(step, seconds)`` is called for every step, with the
    estimated seconds of the whole design. Ctrl-C interrupts it.
    """
    if source is None:
        source = _of_keywords(keywords)
    elif keywords:
        raise TypeError(f"give a spec or keywords, not both: {', '.join(ascii(key)[:200] for key in keywords)}")
    return _design(source, proof=proof, limits=limits, progress=progress)


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
    """The analog signal: its band (the highest frequency, or two in hertz or with units), or its spectrum as a filter.

    ``floor_db`` says how far the spectrum is down outside the band, ``rms`` how large the signal is, of full scale.
    """

    def __init__(self, band=None, filter=None, *, floor_db=None, rms=None):
        super().__init__(_given(band=band, filter=filter, floor_db=floor_db, rms=rms))


class Channel(dict):
    """One slow converter: its delay in seconds (or as a text with a unit), and what differs from the default."""

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


def butterworth(order, cutoff):
    """Low-pass with the flattest magnitude; -3 dB at ``cutoff`` hertz. Two frequencies make a band-pass."""
    return _given(family="butterworth", order=order, **_passband(cutoff))


def chebyshev1(order, cutoff, ripple_db):
    """Low-pass with equal ripples up to ``cutoff`` hertz. Two frequencies make a band-pass."""
    return _given(family="chebyshev1", order=order, ripple_db=ripple_db, **_passband(cutoff))


def chebyshev2(order, cutoff, attenuation_db):
    """Low-pass with equal ripples from ``cutoff`` hertz on. Two frequencies make a band-pass."""
    return _given(family="chebyshev2", order=order, attenuation_db=attenuation_db, **_passband(cutoff))


def elliptic(order, cutoff, ripple_db, attenuation_db):
    """Low-pass with equal ripples in both bands. Two frequencies make a band-pass."""
    return _given(
        family="elliptic", order=order, ripple_db=ripple_db, attenuation_db=attenuation_db, **_passband(cutoff)
    )


def bessel(order, cutoff):
    """Low-pass with the flattest group delay. Two frequencies make a band-pass."""
    return _given(family="bessel", order=order, **_passband(cutoff))


def rc(cutoff):
    """One pole at ``cutoff`` hertz. Two frequencies make the resonator with -3 dB there."""
    return _given(family="rc", **_passband(cutoff))


def tf(num, den):
    """A transfer function: coefficients in descending powers of s (rad/s)."""
    return _given(num=num, den=den)


def zpk(zeros, poles, gain):
    """A transfer function: zeros and poles in rad/s, complex or as pairs, and the factor before them."""
    return _given(zeros=_roots(zeros), poles=_roots(poles), gain=gain)


def _roots(roots):
    return [(complex(root).real, complex(root).imag) if not hasattr(root, "__len__") else root for root in roots]


def ss(a, b, c):
    """A state space dx/dt = a x + b f, out = c x."""
    return _given(a=a, b=b, c=c)


def cascade(*stages):
    """Filters one after the other."""
    return {"cascade": list(stages)}
