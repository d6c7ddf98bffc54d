"""Input that is not as it should be: a message or the right answer, never a wrong one, a crash or an endless wait."""

import copy
import itertools
import pickle
import subprocess
import sys
import threading

import numpy as np
import pytest
from oracles import assert_identical

import hybank as hb

SPEC = {
    "fast_rate": 48e3, "ratio": 2, "latency": 4, "target": {"filter": hb.butterworth(2, 9e3)},
    "channel": [hb.Channel(delay=25e-6), hb.Channel(delay=12.5e-6)], "design": {"taps": 8},
}  # fmt: skip


def test_what_resembles_an_array_gives_the_same_bits(fir, random):
    x = random.standard_normal((2, 64))
    want = fir.fuse(x)
    read_only = x.copy()
    read_only.setflags(write=False)

    class Subclass(np.ndarray):
        pass

    class Other:
        def __array__(self, dtype=None, copy=None):
            return x

    for same in (read_only, x.view(Subclass), np.ma.masked_array(x), memoryview(x), Other(), x.tolist()):
        assert_identical(fir.fuse(same), want)
    rows = np.broadcast_to(x[0], (2, 64))
    np.testing.assert_array_equal(fir.fuse(rows), fir.fuse(rows.copy()))
    assert_identical(fir.fuse([[1, 2], [3, 4]]), fir.fuse(np.array([[1, 2], [3, 4]], "i8")))


def test_half_precision_is_read_exactly(fir, random):
    x = random.standard_normal((2, 64)).astype("f2")
    assert_identical(fir.fuse(x), fir.fuse(x.astype("f4")))
    np.testing.assert_array_equal(fir.stream().process(x.T[:, ::-1].T), fir.stream().process(x[::-1].astype("f4")))


def test_masked_samples_are_refused_not_read(fir):
    x = np.ma.masked_greater(np.arange(20.0).reshape(2, 10), 15)
    for run in (fir.fuse, fir.stream().process, lambda x: hb.measure(x[1], 1.0), lambda x: hb.calibrate(x, fir)):
        with pytest.raises(hb.HybankError, match="filled"):
            run(x)
    assert np.isfinite(fir.fuse(x.filled(np.nan), gaps=True)).all()


@pytest.mark.parametrize("shape, axis", [((2, 0), -1), ((0, 2), 0)])
@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", ["f4", "i2", "c8", ">f8"])
def test_no_frames_give_no_samples(fir, iir, shape, axis, order, dtype):
    x = np.zeros(shape, dtype, order)
    for bank in (fir, iir):
        assert bank.fuse(x, axis=axis).shape == (0,)
        s = bank.stream(axis=axis, dtype="c8" if dtype == "c8" else "f4")
        assert s.process(x).shape == (0,) and s.position == 0


@pytest.mark.filterwarnings("ignore:.*its samples reach 1e308")
def test_huge_values_and_nan_stay_where_they_are(fir, iir):
    for bank in (fir, iir):
        x = np.zeros((2, 600))
        x[0, 5], x[1, 6:9] = 1e308, [np.nan, np.inf, -np.inf]
        with pytest.warns(UserWarning, match="replaced by 0"):
            y, report = bank.fuse(x, full_output=True)
        assert report.replaced == 3 and np.isfinite(y[-10:]).all()
        quiet = bank.fuse(np.full((2, 50), 5e-324))
        assert np.abs(quiet).max() < 1e-300
    with pytest.warns(UserWarning, match="replaced by 0"):
        y, report = fir.fuse(np.full((2, 10), 1e308), dtype="f4", full_output=True)
    assert report.replaced == 20 and not y.any()


@pytest.mark.parametrize("dtype", ["u8", "g", "M8[s]", "U3"])
def test_other_number_types_are_refused_with_the_ones_that_are_read(fir, dtype):
    with pytest.raises(hb.HybankError, match=r"convert them to floats .* complex"):
        fir.fuse(np.zeros((2, 4), dtype))


@pytest.mark.parametrize("threads", [-1, 1025, 65535, 10**9])
def test_threads_are_few(fir, threads):
    with pytest.raises(hb.HybankError, match="1 to 1024"):
        fir.fuse(np.zeros((2, 4)), threads=threads)


@pytest.mark.parametrize("n", [-1, 10**8, 10**11])
def test_a_response_has_an_end(fir, n):
    with pytest.raises(hb.HybankError, match="give 0 to 10000000"):
        fir.error_response(n)


class Endless(dict):
    """An object whose list is itself."""

    def tolist(self):
        return self


def test_mappings_that_have_no_end_are_refused():
    circle = dict(SPEC)
    circle["target"] = circle
    ring = []
    ring.append(ring)
    for source, words in [
        (circle, "contain itself"),
        ({**SPEC, "channel": ring}, "contain itself"),
        (Endless(), "contain itself"),
        ({**SPEC, "channel": itertools.count()}, "more than 1000000 entries"),
    ]:
        with pytest.raises(TypeError, match=words):
            hb.design(source)


@pytest.mark.parametrize(
    "change, words",
    [
        ({1: 2}, "must be texts, not int"),
        ({"design": {None: 8}}, "design: the keys"),
        ({"name": b"bytes"}, "name: .* not bytes"),
        ({"ratio": 10**400}, "ratio: the number is too large"),
    ],
)
def test_wrong_objects_of_a_mapping_are_named(change, words):
    with pytest.raises(TypeError, match=words):
        hb.design({**SPEC, **change})


@pytest.mark.parametrize("change, words", [({"ratios": 2}, '"ratio"'), ({"design": {"tabs": 8}}, '"taps"')])
def test_wrong_keys_of_a_mapping_have_the_right_ones_beside_them(change, words):
    with pytest.raises(hb.SpecError, match=f"did you mean {words}"):
        hb.design({**SPEC, **change})


MEMORY = """
import resource, sys, numpy as np, hybank as hb
bank = hb.load(sys.argv[1])
with open(sys.argv[2], "wb") as file:
    file.truncate(1 << 30)
x = np.memmap(sys.argv[2], "i1", "r", shape=(2, 1 << 29))
used = next(int(line.split()[1]) << 10 for line in open("/proc/self/status") if line.startswith("VmSize"))
resource.setrlimit(resource.RLIMIT_AS, (used + (1 << 30),) * 2)
runs = [lambda: bank.fuse(x), lambda: bank.stream().process(x), lambda: hb.measure(x[0], 1.0),
        lambda: hb.calibrate(x, bank, blind=True), lambda: hb.simulate(bank, x[0])]
for run in runs:
    try:
        run()
        print("done")
    except MemoryError as error:
        print("MemoryError")
"""


@pytest.mark.skipif(sys.platform != "linux", reason="limits the address space")
def test_too_little_memory_is_a_memory_error(filters, tmp_path):
    command = [sys.executable, "-c", MEMORY, filters / "thesis-fir.json", tmp_path / "sparse"]
    run = subprocess.run(command, capture_output=True, text=True, check=False)
    assert run.stdout.split() == ["MemoryError"] * 5, run.stdout + run.stderr


def test_results_can_be_pickled_and_copied(fir, tmp_path):
    x = np.ones((2, 50))
    n = np.arange(3000)
    results = [
        fir.gamma,
        fir.fuse(x, gaps=True, full_output=True)[1],
        hb.verify(fir),
        hb.analyze(fir),
        hb.simulate(fir, "ctones:0.3", samples=100),
        hb.measure(0.9 * np.exp(0.3j * n), 1.0),
        hb.calibrate(np.sin(0.2 * n + np.array([[0.0], [0.12]])), fir, tones=[0.05 / np.pi]),
        hb.ibr.render([np.ones((4, 5))], disparity=[np.ones((4, 5))], positions=[0], at=0),
    ]
    for result in results:
        names = [name for name in dir(result) if not name.startswith("_") and not callable(getattr(result, name))]
        for other in (pickle.loads(pickle.dumps(result)), copy.copy(result), copy.deepcopy(result)):
            assert type(other) is type(result) and names
            for name in names:
                np.testing.assert_equal(getattr(other, name), getattr(result, name))
    path = tmp_path / "a.wav"
    path.write_bytes(b"RIFF\x28\0\0\0WAVEfmt \x10\0\0\0\1\0\1\0\x40\x1f\0\0\x80\x3e\0\0\2\0\x10\0data\4\0\0\0\0\x40\0\xc0")
    recording = pickle.loads(pickle.dumps(hb.Recording(path)))
    np.testing.assert_array_equal(recording.read(0, 10), [[0.5], [-0.5]])
    assert recording.read(2**63, 5).shape == (0, 1)


def test_an_error_of_a_spec_keeps_its_place_in_a_pickle():
    with pytest.raises(hb.SpecError) as caught:
        hb.design({**SPEC, "ratio": -1})
    other = pickle.loads(pickle.dumps(caught.value))
    assert (other.path, other.line, str(other)) == ("ratio", None, str(caught.value))


def test_threads_may_call_anything_of_one_stream(fir):
    s = fir.stream(axis=0)
    failures = []

    def work():
        for k in range(100):
            try:
                s.process(np.ones((k % 37, 2), "f4"))
                s.agrees(s.state)
                copy.copy(s).flush()
                pickle.loads(pickle.dumps(s)).process(np.ones((3, 2), "f4"))
                if k % 20 == 0:
                    s.reset()
            except Exception as error:  # noqa: BLE001
                failures.append(error)

    threads = [threading.Thread(target=work) for _ in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert not failures
    s.reset()
    np.testing.assert_array_equal(s.process(np.ones((50, 2), "f4")), fir.stream(axis=0).process(np.ones((50, 2), "f4")))


HOSTILE = "\x1b[2J\x9b31m\u202e\x07\r\nhybank: forged"


@pytest.mark.parametrize("text", [HOSTILE, "x" * 1_000_000, HOSTILE * 1000])
def test_messages_quote_what_is_foreign(fir, tmp_path, text):
    path = tmp_path / "bank.json"
    path.write_text('{"format": "hybank-bank", "version": 1, "spec": null, "' + "x" * 1000 + '": 1}')
    runs = [
        lambda: hb.design({**SPEC, text: 2}),
        lambda: hb.design({**SPEC, "design": {"method": text}}),
        lambda: hb.design({**SPEC, "channel": [hb.Channel(delay=text)]}),
        lambda: hb.design({text: object()}),
        lambda: hb.design(f"ratio = 2\n{text} = 3\n"),
        lambda: hb.design(fir, **{text: 2}),
        lambda: hb.load(path),
        lambda: hb.simulate(fir, text),
        lambda: fir.fuse(np.zeros((2, 4)), algorithm=text),
        lambda: hb.measure(np.zeros(100), 1.0, window=text),
    ]
    for run in runs:
        with pytest.raises((ValueError, TypeError)) as caught:
            run()
        message = str(caught.value)
        assert len(message) <= 6000
        # A message may show the line that it is about.
        lines = message.split("\n")
        assert all(line.replace(" ", "").lstrip("0123456789").startswith("|") for line in lines[1:]), message
        assert not any(ord(c) < 32 or 127 <= ord(c) < 160 or c == "\u202e" for line in lines for c in line), message
