"""Codes of a converter have its full scale, in whatever numbers they come."""

import warnings

import numpy as np
import pytest

import hybank as hb

TYPES = ["i2", "i4", "i8", "u2", "u4", ">i2", ">u4", "f4", "f8"]
SPEC = {
    "fast_rate": 200e6, "ratio": 2, "target": {"filter": {"family": "butterworth", "order": 4, "cutoff": 120e6}},
    "channel": [{"delay_samples": 1}, {"delay_samples": 0}], "signal": {"band": 90e6},
}  # fmt: skip


@pytest.fixture
def codes():
    """Codes of 12 bits of two converters that take turns, of a tone."""
    x = np.cos(2 * np.pi * 37.123e6 * np.arange(8192) / 200e6)
    return np.rint(1900 * x).astype("i8").reshape(-1, 2).T


def of_type(codes, kind):
    return (codes + 2048 if "u" in kind else codes).astype(kind)


@pytest.mark.parametrize("kind", TYPES)
def test_every_type_of_codes_gives_the_same_samples(fir, codes, kind):
    want = codes / 2048
    x, scale = of_type(codes, kind), "12bits"
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        np.testing.assert_array_equal(fir.fuse(x, dtype="f8", full_scale=scale), fir.fuse(want))
        stream = fir.stream(dtype="f8", full_scale=scale)
        np.testing.assert_array_equal(
            np.concatenate([stream.process(part) for part in np.split(x, 8, axis=1)]), fir.stream(dtype="f8").process(want)
        )
        assert hb.measure(x[0], 100e6, full_scale=scale).sinad_db == pytest.approx(hb.measure(want[0], 100e6).sinad_db)
        found = hb.calibrate(x, SPEC, tones=[37.123e6], full_scale=scale)
    assert found.offset == pytest.approx(hb.calibrate(want, SPEC, tones=[37.123e6]).offset, abs=1e-9)


def test_the_spec_holds_for_arrays_and_codes_may_stand_high(fir, codes):
    bits = {**SPEC, "channel": [{**channel, "bits": 12} for channel in SPEC["channel"]]}
    want = hb.calibrate(codes / 2048, SPEC, tones=[37.123e6]).offset
    for spec, x in [({**SPEC, "full_scale": "12bits"}, codes), (bits, codes.astype("i2")), (bits, (16 * codes).astype("i2"))]:
        assert hb.calibrate(x, spec, tones=[37.123e6]).offset == pytest.approx(want, abs=1e-9)


def test_integers_without_a_full_scale_draw_a_warning_and_lists_are_integers(fir, codes):
    with pytest.warns(UserWarning, match="12bits of words of 16"):
        y = fir.fuse(codes.astype("i2"))
    np.testing.assert_allclose(y, fir.fuse(codes / 32768), atol=1e-6)
    with pytest.warns(UserWarning, match="12bits of words of 64"):
        y = fir.fuse(codes.tolist(), dtype="f8")
    np.testing.assert_array_equal(y, fir.fuse(codes / 2.0**63))


def test_codes_beyond_the_full_scale_are_refused(fir, codes):
    for run in (fir.fuse, fir.stream(full_scale="10bits").process):
        keywords = {"full_scale": "10bits"} if run == fir.fuse else {}
        with pytest.raises(hb.HybankError, match="beyond a full scale of 10bits"):
            run(codes, **keywords)
    with pytest.raises(hb.HybankError, match="full_scale"):
        fir.fuse(codes, full_scale="12 bitz")
    with pytest.raises(hb.HybankError, match="true or false"):
        fir.fuse(codes > 0)


def test_pairs_of_channels_of_a_wav_are_complex(tmp_path, fir):
    soundfile = pytest.importorskip("soundfile")
    pairs = np.arange(40.0).reshape(-1, 2) / 64
    soundfile.write(tmp_path / "iq.wav", pairs, 48_000, subtype="FLOAT")
    read = hb.read(tmp_path / "iq.wav", iq=True).channels
    np.testing.assert_array_equal(read[0], pairs[:, 0] + 1j * pairs[:, 1])
