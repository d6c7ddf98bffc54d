"""Converters with sample rates of their own."""

import numpy as np
import pytest

import hybank as hb


@pytest.fixture(scope="module")
def bank():
    """24 kHz and 16 kHz into 48 kHz: frames of 6 samples from 3 and 2."""
    return hb.design(
        fast_rate=48e3,
        latency=22,
        target=hb.butterworth(4, 14e3),
        channels=[hb.Channel(delay_samples=0.3, rate=24e3), hb.Channel(delay_samples=1.1, rate="16 kHz", offset=0.01)],
        signal="13 kHz",
        method="h2",
        taps=72,
        noise=1e-4,
    )


@pytest.fixture(scope="module")
def capture(bank):
    return hb.simulate(bank, "tones:1kHz,9kHz,12kHz", samples=6000, gain=0.2)


def test_a_list_of_signals_is_fused(bank, capture):
    assert (bank.channels, bank.samples, bank.ratio) == (2, [3, 2], 6)
    assert bank.taps.shape == (5, 72) and len(bank.delays) == 2
    x1, x2 = capture.channels
    assert (len(x1), len(x2), len(capture.target)) == (3000, 2000, 6000)
    y = bank.fuse([x1, x2])
    inner = slice(300, -300)
    error = (y - capture.target)[inner]
    assert 20 * np.log10(np.std(capture.target[inner]) / np.std(error)) > 50
    frames = np.concatenate([x1.reshape(-1, 3), x2.reshape(-1, 2)], axis=1)
    assert (bank.fuse(frames, axis=0) == y).all()
    # The shortest counts, in whole frames.
    assert (bank.fuse((x1[:-1], x2))[:5000] == y[:5000]).all() and len(bank.fuse((x1[:-1], x2))) == 5994


def test_streams_take_whole_frames(bank, capture):
    x1, x2 = (x.astype("f4") for x in capture.channels)
    with bank.stream() as s:
        blocks = [s.process([x1[3 * k : 3 * k + 30], x2[2 * k : 2 * k + 20]]) for k in range(0, 1000, 10)]
        late = np.concatenate(blocks)
        assert s.channels == 5 and s.latency == 18
        with pytest.raises(hb.HybankError, match="whole frames"):
            s.process([x1[:31], x2[:20]])
    causal = bank.fuse([x1, x2], keep_latency=True, algorithm="direct")
    assert (late == causal[: len(late)]).all()


def test_wrong_lists_are_refused(bank, capture):
    x1, x2 = capture.channels
    with pytest.raises(hb.HybankError, match="1 signals for 2 converters"):
        bank.fuse([x1])
    with pytest.raises(hb.HybankError, match="different types"):
        bank.fuse([x1, x2.astype("f4")])
    with pytest.raises(hb.HybankError, match="one dimension"):
        bank.fuse([x1.reshape(-1, 3), x2])


@pytest.mark.filterwarnings("ignore:the tones contradict each other")
def test_converters_are_calibrated(bank):
    found = hb.calibrate(
        hb.simulate(bank, "tones:1.1kHz,2.3kHz,9.7kHz", samples=24000, gain=0.2).channels,
        bank.spec,
        tones=[1.1e3, 2.3e3, 9.7e3],
    )
    assert abs(found.delay[1] * 48e3 - 1.1) < 1e-6 and abs(found.gain[1] - 1) < 1e-6
    assert abs(found.offset[1] - 0.01) < 1e-6
