"""The package is the whole program: what the command line does, with the same numbers and the same bits."""

import json
import subprocess

import numpy as np
import pytest

import hybank as hb

SPEC = """\
fast_rate = 48000.0
ratio = 2
latency = 6
target = { filter = { family = "butterworth", order = 4, cutoff = 9000.0 } }
channel = [{ delay = 25e-6, gain = 1.01, offset = 0.001 }, { delay = 12.5e-6 }]
design = { method = "fir", taps = 12 }
"""


def run(binary, folder, *arguments):
    return subprocess.run([binary, *arguments], cwd=folder, check=True, capture_output=True, text=True).stdout


def floats(path):
    """The samples of a WAV file of 32-bit floats."""
    data = path.read_bytes()
    return np.frombuffer(data[data.index(b"data") + 8 :], "<f4")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    (folder / "spec.toml").write_text(SPEC)
    hb.design(SPEC, proof=False).save(folder / "bank.json")
    return folder


@pytest.fixture
def bank(folder):
    return hb.load(folder / "bank.json")


ERRORS = {
    "noise": "1e-3", "bits": "11", "jitter": "20ns", "drift": "0,30", "delay-error": "0,0.01samples", "gain-error": "1%,0",
    "cutoff-error": "0,2%", "offset": "0.01", "seed": "5",
}  # fmt: skip


def keywords(errors):
    parsed = {"noise": float, "bits": int, "seed": int, "jitter": str, "offset": float}
    name = lambda key: key.replace("-", "_")  # noqa: E731
    lists = lambda key, value: [float(x) if key == "drift" else x for x in value.split(",")]  # noqa: E731
    return {name(k): parsed[k](v) if k in parsed else lists(k, v) for k, v in errors.items()}


@pytest.mark.parametrize("given", [{}, *({key: value} for key, value in ERRORS.items() if key != "seed"), ERRORS], ids=str)
def test_simulated_errors_are_those_of_the_command_line(folder, binary, given):
    flags = [word for key, value in given.items() for word in (f"--{key}={value}",)]
    source = ["--source", "tones:1kHz,3kHz", "--samples", "400", "--gain", "0.3", "--to", "raw", "--force"]
    run(binary, folder, "simulate", "spec.toml", *source, "-o", "out", *flags)
    found = hb.simulate(SPEC, "tones:1kHz,3kHz", samples=400, gain=0.3, **keywords(given))
    for i in (0, 1):
        want = np.fromfile(folder / "out" / f"ch{i + 1}.f32", "<f4")
        np.testing.assert_array_equal(found.channels[i].astype("f4"), want)
    np.testing.assert_array_equal(found.target.astype("f4"), np.fromfile(folder / "out" / "target.f32", "<f4"))
    assert found.clipped == [0, 0]


def test_wrong_errors_name_their_keyword():
    for given, words in [
        ({"bits": 1}, "^bits: a converter has 2 to 24 bits"),
        ({"jitter": 1.0}, "^jitter: .*check the unit"),
        ({"gain_error": "200%"}, "^gain_error: .*relative"),
        ({"drift": [1, 2, 3]}, "^drift: 3 values are given for 2 channels"),
        ({"delay_error": "1 m"}, "^delay_error: .*10ps"),
        ({"cutoff_error": np.nan}, "^cutoff_error: NaN is not a finite number"),
        ({"imaginary": "ctones:1kHz"}, "^imaginary: "),
        ({"channel": 2}, "^channel: the signal is no recording"),
        ({"drift": "2ppm"}, "^drift: '2ppm' is a text; give a number, in parts per million"),
        ({"drift": [0, "2"]}, "^drift: '2' is a text"),
        ({"offset": "1%"}, "^offset: '1%' is a text"),
        ({"rate": "48 kHz"}, "^rate: '48 kHz' is a text; give a number, in hertz"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.simulate(SPEC, "tones:1kHz", **given)
    clipped = hb.simulate(SPEC, "tones:1kHz", gain=3.0, bits=8).clipped
    assert clipped[0] > 10 and clipped[1] > 10


def test_an_imaginary_part_is_the_other_half_of_a_complex_signal(bank):
    both = hb.simulate(bank, "tones:1kHz", imaginary="tones:2kHz", samples=400)
    real, imaginary = (hb.simulate(bank, f"tones:{f}kHz", samples=400) for f in (1, 2))
    np.testing.assert_array_equal(both.channels, real.channels + 1j * imaginary.channels)
    np.testing.assert_array_equal(both.target, real.target + 1j * imaginary.target)


def test_worst_cases_over_boxes_are_those_of_the_command_line(folder, binary):
    flags = ["--delay-box", "0.02samples", "--gain-box", "0.2%"]
    want = json.loads(run(binary, folder, "analyze", "bank.json", *flags, "--json"))
    found = hb.analyze(folder / "bank.json", delay_box="0.02samples", gain_box=0.002)
    as_json = lambda value: json.loads(json.dumps(value, default=lambda record: dict(record)))  # noqa: E731
    for name in ("worst_case", "scale"):
        assert as_json(getattr(found, name)) == want[name], name
    assert found.gamma == want["gamma"] <= found.worst_case.attained <= found.worst_case.upper
    plain = hb.analyze(folder / "bank.json")
    assert plain.worst_case is plain.with_errors is None
    moved = hb.analyze(folder / "bank.json", delay_error=["0samples", "0.02samples"])
    assert moved.with_errors.snr_db < plain.figures.snr.total_db
    own = hb.analyze(folder / "bank.json", delay_box=[0, "0.02samples"])
    assert own.worst_case.errors.delays[0] == 0 < own.worst_case.errors.delays[1]


def test_wrong_boxes_name_their_keyword(bank):
    for given, words in [
        ({"delay_box": -1e-9}, "^delay_box: .*positive half-width"),
        ({"gain_box": "60%"}, "^gain_box: .*50%"),
        ({"delay_box": 1e-9, "reference": 3}, "^reference: .*2 channels"),
        ({"delay_box": 1e-9, "reference": "all"}, "^reference: .*none"),
        ({"delay_box": 1e-9, "delay_error": 1e-9}, "^delay_error: "),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.analyze(bank, **given)


def test_a_record_is_compared_as_the_command_line_does(folder, binary, random):
    n = np.arange(3000)
    want = 0.3 * np.cos(0.2 * n) + 0.05 * random.standard_normal(len(n))
    have = 1.25 * np.roll(want, 3) + 0.01 + 1e-3 * random.standard_normal(len(n))
    for name, x in (("have", have), ("want", want)):
        np.save(folder / f"{name}.npy", x)
    flags = ["--ref", "want.npy", "--rate", "48kHz", "--skip", "20", "--json"]
    known = json.loads(run(binary, folder, "measure", "have.npy", *flags))["reference"]
    found = hb.measure(have, 48e3, ref=want, skip=20)
    known.pop("file")
    assert json.loads(json.dumps({k: v for k, v in dict(found).items() if k != "spectrum"}, default=dict)) == known
    assert abs(found.lag_samples.value - 3) < 1e-3 and abs(found.gain.value - 1.25) < 1e-3
    from_files = hb.measure(folder / "have.npy", 48e3, ref=folder / "want.npy", skip=20)
    assert from_files.snr_db == found.snr_db
    with pytest.raises(hb.HybankError, match="^tones: "):
        hb.measure(have, 48e3, ref=want, tones=[1e3])
    with pytest.raises(hb.HybankError, match="^ref: complex"):
        hb.measure(have + 0j, 48e3, ref=want)
    with pytest.raises(hb.HybankError, match="^skip: 1500 samples at either end leave nothing of 3000"):
        hb.measure(have, 48e3, skip=1500)
    with pytest.raises(hb.HybankError, match="^rate: "):
        hb.measure(have)


def test_files_are_fused_to_the_bits_of_the_command_line(folder, binary, bank, random):
    soundfile = pytest.importorskip("soundfile")
    x = 0.3 * random.standard_normal((2, 3001))
    for i, row in enumerate(x):
        soundfile.write(folder / f"a{i}.wav", row, 24000, subtype="PCM_16")
    soundfile.write(folder / "both.flac", x.T, 24000, subtype="PCM_24")
    files = [folder / "a0.wav", folder / "a1.wav"]
    run(binary, folder, "fuse", "bank.json", "a0.wav", "a1.wav", "-o", "y.wav", "--force")
    y = bank.fuse(files)
    assert y.dtype == np.float32
    np.testing.assert_array_equal(y, floats(folder / "y.wav"))
    np.testing.assert_array_equal(bank.fuse([str(path) for path in files]), y)
    run(binary, folder, "fuse", "bank.json", "both.flac", "-o", "y.wav", "--force")
    np.testing.assert_array_equal(bank.fuse(folder / "both.flac"), floats(folder / "y.wav"))
    # What was read can be fused otherwise, too.
    captures = hb.read(files)
    assert captures.rate == 24000 and captures.channels.shape == (2, 3001)
    np.testing.assert_array_equal(bank.fuse(captures, dtype="f4"), y)
    with pytest.raises(hb.HybankError, match="has 2 channels, but the input has 1"):
        bank.fuse(files[0])
    soundfile.write(folder / "slow.wav", x.T, 22050, subtype="FLOAT")
    with pytest.raises(hb.HybankError, match="22050 Hz, but the bank is designed for slow channels of 24000 Hz"):
        bank.fuse(folder / "slow.wav")
    with pytest.warns(UserWarning, match="slow.wav: the sample rate is 22050 Hz, but .*a0.wav has 24000 Hz; .*give bank="):
        hb.read([files[0], folder / "slow.wav"])
    # Recordings that were read without the bank are of another rate as files are.
    both = hb.read(folder / "slow.wav")
    with pytest.raises(hb.HybankError, match="is 22050 Hz, but the bank is designed for 24000 Hz"):
        bank.fuse(both)
    assert bank.fuse(both.channels).shape == (6002,)


@pytest.mark.parametrize("name", ["nix.wav", "nix.npy", "nix.csv", "nix.mat:x", "nix.sigmf-meta"])
def test_a_missing_file_is_a_file_not_found_error(folder, bank, name):
    soundfile = pytest.importorskip("soundfile")
    soundfile.write(folder / "is.wav", np.zeros(400), 24000, subtype="FLOAT")
    files = [folder / "is.wav", folder / name]
    for call in (bank.fuse, hb.read, lambda x: hb.calibrate(x, SPEC), lambda x: hb.align(x, SPEC), lambda x: hb.measure(x[1])):
        with pytest.raises(FileNotFoundError) as caught:
            call(files)
        assert caught.value.filename == str(folder / name.split(":")[0]) and caught.value.__context__ is None
    with pytest.raises(FileNotFoundError):
        hb.Recording(folder / "nix.sigmf-meta")
    with pytest.raises(FileNotFoundError):
        hb.simulate(bank, str(folder / "nix.wav"))
    with pytest.raises(FileNotFoundError):
        hb.read(folder / "is.wav", lost=folder / "nix.jsonl")
    # A file that is there and is none of its kind stays a refusal.
    (folder / "bad.wav").write_text("bad")
    with pytest.raises(hb.HybankError, match="bad.wav"):
        bank.fuse([folder / "is.wav", folder / "bad.wav"])


def test_converters_take_turns_in_one_recording(folder, binary, bank, random):
    x = random.standard_normal((2, 500)).astype("f4")
    # The one with the larger delay, channel 1, samples first.
    turns = x.T.reshape(-1)
    np.testing.assert_array_equal(bank.fuse(turns, interleaved=2), bank.fuse(x))
    turns.astype("<f4").tofile(folder / "turns.raw")
    arguments = ["fuse", "bank.json", "turns.raw", "--format", "f32le", "--interleaved", "2", "-o", "y.wav", "--force"]
    run(binary, folder, *arguments)
    read = hb.read(folder / "turns.raw", bank=bank, format="f32le", interleaved=2)
    np.testing.assert_array_equal(bank.fuse(read, dtype="f4"), floats(folder / "y.wav"))
    other = hb.design(SPEC.replace("25e-6", "5e-6"), proof=False)
    np.testing.assert_array_equal(other.fuse(turns, interleaved=2), other.fuse(x[::-1]))
    with pytest.raises(hb.HybankError, match="^interleaved: there are 2 channels"):
        bank.fuse(turns, interleaved=3)


def test_a_stream_fills_gaps_as_fuse_does(bank, random):
    x = random.standard_normal((2, 400)).astype("f4")
    x[0, 50:53] = x[1, 200] = np.nan
    want, report = bank.fuse(x, gaps=True, keep_latency=True, full_output=True)
    outputs, masks = [], []
    with bank.stream(gaps=True) as s:
        for first in range(0, 400, 37):
            outputs.append(s.process(x[:, first : first + 37]))
            masks.append(s.mask)
        outputs.append(s.flush())
        masks.append(s.mask)
    np.testing.assert_array_equal(np.concatenate(outputs)[: len(want)], want)
    np.testing.assert_array_equal(np.concatenate(masks)[: len(want)], report.mask)
    assert s.gaps == report.gaps and [gap[:3] for gap in s.gaps] == [(1, 50, 3), (2, 200, 1)]
    plain = bank.stream()
    assert plain.gaps is plain.mask is None
    with pytest.raises(hb.HybankError, match="cannot be copied"):
        bank.stream(gaps=True).state  # noqa: B018
    again = bank.stream(gaps=True)
    again.process(x)
    again.reset()
    whole = np.concatenate([again.process(x), again.flush()])
    np.testing.assert_array_equal(whole[: len(want)], want)
    assert len(whole) == len(want) + len(bank.stream().flush())
    c = x + 1j * x[::-1]
    s = bank.stream(gaps=True, dtype="c8")
    y = np.concatenate([s.process(c), s.flush()])
    want = bank.fuse(c, gaps=True, keep_latency=True)
    np.testing.assert_array_equal(y[: len(want)], want)


def test_the_page_is_that_of_the_command_line(folder, binary, bank, random):
    def body(name):
        text = (folder / name).read_text()
        return text[: text.index("<h2>Commands</h2>")]

    run(binary, folder, "report", "bank.json", "-o", "want.html", "--force")
    bank.report(folder / "have.html")
    assert body("have.html") == body("want.html")
    t = np.arange(4000)
    x = 0.5 * np.cos(0.3 * t + np.array([[0.0], [0.1]])) + 1e-4 * random.standard_normal((2, 4000))
    for i, row in enumerate(x):
        np.save(folder / f"r{i}.npy", row)
    run(binary, folder, "report", "bank.json", "r0.npy", "r1.npy", "-o", "want.html", "--force")
    for captures in (x, [folder / "r0.npy", folder / "r1.npy"]):
        bank.report(folder / "have.html", captures)
        assert body("have.html") == body("want.html") and "SINAD" in body("have.html")
    with pytest.raises(hb.HybankError, match="6 frames, and a spectrum needs 16"):
        bank.report(folder / "have.html", np.zeros((2, 6)))
    with pytest.raises(FileExistsError):
        bank.report(folder / "have.html", overwrite=False)


def test_a_bank_states_its_rate_its_noise_gain_and_its_responses(bank, iir):
    assert bank.fast_rate == 48000.0 and bank.fast_period * bank.fast_rate == 1.0
    # Independent noise on all slow samples: the mean over the phases of the sum of squared taps.
    assert bank.noise_gain == pytest.approx(np.sqrt((bank.taps**2).sum() / bank.ratio), rel=1e-12)
    assert iir.noise_gain == pytest.approx(hb.analyze(iir).noise_gain, rel=1e-12)
    f, response = bank.frequency_response(257)
    np.testing.assert_allclose(f, np.linspace(0, 24e3, 257))
    np.testing.assert_allclose(response, np.fft.rfft(bank.taps, 512), atol=1e-13)
    f, gains = bank.front_end_gains(97)
    want = 1 / np.sqrt(1 + (f / 9e3) ** 8)
    np.testing.assert_allclose(gains, np.array([want, 1.01 * want, want]), rtol=1e-9)
    # A recursion: by its matrices at the slow rate, phase by phase.
    f, response = iir.frequency_response(5)
    a, b, c, d = iir.ss
    for k, hertz in enumerate(f):
        w = 2 * np.pi * hertz * iir.fast_period
        z = np.exp(1j * w * iir.ratio)
        phases = c @ np.linalg.solve(z * np.eye(len(a)) - a, b) + d
        want = np.exp(-1j * w * np.arange(iir.ratio)) @ phases
        np.testing.assert_allclose(response[:, k], want, atol=1e-6)
    with pytest.raises(hb.HybankError, match="^n: -1"):
        bank.frequency_response(-1)


def test_taps_of_another_tool_are_judged(bank, tmp_path):
    same = hb.import_taps(bank, bank.taps, proof=False)
    assert same.gamma.norm == pytest.approx(bank.gamma.norm, rel=1e-9)
    with pytest.raises(hb.HybankError, match="^latency: "):
        hb.import_taps(SPEC.replace("latency = 6\n", ""), bank.taps)
    bank.export(tmp_path / "a.h", format="c")
    bank.export(tmp_path / "b.h", format="c")
    assert (tmp_path / "a.h").read_bytes() == (tmp_path / "b.h").read_bytes()


def test_keys_of_a_spec_are_replaced(folder):
    bank = hb.design(folder / "spec.toml", replace={"taps": 10, "latency": 5}, proof=False)
    assert bank.taps.shape == (2, 10) and bank.latency == 5
    assert hb.design(SPEC, replace={"method": "h2"}, proof=False).method == "h2"
    with pytest.raises(hb.SpecError, match='did you mean "taps"'):
        hb.design(SPEC, replace={"tabs": 10})
    with pytest.raises(TypeError, match="replace"):
        hb.design(replace={"taps": 10})


def test_measured_filters_are_read_from_files(binary, tmp_path, monkeypatch):
    """By the path of a spec, as a text and as a mapping: the filters that the command line fits."""
    frequencies = np.linspace(100.0, 40e3, 300)
    response = 1 / (1 + 1j * frequencies / 9e3) ** 2
    rows = zip(frequencies, 20 * np.log10(abs(response)), np.degrees(np.unwrap(np.angle(response))))
    text = "frequency (Hz), gain (dB), phase (deg)\n" + "".join("%.17g,%.17g,%.17g\n" % row for row in rows)
    lab = tmp_path / "lab"
    lab.mkdir()
    (lab / "bode.csv").write_text(text)
    parts = "".join(f"{f:.17g} 0 0 {h.real:.17g} {h.imag:.17g} 0 0 0 0\n" for f, h in zip(frequencies, response))
    (lab / "afe.s2p").write_text("# Hz S RI R 50\n" + parts)
    for filter_ in ({"response": "bode.csv", "order": 2}, {"touchstone": "afe.s2p", "order": 2}):
        written = ", ".join(f"{key} = {json.dumps(value)}" for key, value in filter_.items())
        spec = SPEC.replace("delay = 12.5e-6", f"delay = 12.5e-6, filter = {{ {written} }}")
        (lab / "spec.toml").write_text(spec)
        run(binary, lab, "design", "spec.toml", "-o", "bank.json", "--force")
        wanted = hb.load(lab / "bank.json").taps
        assert np.array_equal(hb.design(lab / "spec.toml", proof=False).taps, wanted)
        with pytest.raises(hb.SpecError, match=list(filter_.values())[0]):
            hb.design(spec, proof=False)
        monkeypatch.chdir(lab)
        assert np.array_equal(hb.design(spec, proof=False).taps, wanted)
        channels = [dict(delay=25e-6, gain=1.01, offset=0.001), dict(delay=12.5e-6, filter=filter_)]
        mapping = {
            "fast_rate": 48000.0, "ratio": 2, "latency": 6, "channel": channels,
            "target": {"filter": {"family": "butterworth", "order": 4, "cutoff": 9000.0}},
            "design": {"method": "fir", "taps": 12},
        }  # fmt: skip
        assert np.array_equal(hb.design(mapping, proof=False).taps, wanted)
        monkeypatch.undo()
