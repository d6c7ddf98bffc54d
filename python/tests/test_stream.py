"""Streams: blocks of any size, several threads, ends."""

import copy
import threading

import numpy as np
import pytest
from oracles import polyphase_sum

import hybank as hb


@pytest.mark.parametrize("name", ["thesis-fir", "thesis-iir", "vibration-3x"])
def test_blocks_of_any_size_give_the_bits_of_one_call(filters, random, name):
    bank = hb.load(filters / f"{name}.json")
    x = random.standard_normal((1000, bank.channels)).astype("f4")
    whole = bank.fuse(x, axis=0, algorithm="direct" if bank.taps is not None else "auto")
    with bank.stream(axis=0, algorithm="direct" if bank.taps is not None else "auto") as s:
        parts, first = [], 0
        for size in [1, 2, 3, 64, 0, 500, 430]:
            parts.append(s.process(x[first : first + size]))
            first += size
        assert s.position == first == 1000
        parts.append(s.flush())
    y = np.concatenate(parts)
    np.testing.assert_array_equal(y[s.latency : s.latency + len(whole)], whole)
    with pytest.raises(hb.HybankError, match="closed"):
        s.process(x)


def test_a_stream_is_causal_and_computes_the_definition(fir, random):
    x = random.standard_normal((2, 50))
    s = fir.stream(dtype="f8")
    np.testing.assert_allclose(s.process(x), polyphase_sum(fir.taps, fir.ratio, x), atol=1e-13)
    assert (s.latency, s.memory, s.alignment) == (fir.latency, fir.taps.shape[1] // fir.ratio - 1, 1)
    s.reset()
    np.testing.assert_array_equal(s.process(x), fir.stream(dtype="f8").process(x))


def test_memory_and_alignment_say_where_a_second_stream_may_begin(filters, random):
    bank = hb.load(filters / "interleaved-4x250M.json")
    for algorithm in ("direct", "overlap-save"):
        s = bank.stream(algorithm=algorithm)
        x = random.standard_normal((4, 5 * s.alignment + 1000)).astype("f4")
        whole = s.process(x)
        start = 3 * s.alignment
        warm = -(-s.memory // s.alignment) * s.alignment
        later = bank.stream(algorithm=algorithm)
        first = max(start - warm, 0)
        y = later.process(x[:, first:])
        skip = (start - first) * bank.ratio + (later.latency - bank.latency)
        np.testing.assert_array_equal(y[skip:], whole[start * bank.ratio + (s.latency - bank.latency) :])


def test_a_recursion_never_forgets(iir):
    assert iir.stream().memory is None


def test_a_copy_goes_on_from_the_same_place(fir, random):
    x = random.standard_normal((2, 64)).astype("f4")
    s = fir.stream()
    s.process(x)
    other = copy.copy(s)
    np.testing.assert_array_equal(s.process(x), other.process(x))


def test_complex_blocks_and_counts(fir, random):
    x = (random.standard_normal((2, 90)) + 1j * random.standard_normal((2, 90))).astype("c8")
    x[0, 5] = complex(np.nan, 1)
    s = fir.stream(dtype="c8")
    y = np.concatenate([s.process(x[:, :31]), s.process(x[:, 31:])])
    real, imaginary = fir.stream(), fir.stream()
    np.testing.assert_array_equal(y.real, real.process(x.real.copy()))
    np.testing.assert_array_equal(y.imag, imaginary.process(x.imag.copy()))
    assert (s.replaced, s.position) == (1, 90)
    for stream, block in [(s, x.real.copy()), (real, x)]:
        with pytest.raises(hb.HybankError, match="bank.stream"):
            stream.process(block)


def test_integer_outputs_count_what_saturates(fir):
    s = fir.stream(dtype="i2")
    y = s.process(np.full((2, 100), 5.0, "f4"))
    assert y.dtype == np.int16 and s.clipped > 50


def test_two_threads_share_a_stream_without_mixing_blocks(fir):
    """Every block is filtered as a whole: constants of the same value give the same outputs wherever they come."""
    s = fir.stream(algorithm="direct")
    block = np.ones((2, 4096), "f4")
    settled = s.process(block)[-1]
    wrong = []

    def work():
        for _ in range(200):
            y = s.process(block)
            if not (y[-1] == settled and np.isfinite(y).all()):
                wrong.append(y)

    threads = [threading.Thread(target=work) for _ in range(2)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert not wrong and s.position == 401 * 4096
