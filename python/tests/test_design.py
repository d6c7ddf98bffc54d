"""Designs from all kinds of specs, their errors, and interrupts."""

import signal
import threading
import time
from fractions import Fraction

import numpy as np
import pytest

import hybank as hb

TEXT = """\
fast_rate = "48 kS/s"
ratio = 2
latency = 4
target = { filter = { family = "butterworth", order = 4, cutoff = "9 kHz" } }
channel = [{ delay = "25 us" }, { delay = "12.5 us" }]
design = { method = "fir", taps = 16 }
"""


@pytest.fixture(scope="module")
def bank():
    return hb.design(TEXT)


def test_text_path_mapping_and_keywords_give_the_same_bank(bank, tmp_path):
    path = tmp_path / "spec.toml"
    path.write_text(TEXT)
    mapping = {
        "fast_rate": np.float32(48e3),
        "ratio": np.int64(2),
        "latency": 4,
        "target": {"filter": {"family": "butterworth", "order": np.uint8(4), "cutoff": Fraction(9000)}},
        "channel": ({"delay": np.array(25e-6), "noise": None}, {"delay": 12.5e-6}),
        "design": {"method": "fir", "taps": 16, "bits": None},
    }
    keywords = hb.design(
        fast_rate=48e3,
        ratio=2,
        latency=4,
        target=hb.butterworth(4, 9e3),
        channels=[hb.Channel(delay=25e-6), hb.Channel("12.5 us", gain=None)],
        method="fir",
        taps=np.int32(16),
        order=None,
    )
    for other in (hb.design(path), hb.design(str(path)), hb.design(mapping), keywords):
        assert other.to_json() == bank.to_json()
    assert (bank.channels, bank.ratio, bank.latency, bank.method) == (2, 2, 4, "fir")
    assert bank.proven and hb.verify(bank).upper == bank.gamma.upper
    assert hb.design(bank.spec).to_json() == bank.to_json()


def test_every_form_of_a_filter_is_taken(bank):
    poles = np.roots([1, np.sqrt(2), 1]) * 2 * np.pi * 9e3
    gain = float(np.prod(poles).real)
    common = {"fast_rate": 48e3, "ratio": 2, "latency": 4, "channels": [{"delay": 25e-6}, {"delay": 12.5e-6}]}
    forms = [
        hb.butterworth(2, 9e3),
        hb.zpk([], poles, gain),
        hb.tf([gain], np.poly(poles).real),
        hb.cascade(hb.zpk([], poles, gain)),
    ]
    banks = [hb.design(**common, target=form, method="fir", taps=8, proof=False) for form in forms]
    for other in banks[1:]:
        assert other.gamma.norm == pytest.approx(banks[0].gamma.norm, rel=1e-6)
    assert not banks[0].proven
    for form in (
        hb.chebyshev1(3, 9e3, 0.5),
        hb.chebyshev2(3, 9e3, 40),
        hb.elliptic(3, 9e3, 0.5, 40),
        hb.bessel(3, 9e3),
        hb.rc(9e3),
        hb.ss([[-5e4]], [[1.0]], [[5e4]]),
    ):
        assert hb.design(**common, target=form, method="fir", taps=8, proof=False).gamma.norm < 1


KEYWORDS = {
    "fast_rate": 48e3, "ratio": 2, "latency": 4, "target": hb.butterworth(4, 9e3),
    "channels": [hb.Channel(25e-6), hb.Channel(12.5e-6)], "method": "fir", "taps": 16, "proof": False,
}


def test_a_signal_is_a_band_a_filter_or_a_table():
    want = hb.design(f"signal = {{ band = '8 kHz' }}\n{TEXT}", proof=False)
    for signal in (8e3, np.float64(8e3), "8 kHz", (0, 8e3), np.array([0, 8e3]), hb.Signal(8e3), {"band": "8 kHz"}):
        assert hb.design(**KEYWORDS, signal=signal).to_json() == want.to_json()
    without = hb.design(**KEYWORDS, signal=None)
    assert without.to_json() == hb.design(TEXT, proof=False).to_json() and "[signal]" not in without.spec
    # A band-pass filter has a key "band", too.
    for form in (hb.butterworth(3, 8e3), hb.butterworth(2, ("100 Hz", 8e3)), hb.tf([5e4], [1, 5e4])):
        assert hb.design(**KEYWORDS, signal=form).spec == hb.design(**KEYWORDS, signal={"filter": form}).spec
    full = hb.design(**KEYWORDS, signal=hb.Signal(("20 Hz", "8 kHz"), floor_db=60, rms=np.float32(0.125)))
    for words in ('band = ["20 Hz", "8 kHz"]', "floor_db = 60", "rms = 0.125"):
        assert words in full.spec


def test_figures_hold_what_a_wanted_snr_and_the_converters_say():
    channels = [hb.Channel(delay, bits=12, jitter="1 ns") for delay in (25e-6, 12.5e-6)]
    keywords = {**KEYWORDS, "channels": channels, "signal": "8 kHz", "latency": 8, "method": "h2"}
    wanted = hb.design(**{**keywords, "taps": None}, target_snr_db=55)
    figures = wanted.figures()
    assert figures.snr.bits_db is not None and figures.snr.jitter_db is not None and figures.snr.noise_db is None
    assert figures.snr_16_bits_db is None
    assert figures.snr.total_db < figures.snr.signal_db
    fewer = hb.design(**{**keywords, "taps": wanted.taps.shape[1] - 1})
    assert figures.snr.total_db >= 55 > fewer.figures().snr.total_db


@pytest.mark.parametrize(
    "signal, path, words",
    [
        (-8e3, "signal.band", "positive"),
        ("8 kg", "signal.band", "unit|frequency"),
        ((9e3, 8e3), "signal.band", "below its end"),
        ({"bend": 8e3}, "signal", 'did you mean "band"'),
        (hb.Signal(), "signal", "missing"),
        (hb.Signal(8e3, rms=2), "signal.rms", "out of range"),
        (hb.Signal(8e3, floor_db=-3), "signal.floor_db", "out of range"),
        (hb.Signal(8e3, hb.rc(8e3)), "signal.filter", "keep one"),
        (hb.Signal(filter=hb.rc(8e3), floor_db=60), "signal.floor_db", "leave floor_db out"),
        ({**hb.rc(8e3), "cutof": 1}, "signal.filter", "did you mean"),
    ],
)
def test_errors_of_a_signal_are_those_of_the_library(signal, path, words):
    with pytest.raises(hb.SpecError, match=words) as caught:
        hb.design(**KEYWORDS, signal=signal)
    assert caught.value.path == path


def test_negative_delays_count_from_a_period_later():
    text = TEXT.replace("{", "{{").replace("}", "}}").replace("25 us", "{} samples").replace("12.5 us", "{} samples")
    with pytest.warns(UserWarning, match="all count as 1 fast period later"):
        early = hb.design(text.format(0, -0.6))
    late = hb.design(text.format(1, 0.4))
    assert early.latency == late.latency == 4
    assert np.allclose(early.taps, late.taps, rtol=1e-9, atol=1e-12)


def test_errors_of_a_text_have_line_caret_and_remedy():
    with pytest.raises(hb.SpecError) as caught:
        hb.design(TEXT.replace("taps", "tabs"))
    error = caught.value
    assert isinstance(error, hb.HybankError) and isinstance(error, ValueError)
    assert (error.line, error.column) == (6, 28) and 'did you mean "taps"' in str(error)
    assert "^^^^" in str(error).splitlines()[-1]


@pytest.mark.parametrize(
    "change, path, words",
    [
        ({"ratio": 2.5}, "ratio", "whole"),
        ({"ratio": None}, "", "missing"),
        ({"fast_rate": float("inf")}, "fast_rate", "out of range"),
        ({"fast_rate": np.nan}, "fast_rate", "NaN"),
        ({"channel": [{"delay": np.inf}]}, "channel[0].delay", "out of range"),
        ({"channel": [{"delay": True}]}, "channel[0].delay", "found true"),
        ({"design": {"method": "fur"}}, "design.method", 'did you mean "fir"'),
        ({"target": {"filter": {"num": np.array([1.0]), "den": np.array([1.0])}}}, "target.filter.den", "no pole"),
    ],
)
def test_errors_of_a_mapping_carry_their_path(change, path, words):
    spec = {
        "fast_rate": 48e3,
        "ratio": 2,
        "target": {"filter": hb.butterworth(4, 9e3)},
        "channel": [{"delay": 25e-6}, {"delay": 12.5e-6}],
        **change,
    }
    with pytest.raises(hb.SpecError, match=words) as caught:
        hb.design(spec)
    assert caught.value.path.startswith(path) and caught.value.line is None


def test_what_is_no_spec_is_a_type_error():
    for source in (3.5, [1], {1: 2}, {"channel": [None]}, {"ratio": object()}):
        with pytest.raises(TypeError):
            hb.design(source)
    with pytest.raises(TypeError, match="not both"):
        hb.design(TEXT, taps=3)


def test_implausible_specs_warn_at_the_line_of_the_caller():
    with pytest.warns(UserWarning, match="Nyquist") as caught:
        hb.design(TEXT.replace("9 kHz", "90 Hz"), proof=False)
    assert caught[0].filename == __file__


def test_progress_is_reported():
    steps = []
    hb.design(TEXT, progress=steps.append)
    assert any("filters" in step for step in steps)

    class Enough(Exception):
        pass

    def refuse(step):
        raise Enough

    with pytest.raises(Enough):
        hb.design(TEXT, progress=refuse)


LONG = TEXT.replace("taps = 16", "taps = 1200").replace("latency = 4", "latency = 600")


@pytest.fixture
def keyboard_interrupts():
    # Shells start jobs in the background with SIGINT ignored, and Python leaves that so.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.mark.skipif(not hasattr(signal, "pthread_kill"), reason="needs signals")
@pytest.mark.usefixtures("keyboard_interrupts")
def test_ctrl_c_interrupts_a_long_design_at_once():
    main = threading.main_thread().ident
    timer = threading.Timer(0.5, lambda: signal.pthread_kill(main, signal.SIGINT))
    timer.start()
    begin = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        hb.design(LONG, limit=False)
    assert time.monotonic() - begin < 2


def _stream(bank, x):
    s = bank.stream()
    s.process(x)
    s.flush()


@pytest.mark.parametrize(
    "run",
    [lambda bank, _: hb.design(TEXT.replace("taps = 16", "taps = 64"), proof=False), lambda bank, x: bank.fuse(x), _stream],
    ids=["design", "fuse", "stream"],
)
def test_other_threads_run_meanwhile(bank, run):
    """While it runs, another thread of Python counts."""
    counted = 0
    done = threading.Event()
    x = np.zeros((2, 20_000_000), "f4")

    def count():
        nonlocal counted
        while not done.is_set():
            counted += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    run(bank, x)
    done.set()
    thread.join()
    assert counted > 3
