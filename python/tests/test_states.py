"""States of streams: bytes and pickles, in this process and in another one."""

import pickle
import subprocess
import sys

import numpy as np
import pytest

import hybank as hb

KINDS = [("thesis-fir", "direct"), ("thesis-fir", "overlap-save"), ("thesis-iir", "auto")]


@pytest.mark.parametrize("dtype", ["f4", "f8", "i2", "c8"])
@pytest.mark.parametrize("name, algorithm", KINDS)
def test_a_stream_goes_on_from_its_state(filters, random, name, algorithm, dtype):
    bank = hb.load(filters / f"{name}.json")
    # More than the latency of overlap-save, so that samples come out.
    x = 2 * random.standard_normal((2, 4000))
    x = (x + 1j * x[::-1]).astype("c8") if dtype == "c8" else x
    settings = {"dtype": dtype, "algorithm": algorithm}
    s = bank.stream(**settings)
    s.process(x[:, :333])
    others = [bank.stream(**settings, state=s.state), pickle.loads(pickle.dumps(s))]
    y = s.process(x[:, 333:])
    for other in others:
        assert not other.agrees(s.state)
        np.testing.assert_array_equal(other.process(x[:, 333:]), y)
        assert other.agrees(s.state) and other.state == s.state
        assert (other.position, other.clipped, other.algorithm) == (4000, s.clipped, s.algorithm)
    assert (s.clipped > 0) == (dtype == "i2")


def test_counts_do_not_matter_for_what_comes(fir, random):
    x = random.standard_normal((2, 100))
    one, two = fir.stream(), fir.stream()
    one.process(x)
    two.process(x[:, 50:])
    assert one.agrees(two.state) and one.position != two.position


def test_what_is_no_state_of_the_stream_is_refused(fir, iir):
    state = fir.stream().state
    for other in (b"", b"\0" * 8, state[:-1], state[:-8], state + state):
        with pytest.raises(hb.HybankError, match="state"):
            fir.stream(state=other)
    for stream in (iir.stream, lambda **s: fir.stream(algorithm="overlap-save", **s), lambda **s: fir.stream(dtype="f8", **s)):
        with pytest.raises(hb.HybankError, match="another plan"):
            stream(state=state)


RESUME = """
import pickle, sys, numpy as np
s, x = pickle.load(sys.stdin.buffer)
sys.stdout.buffer.write(s.process(x).tobytes())
"""


def test_another_process_goes_on(iir, random):
    x = random.standard_normal((300, 2))
    s = iir.stream(axis=0, dtype="f8")
    s.process(x[:100])
    sent = pickle.dumps((s, x[100:]))
    run = subprocess.run([sys.executable, "-c", RESUME], input=sent, check=True, capture_output=True)
    assert run.stdout == s.process(x[100:]).tobytes()


def test_a_closed_stream_stays_closed(fir):
    with fir.stream() as s:
        pass
    with pytest.raises(hb.HybankError, match="closed"):
        pickle.loads(pickle.dumps(s)).process(np.zeros((2, 1)))
