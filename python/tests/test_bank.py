"""Banks: files, matrices, response, bounds."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest
from conftest import ROOT
from oracles import polyphase_sum

import hybank as hb


def test_a_bank_keeps_every_bit_through_files_and_pickles(fir, iir, filters, tmp_path):
    for bank, name in [(fir, "thesis-fir"), (iir, "thesis-iir")]:
        path = tmp_path / "bank.json"
        bank.save(path)
        assert hb.load(path) == bank == hb.Bank.from_json(bank.to_json())
        assert pickle.loads(pickle.dumps(bank)) == bank == copy.deepcopy(bank)
        assert hb.load(str(path)).to_json() == bank.to_json()
        with pytest.raises(FileExistsError, match="overwrite"):
            bank.save(path, overwrite=False)
    assert fir != iir and fir != 1


def test_the_matrices_drive_scipy(fir, iir, random):
    signal = pytest.importorskip("scipy.signal")
    x = random.standard_normal((2, 200))
    for bank in (fir, iir):
        system = signal.dlti(*bank.ss, dt=bank.ratio * bank.fast_period)
        _, y, _ = signal.dlsim(system, x.T)
        causal = bank.fuse(x, keep_latency=True)
        np.testing.assert_allclose(y.reshape(-1), causal, atol=1e-10)
    assert iir.taps is None
    np.testing.assert_allclose(polyphase_sum(fir.taps, fir.ratio, x), fir.fuse(x, keep_latency=True), atol=1e-13)


def test_the_one_line_of_upfirdn(fir, random):
    upfirdn = pytest.importorskip("scipy.signal").upfirdn
    x = random.standard_normal((2, 300))
    y = sum(upfirdn(f, xi, up=fir.ratio) for f, xi in zip(fir.taps, x, strict=True))
    want = y[fir.latency : fir.latency + 300 * fir.ratio]
    np.testing.assert_allclose(fir.fuse(x), want, atol=1e-13)


def test_arrays_of_a_bank_are_read_only(fir):
    for array in (fir.taps, fir.delays, fir.gains, fir.offsets, *fir.ss):
        assert not array.flags.writeable
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


def test_the_error_response_stays_below_gamma_and_reaches_it(fir, iir):
    for bank in (fir, iir):
        frequency, gain = bank.error_response(2000)
        assert frequency[0] == 0 and frequency[-1] == pytest.approx(0.5 / (bank.fast_period * bank.ratio))
        assert gain.max() <= bank.gamma.upper
        assert gain.max() > 0.999 * bank.gamma.norm
        assert bank.gamma.noncausal <= bank.gamma.lower <= bank.gamma.upper


def test_figures_are_those_of_the_error_and_beat_a_spline(fir):
    figures = fir.figures()
    found = hb.analyze(fir)
    # The target 0.25 / (s + 0.5)^2 passes white noise with the variance 1/8.
    assert figures.snr.total_db == pytest.approx(20 * np.log10(np.sqrt(0.125) / found.rms_error), abs=0.01)
    assert figures.snr.signal_db == figures.snr.total_db and figures.snr.noise_db is figures.any_input is None
    low, high = figures.band.low_hertz, figures.band.high_hertz
    assert low == 0 and high > 0 and low <= figures.image.hertz <= high
    assert figures.image.db < 0 and figures.gain_error.db < 0
    assert {one.way for one in figures.usual_ways} == {"one-channel", "interleaving", "own-correction", "cubic-spline", "least-squares"}
    assert figures.gain_over_usual_ways_db == pytest.approx(figures.snr_16_bits_db - figures.usual_ways[0].snr_db)


def test_verify_and_analyze_agree_with_the_bank(fir, filters, tmp_path):
    proof = hb.verify(filters / "thesis-fir.json")
    assert proof.digest and proof.certificate_in_file
    assert fir.proven and proof.attained <= fir.gamma.norm <= proof.upper == fir.gamma.upper
    assert hb.verify(fir).digest is None
    found = hb.analyze(fir)
    assert found.gamma == pytest.approx(fir.gamma.norm, rel=1e-8)
    # The noise gain by its definition.
    assert found.noise_gain == pytest.approx(np.sqrt((fir.taps**2).sum() / fir.ratio), rel=1e-12)
    assert hb.analyze(fir, delay_error=np.zeros(2)).gamma == found.gamma
    assert hb.analyze(fir, delay_error=np.array([0.3, -0.3])).gamma > 1.5 * found.gamma
    altered = tmp_path / "bank.json"
    text = fir.to_json()
    number = text[text.index('"taps": [') + 9 :].split(",")[0]
    altered.write_text(text.replace(number, f"{float(number) + 1e-9!r}", 1))
    with pytest.raises(hb.HybankError, match="altered"):
        hb.verify(altered)
    with pytest.raises(hb.HybankError, match="one for each channel"):
        hb.analyze(fir, delay_error=[1e-9])


def test_simulated_captures_are_those_of_the_front_ends(fir):
    captured = hb.simulate(fir, "tones:0.05,0.1", samples=4000)
    assert captured.channels.shape == (2, 2000) and captured.target.shape == (4000,)
    # Both lie on the time axis of the captures; the last outputs would need later captures.
    y = fir.fuse(captured.channels)
    assert np.abs((y - captured.target)[100:-100]).max() < 2 * fir.gamma.upper
    slow = np.cos(0.3 * np.arange(256))
    assert hb.simulate(fir, slow, gain=2).channels.shape == (2, 128)
    with pytest.raises(hb.HybankError, match="source|tones"):
        hb.simulate(fir, "tune:440Hz")


def test_the_target_of_a_simulation_is_the_signal_at_the_fast_instants():
    spec = {
        "fast_rate": 48e3, "ratio": 2, "latency": 7, "target": {"filter": hb.rc(9e3)},
        "channel": [hb.Channel(25e-6), hb.Channel(12.5e-6)],
    }
    captured = hb.simulate(spec, "tones:1kHz", samples=400)
    filtered = np.exp(2j * np.pi * 1e3 * np.arange(400) / 48e3) / (1 + 1j / 9)
    np.testing.assert_allclose(captured.target, filtered.real, atol=1e-13)
    # Neither what the spec says of the signal nor the latency changes what the converters deliver.
    other = hb.simulate({**spec, "latency": None, "signal": hb.Signal("8 kHz")}, "tones:1kHz", samples=400)
    np.testing.assert_array_equal(other.channels, captured.channels)
    np.testing.assert_array_equal(other.target, captured.target)


def test_faults_of_files_are_those_of_the_system(tmp_path):
    with pytest.raises(FileNotFoundError) as caught:
        hb.load(tmp_path / "none.json")
    assert caught.value.filename == str(tmp_path / "none.json")
    with pytest.raises(FileNotFoundError):
        hb.design(tmp_path / "none.toml")
    (tmp_path / "bad.json").write_text("{}")
    with pytest.raises(hb.HybankError, match="bad.json"):
        hb.load(tmp_path / "bad.json")


def test_an_unstable_bank_is_refused(iir):
    text = iir.to_json()
    start = text.index('"a": [[') + 7
    end = text.index(",", start)
    with pytest.raises(hb.HybankError, match="spectral radius"):
        hb.Bank.from_json(text[:start] + "1.5e3" + text[end:])


def test_a_bank_shows_itself(fir):
    assert "2 channels" in repr(fir) and "upper=" in repr(fir.gamma)
    assert "<table>" in fir._repr_html_() and "proven" in fir._repr_html_()


def test_plot_draws_or_names_what_is_missing(fir):
    try:
        import matplotlib
    except ImportError:
        with pytest.raises(ImportError, match="pip install matplotlib"):
            fir.plot()
        return
    matplotlib.use("Agg")
    line = fir.plot().lines[0]
    np.testing.assert_array_equal(line.get_ydata(), fir.error_response(512)[1])


def test_the_stubs_tell_the_truth(tmp_path):
    pytest.importorskip("mypy")
    # This module can be imported by the Python of GNU Radio only.
    (tmp_path / "allowed").write_text("hybank.gnuradio\n")
    command = [sys.executable, "-m", "mypy.stubtest", "hybank", "--mypy-config-file", ROOT / "pyproject.toml"]
    command += ["--allowlist", tmp_path / "allowed", "--ignore-unused-allowlist"]
    result = subprocess.run(command, capture_output=True, text=True)
    assert result.returncode == 0, result.stdout + result.stderr
