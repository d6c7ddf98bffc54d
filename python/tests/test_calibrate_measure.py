"""Calibration, measurement and export: values that are known, refusals, and the files of the command line."""

import json
import subprocess

import numpy as np
import pytest

import hybank as hb

RATE = 32e6
TRUE = np.array([60e-9, 29.5e-9])
GAIN = np.array([1.0, 1.02])


def plant(delays):
    return {
        "fast_rate": RATE, "ratio": 2, "target": {"filter": hb.butterworth(2, 14e6)},
        "channel": [hb.Channel(delay=delay) for delay in delays], "design": {"method": "fir", "taps": 8},
    }  # fmt: skip


def capture(frames=4000):
    """Two tones through the front ends of ``plant``, sampled at the true delays: a closed form."""
    t = np.arange(frames)[None, :] * 2 / RATE - TRUE[:, None]
    x = np.zeros(t.shape)
    for f in (1e6, 7e6):
        s, w = 2j * np.pi * f, 2 * np.pi * 14e6
        response = w**2 / (s**2 + np.sqrt(2) * w * s + w**2)
        x += 0.4 * np.abs(response) * np.sin(2 * np.pi * f * t + np.angle(response))
    noise = 1e-4 * np.random.default_rng(1).standard_normal(x.shape)
    return GAIN[:, None] * x + np.array([[0.0], [0.01]]) + noise


@pytest.mark.filterwarnings("ignore:the tone at .* distinct phases")
@pytest.mark.parametrize("axis", [-1, 0])
def test_tones_give_delays_gains_and_offsets(axis):
    x = capture()
    cal = hb.calibrate(x if axis else np.ascontiguousarray(x.T), plant([60e-9, 30e-9]), tones=[1e6, 7e6], axis=axis)
    assert abs(cal.delay[1] - TRUE[1]) < 5 * cal.delay_sigma[1] < 1e-11
    assert abs(cal.gain[1] - GAIN[1]) < 5 * cal.gain_sigma[1] < 1e-4
    assert abs(cal.offset[1] - 0.01) < 5 * cal.offset_sigma[1]
    assert np.isnan(cal.cutoff).all() and cal.reference == 1 and cal.clipped == [0, 0]
    np.testing.assert_allclose([tone.frequency.value for tone in cal.tones], [1e6, 7e6], rtol=1e-6)
    bank = hb.design(cal.spec, proof=False)
    assert abs(bank.delays[1] - TRUE[1]) < 1e-11 and abs(bank.gains[1] - 1.02) < 1e-3


def test_wrong_calibrations_are_refused():
    x, spec = np.zeros((2, 100)), plant([60e-9, 30e-9])
    for keywords, words in [
        ({"tones": [1e6], "blind": True}, "one of tones, waveform and blind"),
        ({"tones": [-1.0]}, "above 0"),
        ({"fit": ["delays"]}, "can be fitted"),
        ({"reference": 0}, "count from 1"),
        ({"clip": -1.0}, "positive level"),
        ({"tones": [1e6]}, "."),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.calibrate(x, spec, **keywords)
    for keywords, words in [({"blind": True}, "by tones"), ({"tones": [0.0]}, "the tone at 0 Hz .*cannot be told apart"), ({"tones": [np.nan]}, "finite")]:
        with pytest.raises(hb.HybankError, match=words):
            hb.calibrate(x + 0j, spec, **keywords)


@pytest.mark.filterwarnings("ignore:the parts of complex samples have offsets", "ignore:the tone at .* distinct phases")
def test_complex_captures_are_calibrated_by_tones_of_either_sign():
    t = np.arange(4000) * 2 / RATE - TRUE[:, None]
    x = np.zeros(t.shape, complex)
    for f in (1e6, -7e6):
        s, w = 2j * np.pi * f, 2 * np.pi * 14e6
        x += 0.4 * w**2 / (s**2 + np.sqrt(2) * w * s + w**2) * np.exp(s * t)
    random = np.random.default_rng(3)
    x = GAIN[:, None] * x + 1e-4 * (random.standard_normal(x.shape) + 1j * random.standard_normal(x.shape))
    cal = hb.calibrate(x, plant([60e-9, 30e-9]), tones=[1e6, -7e6])
    assert abs(cal.delay[1] - TRUE[1]) < 5 * cal.delay_sigma[1] < 1e-11
    assert abs(cal.gain[1] - GAIN[1]) < 5 * cal.gain_sigma[1] < 1e-4
    np.testing.assert_allclose([tone.frequency.value for tone in cal.tones], [1e6, -7e6], rtol=1e-6)
    with pytest.raises(hb.HybankError, match="sign of a frequency"):
        hb.calibrate(x, plant([60e-9, 30e-9]), tones=[-1e6, 7e6])


@pytest.mark.parametrize("dtype", ["c16", "c8"])
def test_a_complex_tone_has_its_sign_and_the_imbalance_of_its_parts(dtype):
    n, rate, gain, error = np.arange(1 << 13), 1e6, 1.01, 0.02
    phase = 2 * np.pi * -12345.6 / rate * n
    # The imaginary part of e^(j w t) is g sin(w t + p); for negative frequencies p changes its sign.
    y = 0.5 * (np.cos(phase) + 1j * gain * np.sin(phase + error)) + 0.01 - 0.02j
    random = np.random.default_rng(5)
    y = (y + 1e-4 * (random.standard_normal(len(n)) + 1j * random.standard_normal(len(n)))).astype(dtype)
    m = hb.measure(y, rate)
    assert abs(m.tones[0].frequency_hertz.value + 12345.6) < 0.01
    assert abs(m.offset.value - 0.01) < 1e-5 and abs(m.quadrature.offset.value + 0.02) < 1e-5
    (found,) = m.quadrature.imbalances
    found_gain, found_error, rejection = found.gain.value, found.phase_radians.value, found.image_rejection_db
    assert abs(found_gain - gain) < 1e-4 and abs(abs(found_error) - error) < 1e-4
    cos = np.cos(error)
    want = 10 * np.log10((1 + 2 * gain * cos + gain**2) / (1 - 2 * gain * cos + gain**2))
    assert abs(rejection - want) < 0.1 and m.sfdr_db == pytest.approx(want, abs=0.1)
    hertz, level = m.spectrum
    assert hertz.min() < 0 < hertz.max() and abs(hertz[level.argmax()] + 12345.6) < rate / len(n)
    real = hb.measure(np.ascontiguousarray(y.real), rate)
    assert real.quadrature is None and isinstance(real.offset.value, float)


def test_complex_signals_are_captured_part_by_part():
    spec = plant([60e-9, 30e-9])
    captured = hb.simulate(spec, "ctones:-3MHz", samples=400)
    assert captured.channels.dtype == captured.target.dtype == np.complex128
    # The steady state of one exponential: the front end's response and the delay, in closed form.
    k, w, s = np.arange(200), 2 * np.pi * 14e6, -2j * np.pi * 3e6
    response = w**2 / (s**2 + np.sqrt(2) * w * s + w**2)
    for row, delay in zip(captured.channels, (60e-9, 30e-9), strict=True):
        np.testing.assert_allclose(row[50:], (response * np.exp(s * (k * 2 / RATE - delay)))[50:], atol=1e-9)
    signal = np.exp(0.2j * np.arange(300))
    both = hb.simulate(spec, signal)
    parts = [hb.simulate(spec, np.ascontiguousarray(part)) for part in (signal.real, signal.imag)]
    np.testing.assert_array_equal(both.channels, parts[0].channels + 1j * parts[1].channels)
    np.testing.assert_array_equal(both.target, parts[0].target + 1j * parts[1].target)
    assert hb.simulate(spec, [0, 1, 2, 3]).channels.dtype == np.float64
    with pytest.raises(hb.HybankError, match="sample 1 is NaN"):
        hb.simulate(spec, [0.0, np.nan])


def test_a_tone_in_noise_has_the_figures_of_its_formulas():
    n, rate, amplitude, sigma = 1 << 14, 1e6, 0.5, 1e-3
    noise = sigma * np.random.default_rng(2).standard_normal(n)
    t = np.arange(n) / rate
    y = amplitude * np.sin(2 * np.pi * 12345.6 * t + 0.3) + 5e-4 * np.sin(2 * np.pi * 3 * 12345.6 * t) + noise
    m = hb.measure(y, rate)
    snr = 10 * np.log10(amplitude**2 / 2 / sigma**2)
    assert abs(m.snr_db - snr) < 0.2
    assert abs(m.thd_db - 20 * np.log10(5e-4 / amplitude)) < 0.5
    assert abs(m.enob_from_sinad - (m.sinad_db - 10 * np.log10(1.5)) / (20 * np.log10(2))) < 1e-9
    frequency, size = m.tones[0].frequency_hertz.value, m.tones[0].amplitude.value
    assert abs(frequency - 12345.6) < 0.1 and abs(size - amplitude) < 1e-4
    hertz, level = m.spectrum
    assert abs(hertz[level.argmax()] - 12345.6) < rate / n and m.interleaving_db is None
    assert hb.measure((y * 32767).astype("i2"), rate).snr_db == pytest.approx(m.snr_db, abs=0.1)
    with pytest.raises(hb.HybankError, match="choose"):
        hb.measure(y, rate, window="kaiser")
    with pytest.raises(hb.HybankError, match="rate"):
        hb.measure(y, -1.0)
    with pytest.raises(hb.HybankError, match="^rate: '2 MHz' is a text; give a number, in hertz"):
        hb.measure(y, "2 MHz")
    with pytest.raises(hb.HybankError, match="^rate: '48 kHz' is a text"):
        hb.calibrate(np.zeros((2, 9)), {}, rate="48 kHz")


@pytest.mark.parametrize("format", ["c", "csv", "mat"])
def test_exports_are_those_of_the_command_line(binary, filters, tmp_path, format):  # noqa: A002
    bank = hb.load(filters / "thesis-fir.json")
    bank.export(tmp_path / "python", format=format)
    command = [binary, "export", filters / "thesis-fir.json", "--format", format, "-o", tmp_path / "command"]
    subprocess.run(command, check=True, capture_output=True)
    assert (tmp_path / "python").read_bytes() == (tmp_path / "command").read_bytes()
    # The name says it as well as the keyword.
    ending = {"c": "H"}.get(format, format)
    assert bank.export(tmp_path / f"named.{ending}") is None
    assert (tmp_path / f"named.{ending}").read_bytes() == (tmp_path / "python").read_bytes()
    with pytest.raises(hb.HybankError, match='other: the name does not say which format it is to have; give format="c"'):
        bank.export(tmp_path / "other")
    with pytest.raises(hb.HybankError, match="choose c"):
        bank.export(tmp_path / "other", format="xml")
    with pytest.raises(hb.HybankError, match="integer taps"):
        bank.export(tmp_path / "other", format="coe")
    with pytest.raises(FileExistsError):
        bank.export(tmp_path / "python", format=format, overwrite=False)


def test_a_circuit_is_that_of_the_command_line(binary, filters, tmp_path):
    fixed = hb.design(filters / "thesis-fir.toml", replace={"bits": 12}, proof=False)
    fixed.save(tmp_path / "fixed.json")
    options = {"input_bits": 12, "output_bits": 14, "accumulator": 30, "clocks_per_frame": 4, "pipeline": 2}
    circuit = fixed.export(
        tmp_path / "python.v", format="verilog", name="core", testbench=tmp_path / "p", random_frames=20, **options
    )
    words = [word for name, value in options.items() for word in ("--" + name.replace("_", "-"), str(value))]
    names = ["--name", "core", "--testbench", tmp_path / "c", "--random-frames", "20"]
    command = [binary, "export", tmp_path / "fixed.json", "-o", tmp_path / "command.v", "--json", *words, *names]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    assert (tmp_path / "python.v").read_text() == (tmp_path / "command.v").read_text()
    for file in (tmp_path / "c").iterdir():
        assert file.read_bytes() == (tmp_path / "p" / file.name).read_bytes()
    bench = {"loadable": True, "testbench": tmp_path / "l", "random_frames": 5, **options}
    fixed.export(tmp_path / "loadable.v", format="verilog", name="core", **bench)
    fixed.export(tmp_path / "words.mem", format="mem", loadable=True, **options)
    assert (tmp_path / "words.mem").read_text() == (tmp_path / "l" / "load.mem").read_text()
    printed = json.loads(done.stdout)
    assert {name: printed[name] for name in vars(circuit)} == vars(circuit)
    for keywords, words in [
        ({"format": "c", "pipeline": 2}, "describe a circuit"),
        ({"format": "coe", "loadable": True}, "describe a circuit"),
        ({"format": "verilog", "random_frames": 5}, "belong to a testbench"),
        ({"format": "verilog", "clocks_per_frame": 0}, "clocks_per_frame: 0"),
        ({"format": "verilog"}, "bits of the samples"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            fixed.export(tmp_path / "other", **keywords)
    assert not (tmp_path / "other").exists()


def test_integers_are_fused_as_by_the_command_line(binary, filters, tmp_path):
    fixed = hb.design(filters / "thesis-fir.toml", replace={"bits": 12}, proof=False)
    soundfile = pytest.importorskip("soundfile")
    fixed.save(tmp_path / "fixed.json")
    x = np.random.default_rng(3).integers(-32768, 32767, (2, 500)).astype("i2")
    for row, name in zip(x, ("a.wav", "b.wav")):
        soundfile.write(tmp_path / name, row, 24000, subtype="PCM_16")
    command = [binary, "fuse", "fixed.json", "a.wav", "b.wav", "-o", "y.wav", "--bit-true", "--accumulator", "26"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    with pytest.warns(UserWarning):
        y = fixed.fuse_as_hardware(x, accumulator=26)
    assert (y == soundfile.read(tmp_path / "y.wav", dtype="int16")[0]).all()
    with pytest.warns(UserWarning, match="sums did not fit the accumulator of 26 bits"):
        late = fixed.fuse_as_hardware(x.T, accumulator=26, axis=0, keep_latency=True)
    dropped = fixed.fuse(x / 2.0**15, full_output=True)[1].latency_dropped
    assert dropped > 0 and (late[dropped:] == y[: len(y) - dropped]).all()
    for samples, words in [(x / 2.0, "integers, not samples of f8"), (x.astype("u1"), "u1")]:
        with pytest.raises(hb.HybankError, match=words):
            fixed.fuse_as_hardware(samples)
    with pytest.raises(hb.HybankError, match="integer taps"):
        hb.load(filters / "thesis-fir.json").fuse_as_hardware(x)


def test_recordings_are_aligned_by_any_signal():
    spec = {
        "fast_rate": 48e3, "ratio": 2, "target": {"filter": hb.butterworth(4, 9e3)},
        "channel": [hb.Channel(delay=25e-6), hb.Channel(delay=12.5e-6)], "design": {"method": "fir", "taps": 8},
    }  # fmt: skip
    sound = "tones:" + ",".join(f"{100 * 1.07**k:.1f}Hz" for k in range(65))
    heard = hb.simulate(spec, sound, samples=96_000).channels / 100
    heard = [heard[0][500:], -0.5 * heard[1][:40_000] + 0.1]
    found = hb.align(heard, spec)
    assert found.skip == [0, 500] and found.frames == 39_500
    assert abs(found.delay[1] - 12.5e-6) < 1e-8 and abs(found.drift_ppm[1]) < 0.1
    assert abs(found.gain[1] + 0.5) < 1e-3 and abs(found.offset[1] - 0.1) < 1e-2
    assert 0 < len(found.track.splitlines()) <= 1024 and not found.warnings
    assert not found.one_suffices and found.alone.together_db > found.alone.snr_db and "Alignment" in repr(found)
    assert hb.design(found.spec, proof=False).gains[1] == found.gain[1]
    integers = [np.round(32767 * x).astype("i2") for x in heard]
    assert hb.align(integers, spec).skip == [0, 500]


def test_recordings_are_merged():
    f = np.linspace(63.0, 3200.0, 140) + 3 * np.sin(np.arange(140.0))

    def sound(t):
        return 0.02 * sum(np.cos(2 * np.pi * f * t + k * k) for k, f in enumerate(f))

    t = [0.3 + np.arange(16_000) / 4000, 0.1 + np.arange(16_000) / 4000 / (1 + 35e-6)]
    heard = [sound(t[0]), -0.6 * sound(t[1])]
    merged = hb.merge(heard, 4000)
    assert merged.rate == 8000 and merged.one_suffices is None and not merged.warnings and "Merged" in repr(merged)
    assert abs(merged.start[1] + 0.2) < 1e-6 and abs(merged.drift_ppm[1] - 35) < 0.5 and abs(merged.gain[1] + 0.6) < 1e-3
    inner = slice(400, -400)
    truth = sound(0.3 + merged.begin + np.arange(len(merged.samples)) / merged.rate)[inner]
    assert 10 * np.log10(np.mean(truth**2) / np.mean((merged.samples[inner] - truth) ** 2)) > 25
    stamped = hb.merge(heard, times=[t[0], t[1]], output_rate=8000)
    assert stamped.drift_ppm is None and len(stamped.alone_db) == 2
    for keywords, words in [
        ({}, "rate: arrays state none"),
        ({"rate": [4000]}, "one for each of 2"),
        ({"times": [t[0]]}, "1 lists for 2"),
        ({"times": [t[0], t[1][:-1]]}, r"times\[1\]"),
        ({"rate": 4000, "output_rate": 1e9}, "rate"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.merge(heard, **keywords)


def test_recordings_that_do_not_fit_are_refused():
    spec = plant([60e-9, 30e-9])
    random = np.random.default_rng(9)
    a, b = random.standard_normal((2, 5000))
    for x, keywords, words in [
        ([a, b], {}, "nothing in common"),
        ([a, np.zeros(5000)], {}, "channel 2 holds no signal"),
        ([a, b[:100]], {}, "100 samples in common"),
        ([a], {}, "channels in the spec: 2"),
        ([a, b], {"reference": 3}, "channel 3"),
        ([a, b], {"within": -1.0}, "within"),
        ([a, 1j * b], {}, "complex"),
        ([np.sin(0.3 * np.arange(20_000)), np.sin(0.3 * np.arange(20_000) + 1)], {}, "several lags"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.align(x, spec, **keywords)
