"""Spans of an archive have the bits of one run, whatever the algorithm, the signal, the files and the workers that die."""

import contextlib
import json
import os
import signal
import threading
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
from test_fuse import write_wav

import hybank as hb

FRAMES = 20_011
SIGNALS = ("noise", "DC", "sine", "silence after a burst")


def drawn(kind, channels, frames=FRAMES):
    t = np.arange(frames)
    if kind == "noise":
        return np.random.default_rng(3).standard_normal((channels, frames))
    if kind == "DC":
        return np.full((channels, frames), 0.7)
    if kind == "sine":
        return np.sin(0.013 * t + np.arange(channels)[:, None])
    return np.where(t < 1500, np.random.default_rng(4).standard_normal((channels, frames)), 0.0)


def pole(rho):
    """A bank with two channels and the poles rho and rho^2, made by hand."""
    matrices = {"a": [[rho, 0], [0, rho**2]], "b": [[1, 0.5], [0.25, 1]], "c": [[1, 2], [1, -1]]}
    filters = {**matrices, "d": [[0.5, 0], [0, 0.5]]}
    channel = {"delay": 0.0}
    bank = {"format": "hybank-bank", "version": 1, "fast_period": 1.0, "ratio": 2, "latency": 3, "method": "iir"}
    gamma = dict.fromkeys(("norm", "upper", "lower", "noncausal"))
    return hb.Bank.from_json(json.dumps({**bank, "channels": [channel] * 2, "state_space": filters, "gamma": gamma}))


def fused(tmp_path, bank, x, **keywords):
    np.save(tmp_path / "in.npy", x)
    report = hb.dask.fuse(bank, tmp_path / "in.npy", tmp_path / "out.npy", **keywords)
    return np.load(tmp_path / "out.npy"), report


@pytest.mark.parametrize("kind", SIGNALS)
@pytest.mark.parametrize("algorithm", ["direct", "overlap-save"])
def test_spans_have_the_bits_of_one_run(filters, tmp_path, algorithm, kind):
    bank = hb.load(filters / "interleaved-4x250M.json")
    x = drawn(kind, 4).astype("f4")
    y, report = fused(tmp_path, bank, x, algorithm=algorithm, span=3000)
    assert y.tobytes() == bank.fuse(x, algorithm=algorithm).tobytes()
    assert report.algorithm == algorithm and report.spans >= 2 and not report.reruns


@pytest.mark.parametrize("kind", SIGNALS)
@pytest.mark.parametrize("rho", [0.9, 0.99, 0.999, 0.99999])
def test_recursions_have_the_bits_of_one_run_and_reruns_are_reported(tmp_path, rho, kind):
    bank = pole(rho)
    x = drawn(kind, 2)
    y, report = fused(tmp_path, bank, x, span=2048)
    assert y.tobytes() == bank.fuse(x).tobytes()
    assert report.spans == 10 and report.algorithm == "parallel-form"
    # Slow poles warm up from the beginning. Others forget noise, but no bit of a state that fades away.
    slow = report.warm_up >= FRAMES
    assert slow == (rho > 0.99)
    if kind == "silence after a burst" and not slow:
        later = [k for k in range(10) if 2048 * k > max(1500, report.warm_up)]
        fading = [k for k in later if rho ** (2048 * k - 1500) > 1e-280]
        assert report.reruns == fading and fading
    else:
        assert report.reruns == []


def test_a_designed_recursion(iir, tmp_path):
    x = drawn("noise", 2).astype("f4")
    y, report = fused(tmp_path, iir, x, span=2048)
    assert y.tobytes() == iir.fuse(x).tobytes() and report.warm_up < 200


@pytest.mark.parametrize("frames", [0, 1, 3, 2999, 3000, 3001])
def test_archives_as_short_as_a_span_or_the_latency(fir, tmp_path, frames):
    x = drawn("noise", 2, max(frames, 1))[:, :frames]
    for algorithm in ("direct", "overlap-save"):
        y, _ = fused(tmp_path, fir, x, span=1000, algorithm=algorithm)
        assert y.tobytes() == fir.fuse(x, algorithm=algorithm).tobytes()


# Integers of three times full scale are clipped.
@pytest.mark.filterwarnings("ignore:.*where it clips")
@pytest.mark.parametrize("dtype, output", [("i2", "i2"), ("f4", "i4"), ("c8", None), ("i2", None), ("f8", "f4")])
def test_samples_are_counted_once(fir, tmp_path, dtype, output):
    x = 3 * drawn("noise", 2)
    if np.dtype(dtype).kind == "i":
        x = np.clip(20000 * x, -32768, 32767)
    x = x.astype(dtype) if dtype != "c8" else (x + 1j * x[::-1]).astype(dtype)
    if np.dtype(dtype).kind != "i":
        # At a seam, in the warm-up of the span after it, and at both ends.
        x[0, [0, 2999, 3000, 2995, FRAMES - 1]] = np.nan
    y, report = fused(tmp_path, fir, x, span=3000, dtype=output)
    tolerated = np.dtype(dtype).kind != "i" or output == "i2"
    with pytest.warns(UserWarning) if tolerated else contextlib.nullcontext():
        want, info = fir.fuse(x, dtype=output, full_output=True)
    assert y.dtype == want.dtype and y.tobytes() == want.tobytes()
    assert (report.clipped, report.replaced) == (info.clipped, info.replaced)
    assert (info.clipped > 0) == (output in ("i2", "i4")) and (info.replaced > 0) == (dtype != "i2")


def test_sources_and_sinks(fir, tmp_path):
    x = (8000 * drawn("sine", 2)).astype("i2")
    want = fir.fuse(x)
    np.save(tmp_path / "rows.npy", x)
    np.save(tmp_path / "frames.npy", np.ascontiguousarray(x.T))
    for i in range(2):
        write_wav(tmp_path / f"{i}.wav", x[i], 24000)
        # The samples of the second recording end before its file does.
        more = {"core:trailing_bytes": 7 * i}
        meta = {"core:datatype": "ri16_le", "core:version": "1.0.0", "core:num_channels": 1, **more}
        (tmp_path / f"{i}.sigmf-meta").write_text(json.dumps({"global": meta, "captures": [], "annotations": []}))
        (tmp_path / f"{i}.sigmf-data").write_bytes(x[i].astype("<i2").tobytes() + b"trailer"[: 7 * i])
    wav, sigmf = ([tmp_path / f"{i}.{kind}" for i in range(2)] for kind in ("wav", "sigmf-meta"))
    sources = [(tmp_path / "rows.npy", -1), (tmp_path / "frames.npy", 0), (wav, -1), (sigmf, -1)]
    sinks = [tmp_path / "out.npy"]
    try:
        import zarr

        zarr.create_array(tmp_path / "in.zarr", data=x)
        sources.append((tmp_path / "in.zarr", -1))
        sinks.append(tmp_path / "out.zarr")
    except ImportError:
        zarr = None
    for source, axis in sources:
        for sink in sinks:
            hb.dask.fuse(fir, source, sink, axis=axis, span=3000)
            y = np.load(sink) if sink.suffix == ".npy" else zarr.open_array(sink, mode="r")[:]
            assert y.tobytes() == want.tobytes(), (source, sink)
    file = hb.Recording(tmp_path / "0.wav")
    assert (file.frames, file.channels, file.rate, file.dtype) == (FRAMES, 1, 24000.0, "f4")
    np.testing.assert_array_equal(file.read(FRAMES - 3, 10), x[:1, -3:].T / np.float32(32768))
    assert hb.Recording(tmp_path / "1.sigmf-meta").frames == FRAMES


def test_a_dataset_of_hdf5_is_a_source(fir, tmp_path):
    h5py = pytest.importorskip("h5py")
    x = drawn("noise", 2).astype("f4")
    with h5py.File(tmp_path / "in.h5", "w") as file:
        file["rows"], file["frames"] = x, x.T
    for name, axis in (("rows", -1), ("frames", 0)):
        hb.dask.fuse(fir, (tmp_path / "in.h5", name), tmp_path / "out.npy", axis=axis, span=3000)
        assert np.load(tmp_path / "out.npy").tobytes() == fir.fuse(x).tobytes(), name


def test_wrong_archives_are_refused(fir, tmp_path):
    np.save(tmp_path / "in.npy", np.zeros((3, 10)))
    with pytest.raises(hb.HybankError, match="3 channels, the bank has 2"):
        hb.dask.fuse(fir, tmp_path / "in.npy", tmp_path / "out.npy")
    write_wav(tmp_path / "a.wav", np.zeros(5, "f4"), 1)
    write_wav(tmp_path / "b.wav", np.zeros(6, "f4"), 1)
    with pytest.raises(hb.HybankError, match="equally long"):
        hb.dask.fuse(fir, [tmp_path / "a.wav", tmp_path / "b.wav"], tmp_path / "out.npy")
    with pytest.raises(FileNotFoundError):
        hb.Recording(tmp_path / "none.wav")
    meta = {"global": {"core:datatype": "ri16_le"}, "annotations": []}
    jump = [{"core:sample_start": 0, "core:global_index": 0}, {"core:sample_start": 5, "core:global_index": 9}]
    (tmp_path / "lost.sigmf-meta").write_text(json.dumps({**meta, "captures": jump}))
    (tmp_path / "lost.sigmf-data").write_bytes(bytes(20))
    with pytest.raises(hb.HybankError, match="frames were lost"):
        hb.Recording(tmp_path / "lost.sigmf-meta")


def test_a_sink_replaces_neither_its_source_nor_other_files(fir, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("in.npy", np.zeros((2, 10)))
    (tmp_path / "link.npy").symlink_to(tmp_path / "in.npy")
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "kept.txt").write_text("kept")
    (folder / "zarr.json").write_text('{"node_type": "group"}')
    for sink, words in [
        ("in.npy", "is the source"),
        (tmp_path / "in.npy", "is the source"),
        ("link.npy", "is the source"),
        ("folder", "no zarr array"),
        ("folder/kept.txt", "not another kind of file"),
        ("out.wav", "an .npy file or a zarr array"),
    ]:
        with pytest.raises(hb.HybankError, match=words):
            hb.dask.fuse(fir, "in.npy", sink)
    assert np.load("in.npy").shape == (2, 10) and (folder / "kept.txt").read_text() == "kept"
    for source, words in [(np.zeros((2, 10)), "not ndarray"), (3, "not int")]:
        with pytest.raises(TypeError, match=words):
            hb.dask.fuse(fir, source, "out.npy")
    with pytest.raises(hb.HybankError, match="axis 2"):
        hb.dask.fuse(fir, "in.npy", "out.npy", axis=2)
    with pytest.raises(hb.HybankError, match="list of recordings is empty"):
        hb.dask.fuse(fir, [], "out.npy")


def test_paths_hold_in_any_folder(fir, tmp_path, monkeypatch):
    """The folder of the process changes after the first span; workers are in folders of their own, too."""
    (tmp_path / "first").mkdir()
    (tmp_path / "second").mkdir()
    monkeypatch.chdir(tmp_path / "first")
    x = drawn("noise", 2).astype("f4")
    for i in range(2):
        write_wav(tmp_path / "first" / f"{i}.wav", x[i], 24000)
    np.save("in.npy", x)
    for source in ("in.npy", ["0.wav", "1.wav"], ("0.wav", "1.wav")):
        monkeypatch.chdir(tmp_path / "first")
        hb.dask.fuse(fir, source, "out.npy", span=3000, progress=lambda *_: monkeypatch.chdir(tmp_path / "second"))
        assert np.load(tmp_path / "first" / "out.npy").tobytes() == fir.fuse(x).tobytes()
    assert not list((tmp_path / "second").iterdir())


def test_a_killed_worker_loses_nothing(tmp_path):
    """Two processes; one of them is killed after the first span. The cluster starts another one."""
    distributed = pytest.importorskip("distributed")
    bank = pole(0.99)
    x = drawn("silence after a burst", 2, 200_000)
    np.save(tmp_path / "in.npy", x)
    killed = []

    def kill(done, _spans):
        if not killed:
            killed.extend([client.run(os.getpid)])
            os.kill(next(iter(killed[0].values())), signal.SIGKILL)

    settings = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
        report = hb.dask.fuse(
            bank, tmp_path / "in.npy", tmp_path / "out.npy", client=client, span=4096, progress=kill
        )
    assert np.load(tmp_path / "out.npy").tobytes() == bank.fuse(x).tobytes()
    assert killed and report.spans == 49 and report.reruns


SPEC = {
    "fast_rate": 48e3, "ratio": 2, "target": {"filter": hb.butterworth(2, 9e3)},
    "channel": [hb.Channel(delay=25e-6), hb.Channel(delay=12.5e-6)], "design": {"method": "fir", "taps": 8},
}  # fmt: skip


def test_a_sweep_designs_every_plant_with_any_executor():
    cutoffs = [8e3, 9e3, 10e3]
    specs = [{**SPEC, "target": {"filter": hb.butterworth(2, cutoff)}} for cutoff in cutoffs]
    specs.insert(1, {**SPEC, "ratio": -1})
    reported, threads = [], set()

    def noted(*progress):
        reported.append(progress)
        threads.add(threading.current_thread())

    with ThreadPoolExecutor(2) as executor:
        results = hb.dask.sweep(specs, map=executor.map, proof=False, progress=noted)
    assert isinstance(results[1], hb.SpecError) and reported == [(1, 4), (2, 4), (3, 4), (4, 4)]
    del results[1], specs[1]
    assert results == [hb.design(spec, proof=False) for spec in specs]
    assert len({bank.gamma.norm for bank in results}) == 3 and threads == {threading.main_thread()}


class Threads:
    """What a fusion asks of a client: the threads of each worker."""

    def __init__(self, *threads):
        self.threads = threads

    def nthreads(self):
        return dict(enumerate(self.threads))


@pytest.mark.parametrize(
    "frames, client, span",
    [(0, None, 2**23), (10**8, None, 12_500_000), (10**8, Threads(1, 1), 2**23), (10**12, Threads(4, 4), 2**24)],
)
def test_each_thread_has_eight_spans_of_eight_million_frames_or_more(frames, client, span):
    assert hb.dask._usual_span(frames, client) == span


def test_a_single_spec_is_no_sweep():
    for specs in ("spec.toml", SPEC):
        with pytest.raises(TypeError, match="hybank.design"):
            hb.dask.sweep(specs)


def test_a_sweep_runs_on_a_cluster_and_reports_every_design():
    distributed = pytest.importorskip("distributed")
    specs = [{**SPEC, "latency": latency} for latency in (4, 5)] + [{**SPEC, "ratio": -1}]
    settings = {"n_workers": 1, "threads_per_worker": 2, "processes": False, "dashboard_address": ":0"}
    last, gate = distributed.Event("last"), {**SPEC, "name": Gate()}
    reported = []

    def progress(done, count):
        reported.append((done, count))
        if done == 3:
            last.set()

    with distributed.LocalCluster(**settings) as cluster, distributed.Client(cluster) as client:
        results = hb.dask.sweep([*specs, gate], client=client, proof=False, progress=progress)
    assert reported == [(1, 4), (2, 4), (3, 4), (4, 4)]
    assert results[:2] == [hb.design(spec, proof=False) for spec in specs[:2]]
    assert isinstance(results[2], hb.SpecError) and results[3].spec.count("opened") == 1


class Gate:
    """A name that is known when the progress of the designs before it was reported."""

    def tolist(self):
        import distributed

        return "opened" if distributed.Event("last").wait(timeout=60) else "closed"
