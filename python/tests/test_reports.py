"""Results have what ``--json`` of the command line has, under the same names."""

import json
import subprocess

import numpy as np
import pytest
from test_calibrate_measure import RATE, capture

import hybank as hb

SPEC = """\
fast_rate = "32 MHz"
ratio = 2
target = { filter = { family = "butterworth", order = 2, cutoff = "14 MHz" } }
channel = [{ delay = "60 ns" }, { delay = "30 ns" }]
design = { method = "fir", taps = 8 }
uncertainty = { delay = "1 ps", reference = 1 }
"""

# What no result has: the name of a file, the spec as prose, and what only a second set of files can say.
LEFT_OUT = {
    "measure": {"file"},
    "verify": {"bank"},
    "fuse": set(),
    "analyze": {"understood"},
    # Arrays with a value per channel in their place.
    "calibrate": {"channels"},
    # And commands to go on with.
    "align": {"channels", "next"},
}
# Tuples, as those of streams.
NOT_INSIDE = {"gaps"}


def missing(printed, found, path=""):
    """Paths of the keys of a report that a result does not have."""
    if isinstance(printed, list):
        pairs = zip(printed, found, strict=True)
        return [name for one, own in pairs for name in missing(one, own, path + "[]")]
    if not isinstance(printed, dict):
        return []
    paths = []
    for key, value in printed.items():
        own = getattr(found, key, missing)
        if own is missing:
            paths.append(f"{path}.{key}".lstrip("."))
        elif value is not None and key not in NOT_INSIDE:
            paths += missing(value, own, f"{path}.{key}")
    return paths


def leaves(printed, found):
    """The numbers and texts of a report beside those of a result."""
    if isinstance(printed, dict):
        names = [key for key in printed if hasattr(found, key) and key not in NOT_INSIDE]
        return [pair for key in names for pair in leaves(printed[key], getattr(found, key))]
    if isinstance(printed, list):
        return [pair for one, own in zip(printed, found, strict=True) for pair in leaves(one, own)]
    return [(printed, found)]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("reports")
    (folder / "spec.toml").write_text(SPEC)
    hb.design(SPEC).save(folder / "bank.json")
    for i, row in enumerate(capture()):
        np.save(folder / f"ch{i + 1}.npy", row)
    x = np.random.default_rng(3).standard_normal((2, 20_000)) / 10
    # The same broad signal at both, begun apart.
    np.save(folder / "a.npy", x[0])
    np.save(folder / "b.npy", x[0][300:])
    n = np.arange(8192)
    tone = 1.2 * np.cos(0.3 * n) + 1e-3 * np.cos(0.6 * n)
    np.save(folder / "tone.npy", np.clip(tone, -1, 1))
    np.save(folder / "iq.npy", np.exp(0.3j * n) + 1e-3 * np.exp(0.6j * n))
    return folder


def by_command(binary, folder, *words):
    run = subprocess.run([binary, *words, "--json"], cwd=folder, check=True, capture_output=True, text=True)
    return json.loads(run.stdout)


@pytest.mark.filterwarnings("ignore::UserWarning")
@pytest.mark.parametrize(
    "command, words, call",
    [
        ("measure", ["tone.npy", "--rate", "48kHz", "--interleaved", "2"],
         lambda: hb.measure("tone.npy", 48e3, interleaved=2)),
        ("measure", ["iq.npy", "--rate", "48kHz"], lambda: hb.measure("iq.npy", 48e3)),
        ("verify", ["bank.json"], lambda: hb.verify("bank.json")),
        ("fuse", ["bank.json", "ch1.npy", "ch2.npy", "-o", "y.wav", "--force"],
         lambda: hb.load("bank.json").fuse(["ch1.npy", "ch2.npy"], full_output=True)[1]),
        ("analyze", ["bank.json", "--delay-box", "10ps"], lambda: hb.analyze("bank.json", delay_box="10ps")),
        ("calibrate", ["spec.toml", "ch1.npy", "ch2.npy", "-o", "cal.toml", "--force", "--tone", "1MHz,7MHz"],
         lambda: hb.calibrate(["ch1.npy", "ch2.npy"], "spec.toml", tones=[1e6, 7e6])),
        ("align", ["spec.toml", "a.npy", "b.npy", "-o", "aligned.toml", "--force"],
         lambda: hb.align(["a.npy", "b.npy"], "spec.toml")),
    ],
    ids=lambda value: value if isinstance(value, str) else "",
)  # fmt: skip
def test_a_result_has_the_keys_and_the_values_of_the_report(binary, folder, monkeypatch, command, words, call):
    printed = by_command(binary, folder, command, *words)
    monkeypatch.chdir(folder)
    found = call()
    assert set(missing(printed, found)) == LEFT_OUT[command]
    pairs = [(a, b) for a, b in leaves(printed, found) if not isinstance(a, str)]
    assert len(pairs) > 5
    for want, own in pairs:
        # Seconds differ from run to run.
        if want is not None and want != printed.get("seconds"):
            assert own == pytest.approx(want, rel=1e-9, abs=1e-12)


def test_warnings_of_the_command_line_are_warnings(binary, folder):
    n = np.arange(8192)
    tone = np.clip(1.2 * np.cos(0.3 * n), -1, 1)
    with pytest.warns(UserWarning) as caught:
        found = hb.measure(tone, 48e3)
    of_array, of_result = [str(one.message) for one in caught]
    assert caught[0].filename == __file__ and found.warnings == [of_result]
    assert "the signal is clipped there" in of_array and "are at the limits of the range" in of_result
    np.save(folder / "clipped.npy", tone)
    printed = by_command(binary, folder, "measure", "clipped.npy", "--rate", "48kHz")
    assert printed["warnings"] == found.warnings and printed["clipped"] == found.clipped > 1000
    begun = np.concatenate([np.zeros(100), 0.9 * np.cos(0.3 * n)])
    with pytest.warns(UserWarning, match="skip=128 leaves them out"):
        assert hb.measure(begun, 48e3).unsettled_ends.samples == 128
    assert hb.measure(begun, 48e3, skip=128).warnings == []


def test_a_doubtful_calibration_is_a_warning():
    with pytest.warns(UserWarning, match="distinct phases") as caught:
        found = hb.calibrate(capture(), SPEC, tones=[1e6, 7e6])
    assert [str(one.message) for one in caught] == found.warnings and caught[0].filename == __file__


def test_captures_that_contradict_the_spec_are_a_warning(binary, folder, monkeypatch):
    bank = hb.load(folder / "bank.json")
    swapped = np.random.default_rng(5).uniform(-0.9, 0.9, (1, 20_000)).repeat(2, axis=0)
    with pytest.warns(UserWarning) as caught:
        _, report = bank.fuse(swapped, full_output=True)
    np.save(folder / "both.npy", swapped.T)
    printed = by_command(binary, folder, "fuse", "bank.json", "both.npy", "-o", "both.wav")
    assert [str(one.message) for one in caught] == report.warnings == printed["warnings"] != []
    assert report.captures == printed["captures"] and "do not agree" in report.captures


def test_what_a_run_tolerates_is_a_warning(fir, folder):
    x = np.full((2, 50), 2.0)
    x[0, 3] = np.nan
    with pytest.warns(UserWarning) as caught:
        _, report = fir.fuse(x, dtype="i2", full_output=True)
    assert [str(one.message) for one in caught] == report.warnings and len(report.warnings) == 2
    assert all(one.filename == __file__ for one in caught)
    assert report.replaced == 1 and report.clipped > 50 and report.peak > 1
    np.save(folder / "nan.npy", 0.4 * x.T)
    with pytest.warns(UserWarning, match="replaced by 0") as caught:
        fir.fuse([folder / "nan.npy"])
    assert caught[0].filename == __file__


def test_every_field_of_a_result_is_documented():
    import dataclasses
    import re

    from hybank import _results

    kinds = [kind for kind in vars(_results).values() if dataclasses.is_dataclass(kind)] + [hb.dask.Report]
    assert len(kinds) > 8
    for kind in kinds:
        section = kind.__doc__[kind.__doc__.index("Attributes\n    ----------\n") :]
        named = [name for line in re.findall(r"^    (\w[\w, ]*)$", section, re.M) for name in line.split(", ")]
        assert sorted(named) == sorted(field.name for field in dataclasses.fields(kind)), kind.__name__


@pytest.mark.filterwarnings("ignore:the tone at .* distinct phases")
# Both recorders hear the same samples.
@pytest.mark.filterwarnings("ignore:.* sample at one instant")
def test_captures_are_the_same_in_every_form(folder):
    """Arrays either way round, arrays with names, tables and files."""
    x = capture()
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    named = xarray.DataArray(x, dims=("channel", "time"))
    files = [folder / "ch1.npy", folder / "ch2.npy"]
    forms = [x, named, named.T, pandas.DataFrame(x.T), files, hb.read(files), xarray.DataArray(x.T, dims=("n", "i"))]
    forms = [(form, {}) for form in forms[:-1]] + [(forms[-1], {"axis": 0}), (np.ascontiguousarray(x.T), {"axis": 0})]
    bank = hb.load(folder / "bank.json")
    calibrated = [hb.calibrate(form, SPEC, tones=[1e6, 7e6], **axis) for form, axis in forms]
    assert len({one.spec for one in calibrated}) == 1 and abs(calibrated[0].delay[1] - 29.5e-9) < 1e-11
    pages = []
    for form, axis in forms:
        bank.report(folder / "page.html", form, overwrite=True, **axis)
        pages.append((folder / "page.html").read_text())
    assert len(set(pages)) == 1
    y = [np.asarray(bank.fuse(form, dtype="f8", **axis)) for form, axis in forms]
    assert all((one == y[0]).all() for one in y)
    sound = np.random.default_rng(4).standard_normal(30_000) / 10
    x = np.stack([sound[:-300], sound[300:]])
    named = xarray.DataArray(x, dims=("channel", "time"))
    for i in (0, 1):
        np.save(folder / f"s{i}.npy", x[i])
    files = [folder / "s0.npy", folder / "s1.npy"]
    forms = [x, list(x), named, named.T, pandas.DataFrame(x.T), files, hb.read(files), (x[0], pandas.Series(x[1]))]
    aligned = [hb.align(form, SPEC) for form in forms] + [hb.align(x.T, SPEC, axis=0)]
    assert {(one.spec, *one.skip) for one in aligned} == {(aligned[0].spec, 300, 0)}
    assert hb.align(files, bank).delay[1] == aligned[0].delay[1]


def test_recordings_of_another_rate_than_the_spec_are_refused(folder):
    soundfile = pytest.importorskip("soundfile")
    for i, row in enumerate(capture()):
        soundfile.write(folder / f"ch{i + 1}.wav", row / 2, int(RATE / 2) + 1000, subtype="FLOAT")
    files = [folder / "ch1.wav", folder / "ch2.wav"]
    for call in (hb.calibrate, hb.align):
        with pytest.raises(hb.HybankError, match="the sample rate is 16001000 Hz, but the spec says 16000000 Hz"):
            call(files, SPEC)
