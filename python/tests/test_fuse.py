"""Whole signals: every layout and number type, against the definition and the command line."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import threading
import tracemalloc

import numpy as np
import pytest
from oracles import aligned, assert_identical, polyphase_sum

import hybank as hb


def test_the_output_is_the_sum_of_the_definition_and_lines_up(fir, random):
    x = random.standard_normal((2, 500))
    want = aligned(fir.taps, fir.ratio, fir.latency, x)
    y = fir.fuse(x)
    assert y.dtype == np.float64 and y.shape == (1000,)
    np.testing.assert_allclose(y, want, atol=1e-13)
    single = fir.fuse(x.astype("f4"))
    assert single.dtype == np.float32
    np.testing.assert_allclose(single, want, atol=1e-5)
    causal = fir.fuse(x, keep_latency=True)
    np.testing.assert_allclose(causal, polyphase_sum(fir.taps, fir.ratio, x), atol=1e-13)


@pytest.mark.parametrize("frames", [0, 1, 2, 3, 4, 7])
def test_signals_shorter_than_the_latency_line_up_too(fir, random, frames):
    x = random.standard_normal((2, frames))
    np.testing.assert_allclose(fir.fuse(x), aligned(fir.taps, fir.ratio, fir.latency, x), atol=1e-13)


@pytest.mark.parametrize("dtype", ["f4", "f8", "i1", "i2", "i4", "u1", "c8", "c16"])
def test_every_layout_in_memory_gives_the_same_bits(fir, random, dtype):
    frames = 301
    if np.dtype(dtype).kind == "u":
        x = random.integers(0, 256, (2, frames)).astype(dtype)
    elif np.dtype(dtype).kind == "i":
        top = np.iinfo(dtype).max
        x = random.integers(-top, top, (2, frames)).astype(dtype)
    else:
        x = random.standard_normal((2, frames))
        if np.dtype(dtype).kind == "c":
            x = x + 1j * random.standard_normal((2, frames))
        x = x.astype(dtype)
    want = fir.fuse(x)
    wide = np.zeros((4, 3 * frames), dtype)
    wide[::2, ::3] = x
    rows = np.zeros((4, frames + 10), dtype)
    rows[::-2, 5:-5] = x
    layouts = [
        (np.asfortranarray(x), -1),
        (np.ascontiguousarray(x.T), 0),
        (np.asfortranarray(x.T), 0),
        (x.T, -2),
        (wide[::2, ::3], 1),
        (rows[::-2, 5:-5], 1),
        (rows[::-2, 5:-5].T, 0),
        (x[::-1, ::-1].copy()[::-1, ::-1], -1),
        (x.astype(np.dtype(dtype).newbyteorder(">")), -1),
    ]
    for array, axis in layouts:
        assert_identical(fir.fuse(array, axis=axis), want)
    unaligned = np.frombuffer(b"\0" + x.tobytes(), dtype, offset=1).reshape(x.shape)
    assert_identical(fir.fuse(unaligned), want)


def test_integers_have_full_scale_one_and_outputs_saturate(fir, random):
    x = random.integers(-32768, 32768, (2, 400)).astype("i2")
    exact = fir.fuse(x / 32768.0)
    np.testing.assert_allclose(fir.fuse(x), exact, atol=2e-6)
    with pytest.warns(UserWarning, match="clipped"):
        y, report = fir.fuse(x, dtype=np.int16, full_output=True)
    scaled = np.rint(exact * 32768)
    assert y.dtype == np.int16
    np.testing.assert_allclose(y, np.clip(scaled, -32768, 32767), atol=1)
    over = np.count_nonzero((scaled > 32768) | (scaled < -32769))
    assert 0 < over <= report.clipped <= over + np.count_nonzero(np.abs(scaled) >= 32767)


def test_complex_samples_are_two_real_signals(fir, random):
    x = (random.standard_normal((2, 200)) + 1j * random.standard_normal((2, 200))).astype("c8")
    y = fir.fuse(x)
    assert y.dtype == np.complex64
    np.testing.assert_array_equal(y.real, fir.fuse(np.ascontiguousarray(x.real)))
    np.testing.assert_array_equal(y.imag, fir.fuse(np.ascontiguousarray(x.imag)))
    assert fir.fuse(x, dtype="f8").dtype == np.complex128


def test_threads_change_no_bit(filters, random):
    bank = hb.load(filters / "interleaved-4x250M.json")
    x = random.standard_normal((4, 200_000)).astype("f4")
    for algorithm in ("direct", "overlap-save"):
        one, report = bank.fuse(x, algorithm=algorithm, full_output=True)
        assert report.plan.algorithm == algorithm
        np.testing.assert_array_equal(bank.fuse(x, threads=2, algorithm=algorithm), one)


def test_missing_samples_are_estimated_and_marked(fir, random):
    x = random.standard_normal((2, 300)).astype("f4")
    whole = fir.fuse(x, dtype="f8", algorithm="direct")
    x[1, 100:104] = np.nan
    y, report = fir.fuse(x, gaps=True, dtype="f8", full_output=True)
    assert (report.missing, [gap[:3] for gap in report.gaps], report.replaced) == (4, [(2, 100, 4)], 0)
    # Of noise nothing tells the missing samples, so an output is affected if it differs.
    np.testing.assert_array_equal(report.mask > 0, y != whole)
    assert abs(report.mask[report.mask > 0].min() - report.gaps[0][3]) < 1
    with pytest.warns(UserWarning, match="4 input samples were missing"):
        zeros, report = fir.fuse(x, full_output=True)
    assert (report.replaced, report.gaps, report.mask) == (4, None, None)
    np.testing.assert_array_equal(zeros, fir.fuse(np.nan_to_num(x)))


def test_a_complex_sample_with_one_part_missing_is_missing(fir, random):
    x = (random.standard_normal((2, 300)) + 1j * random.standard_normal((2, 300))).astype("c8")
    whole = fir.fuse(x, algorithm="direct")
    x[0, 50] = complex(x[0, 50].real, np.nan)
    x[1, 100], x[1, 101] = complex(np.nan, 1.0), complex(2.0, np.inf)
    y, report = fir.fuse(x, gaps=True, full_output=True)
    np.testing.assert_array_equal(y[report.mask == 0], whole[report.mask == 0])
    # Once, not once for each part.
    assert (report.missing, [gap[:3] for gap in report.gaps]) == (3, [(1, 50, 1), (2, 100, 2)])


def write_wav(path, samples, rate):
    """A mono WAV file of 32-bit floats or 16-bit integers."""
    data, (tag, size) = samples.tobytes(), (3, 4) if samples.dtype == np.float32 else (1, 2)
    header = np.array([16], "<u4").tobytes() + np.array([tag, 1], "<u2").tobytes()
    header += np.array([rate, rate * size], "<u4").tobytes() + np.array([size, 8 * size], "<u2").tobytes()
    chunks = b"WAVEfmt " + header + b"data" + np.array([len(data)], "<u4").tobytes() + data
    path.write_bytes(b"RIFF" + np.array([len(chunks)], "<u4").tobytes() + chunks)


@pytest.mark.parametrize("name", ["speech-2x", "vibration-3x"])
@pytest.mark.parametrize("dtype", ["f4", "i2"])
@pytest.mark.parametrize("bits, output", [("32f", "f4"), ("64f", "f8"), ("16", "i2")])
def test_the_bits_are_those_of_the_command_line(binary, filters, tmp_path, random, name, dtype, bits, output):
    bank = hb.load(filters / f"{name}.json")
    frames = 5000
    x = 0.3 * random.standard_normal((bank.channels, frames))
    x = x.astype("f4") if dtype == "f4" else (np.clip(x, -1, 1) * 32767).astype("i2")
    rate = round(1 / (bank.fast_period * bank.ratio))
    names = [tmp_path / f"{i}.wav" for i in range(bank.channels)]
    for path, samples in zip(names, x, strict=True):
        write_wav(path, samples, rate)
    out = tmp_path / "out.wav"
    command = [binary, "fuse", filters / f"{name}.json", *names, "-o", out, "--bits", bits, "--json"]
    report = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    written = out.read_bytes()
    want = np.frombuffer(written[-frames * bank.ratio * np.dtype(output).itemsize :], output)
    with pytest.warns(UserWarning, match="clipped") if report["clipped"] else contextlib.nullcontext():
        y, info = bank.fuse(x, dtype=output, full_output=True)
    assert y.tobytes() == want.tobytes()
    assert (info.plan.algorithm, info.clipped) == (report["plan"]["algorithm"], report["clipped"])
    assert info.latency_dropped == report["latency_dropped"]


@pytest.mark.parametrize("axis", [-1, 0])
@pytest.mark.parametrize("dtype", ["f4", "i2", "c8"])
def test_no_layout_is_copied(fir, axis, dtype):
    x = np.zeros((2, 1_000_000) if axis else (1_000_000, 2), dtype)
    fir.fuse(x, axis=axis)
    arrays = [x, x[:, 10:-10]] if axis and dtype != "c8" else [x]
    for array in arrays:
        tracemalloc.start()
        y = fir.fuse(array, axis=axis)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < y.nbytes + 100_000, f"{peak} bytes at most, {y.nbytes} of them are the output"


RESIDENT = """
import resource, sys, numpy as np, hybank as hb
bank = hb.load(sys.argv[1])
axis = int(sys.argv[2])
x = np.ones((2, 8_000_000) if axis else (8_000_000, 2), "f4")
bank.fuse(x[:, :1000].copy() if axis else x[:1000], axis=axis)
before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
y = bank.fuse(x, axis=axis)
print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before - y.nbytes // 1024)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="ru_maxrss has another unit elsewhere")
@pytest.mark.parametrize("axis", [-1, 0])
def test_resident_memory_grows_by_the_output_alone(filters, axis):
    command = [sys.executable, "-c", RESIDENT, filters / "thesis-fir.json", str(axis)]
    extra = int(subprocess.run(command, check=True, capture_output=True).stdout)
    assert extra < 4096, f"{extra} KiB beside the output of 64 MB, the input has 64 MB"


def test_ctrl_c_ends_a_long_fusion(random):
    """A second thread sends a signal, waits until it was handled, and sends the next. A fusion that handled signals
    only at its end would handle one, and the third raises."""
    taps = [{"delay": 0.0, "taps": list(random.standard_normal(4096))}] * 2
    head = {"format": "hybank-bank", "version": 1, "fast_period": 1.0, "ratio": 2, "latency": 0, "method": "fir"}
    gamma = dict.fromkeys(("norm", "upper", "lower", "noncausal"))
    bank = hb.Bank.from_json(json.dumps({**head, "channels": taps, "gamma": gamma}))
    x, handled, calls, over = np.zeros((2, 20_000_000), "f4"), threading.Semaphore(0), [], threading.Event()

    def handle(*_):
        calls.append(1)
        handled.release()
        if len(calls) == 3:
            raise KeyboardInterrupt

    def send():
        while not over.wait(0.01) and len(calls) < 3:
            os.kill(os.getpid(), signal.SIGINT)
            handled.acquire()

    before, sender = signal.signal(signal.SIGINT, handle), threading.Thread(target=send)
    try:
        with pytest.raises(KeyboardInterrupt):
            sender.start()
            bank.fuse(x, algorithm="direct")
    finally:
        over.set()
        handled.release()
        sender.join()
        signal.signal(signal.SIGINT, before)


def test_wrong_arrays_are_refused_with_the_remedy(fir):
    for x, words in [
        (np.zeros((100, 2)), "give axis=0"),
        (np.zeros((3, 100)), "3 channels"),
        (np.zeros(100), "1 channels"),
        (np.zeros((2, 2, 2)), "3 dimensions"),
        (np.zeros((2, 10), "u8"), "convert them to floats"),
        (np.zeros((2, 10), "O"), "convert them to floats"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            fir.fuse(x)
    x = np.zeros((2, 10))
    for keywords, words in [
        ({"axis": 2}, "axis of time"),
        ({"dtype": "u8"}, "choose one"),
        ({"dtype": "c8"}, "samples are real"),
        ({"algorithm": "fft"}, "choose auto"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            fir.fuse(x, **keywords)
    with pytest.raises(hb.HybankError, match="c8 or c16"):
        fir.fuse(x.astype("c8"), dtype="i2")
