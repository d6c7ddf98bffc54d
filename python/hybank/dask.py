"""Fusion of archives and sweeps of designs on many machines, with dask.distributed or any executor.

A task reads its own span of the input and writes its own region of the output, so tasks share nothing and a task that
dies with its worker is done again elsewhere. The outputs have the bits of one run over the whole input: a span begins
at the plan's alignment, after a warm-up of as many frames as the plan remembers. A recursion never forgets, so its
tasks also return their states at both ends; where the states of two spans differ at their seam, the later span is run
again from the state of the earlier one.
"""

import json
import math
import os
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache, partial

import numpy as np

from hybank._hybank import Bank, HybankError, Recording, encode
from hybank._keywords import checked
from hybank._spec import design as _design

# Shorter tasks would cost the scheduler more than the workers.
SPAN = 1 << 23
_LONGEST_SPAN = 1 << 24
_SPANS_PER_THREAD = 8
# Arrays of a block are so small that the allocator keeps their memory: the allocators of workers give larger ones
# back to the system, and the faults of their pages would cost more than the filters.
_BLOCK_BYTES = 120 << 10


@dataclass
class Report:
    """What a fusion did.

    Attributes
    ----------
    algorithm
        As in the plan of a ``FuseReport``.
    frames, spans
        Frames of the input, and the spans into which they were divided.
    warm_up
        Frames before each span that it reads, too.
    replaced, clipped
        Input samples that were NaN or infinite and became 0, and output samples that saturated.
    reruns
        Spans that were run again because the states at their seams differed.
    """

    algorithm: str
    frames: int
    spans: int
    warm_up: int
    replaced: int = 0
    clipped: int = 0
    reruns: list = field(default_factory=list)


@checked
def fuse(bank, source, sink, *, client=None, axis=-1, dtype=None, algorithm="auto", span=None, progress=None):
    """Fuse an archive into a new one; the output has the bits of ``bank.fuse`` over all of it.

    Parameters
    ----------
    bank : Bank
        The bank.
    source : str or pair or list
        The path of a zarr array or of an ``.npy`` file, ``("file.h5", "dataset")``, or a list of WAV or SigMF files with
        a channel or more each.
    sink : str
        The path of an ``.npy`` file or of a zarr array, which is made anew; a source or another kind of file is refused.
    client : dask.distributed.Client, optional
        Shares the work; without one this process does one span after another.
    axis : int
        The axis of time of arrays.
    dtype : dtype, optional
        Number type of the output.
    algorithm : str
        As in ``Bank.fuse``.
    span : int, optional
        The least number of frames of a task; unless given, each thread has eight tasks, of 2^23 to 2^24 frames.
    progress : callable, optional
        ``progress(done, spans)`` is called after every span.

    Returns
    -------
    Report

    Examples
    --------
    >>> x = np.sin(0.1 * np.arange(2000.0)) * np.ones((2, 1))
    >>> np.save("in.npy", x)
    >>> report = hb.dask.fuse(bank, "in.npy", "out.npy")
    >>> bool((np.load("out.npy") == bank.fuse(x)).all())
    True
    """
    source, sink = _located(source), _location(sink)
    _check_sink(sink, source)
    reader = _open(source, axis)
    if reader.channels != sum(bank.samples):
        raise HybankError(f"the source has {reader.channels} channels, the bank has {sum(bank.samples)}")
    plan = _plan(bank, reader.dtype, dtype, algorithm)
    span = _usual_span(reader.frames, client) if span is None else span
    job = _job(bank, source, sink, axis, plan, reader.frames, span)
    _create(sink, reader.frames * bank.ratio, plan.output, job.span * bank.ratio)
    report = Report(plan.algorithm, reader.frames, len(job.spans), job.warm_up)
    if client is None:
        ends = {k: _run(job, k) for k in _counted(range(len(job.spans)), progress, len(job.spans))}
    else:
        ends = _distributed(client, job, progress)
    _mend(job, ends, report, client)
    for end in ends.values():
        report.replaced += end.replaced
        report.clipped += end.clipped
    return report


@partial(checked, others=(_design,))
def sweep(specs, *, map=map, client=None, progress=None, **keywords):  # noqa: A002
    """Design every spec.

    Parameters
    ----------
    specs : list
        Paths or mappings.
    map : callable
        The ``map`` of any executor, for example of ``concurrent.futures.ProcessPoolExecutor``.
    client : dask.distributed.Client, optional
        In its place.
    progress : callable, optional
        ``progress(done, specs)`` is called after every design.
    **keywords
        Go to ``hybank.design``.

    Returns
    -------
    list of Bank
        With the exception in place of a bank that could not be designed.

    Examples
    --------
    >>> spec = {"fast_rate": 48e3, "ratio": 2, "target": {"filter": hb.butterworth(4, 9e3)}, "design": {"taps": 4},
    ...         "channel": [hb.Channel(25e-6), hb.Channel(12.5e-6)], "latency": 2}
    >>> hb.dask.sweep([spec], proof=False)[0].taps.shape
    (2, 4)
    """
    if isinstance(specs, (str, os.PathLike, Mapping)):
        raise TypeError("specs: give a list of specs; for a single one, call hybank.design")
    specs = [spec if isinstance(spec, (str, os.PathLike)) else dict(spec) for spec in specs]
    tasks = [(spec, keywords) for spec in specs]
    if client is not None:
        results = (future.result() for future in client.map(_designed, tasks, pure=False))
    else:
        results = map(_designed, tasks)
    return [_loaded(result) for result in _counted(results, progress, len(specs))]


# Plans and spans.


@dataclass(frozen=True)
class _Plan:
    """How spans run: the dtype of streams and of the output, and what the stream says of itself."""

    algorithm: str
    asked: str
    stream: str
    output: str
    latency: int
    memory: int | None
    alignment: int


@dataclass(frozen=True)
class _Job:
    bank: str
    source: object
    sink: str
    axis: int
    plan: _Plan
    warm_up: int
    span: int
    spans: tuple


@dataclass(frozen=True)
class _End:
    """What a task returns: counts, and for recursions the states before and after the span."""

    replaced: int
    clipped: int
    before: bytes | None = None
    after: bytes | None = None


def _plan(bank, given, dtype, algorithm):
    """The plan that ``bank.fuse`` would choose."""
    shape = (sum(bank.samples), 0)
    y, info = bank.fuse(np.zeros(shape, given), dtype=dtype, algorithm=algorithm, full_output=True)
    asked = info.plan.algorithm if bank.taps is not None else "auto"
    # Integers are made of the floats that the sums are in, so that what saturates is counted where it is written.
    stream = y.dtype.str[1:] if y.dtype.kind in "fc" else {"f32": "f4", "f64": "f8"}[info.plan.numbers]
    if np.dtype(given).kind == "c" and np.dtype(stream).kind != "c":
        stream = {"f4": "c8", "f8": "c16"}[stream]
    s = bank.stream(axis=0, dtype=stream, algorithm=asked)
    return _Plan(info.plan.algorithm, asked, stream, y.dtype.str[1:], s.latency, s.memory, s.alignment)


def _job(bank, source, sink, axis, plan, frames, span):
    aligned = lambda count: -(-count // plan.alignment) * plan.alignment  # noqa: E731
    memory = plan.memory if plan.memory is not None else warm_up(bank)
    span = aligned(max(int(span), 1))
    warm = min(aligned(memory), aligned(frames))
    firsts = range(0, frames, span)
    spans = tuple((first, min(first + span, frames)) for first in firsts)
    return _Job(bank.to_json(), source, sink, axis, plan, warm, span, spans)


def _usual_span(frames, client):
    """Few tasks cost the scheduler little; eight per thread end at about the same time."""
    threads = 1 if client is None else _threads(client)
    return min(max(frames // (_SPANS_PER_THREAD * threads), SPAN), _LONGEST_SPAN)


def _threads(client):
    return max(sum(client.nthreads().values()), 1)


@checked
def warm_up(bank):
    """Frames after which two states of a recursion hardly differ: W = 2 ln eps / ln rho, rho its largest pole.

    Parameters
    ----------
    bank : Bank
        A recursive bank.

    Returns
    -------
    int

    Examples
    --------
    >>> hb.dask.warm_up(bank) > 0
    True
    """
    poles = np.linalg.eigvals(bank.ss[0])
    rho = max(abs(poles), default=0.0)
    if rho < 1e-3:
        return len(poles)
    return len(poles) + math.ceil(2 * math.log(np.finfo(float).eps) / math.log(rho))


def _run(job, k, state=None):
    """One span; ``state`` is the stream's at its beginning, otherwise it is warmed up."""
    plan, bank, reader = job.plan, _bank(job.bank), _open(job.source, job.axis)
    first, last = job.spans[k]
    keeps = plan.memory is None
    s = bank.stream(axis=reader.axis, dtype=plan.stream, algorithm=plan.asked, state=state)
    if state is None:
        for _ in _through(s, reader, max(first - job.warm_up, 0), first):
            pass
    before, replaced = s.state if keeps else None, s.replaced
    region = _Region(job, first * bank.ratio, (last - first) * bank.ratio, plan)
    for y in _through(s, reader, first, last):
        region.write(y)
    replaced, after = s.replaced - replaced, s.state if keeps else None
    ahead = min(-(-plan.latency // bank.ratio), reader.frames - last)
    for y in _through(s, reader, last, last + ahead):
        region.write(y)
    if last + ahead == reader.frames:
        region.write(s.flush())
    region.close()
    return _End(replaced, region.clipped, before, after)


def _through(s, reader, first, last):
    samples = max(s.channels, s.ratio)
    block = max(_BLOCK_BYTES // (samples * reader.dtype.itemsize), 1 << 10)
    for start in range(first, last, block):
        yield s.process(reader.read(start, min(block, last - start)))


class _Region:
    """The outputs of a span: late by the latency, then so many samples."""

    def __init__(self, job, first, count, plan):
        self.sink, self.first, self.left, self.skip = _writer(job.sink), first, count, plan.latency
        self.dtype, self.clipped = np.dtype(plan.output), 0
        # A chunk of zarr is compressed as a whole, so it is written at once.
        self.parts = None if isinstance(self.sink, _NpySink) else []

    def write(self, y):
        dropped = min(self.skip, len(y))
        self.skip -= dropped
        self._store(y[dropped : dropped + self.left])

    def _store(self, y):
        if self.dtype.kind in "iu":
            y, clipped = encode(y, self.dtype)
            self.clipped += clipped
        self.left -= len(y)
        if self.parts is not None:
            self.parts.append(y)
            return
        self.sink[self.first : self.first + len(y)] = y
        self.first += len(y)

    def close(self):
        if self.parts is None:
            self.sink.close()
        elif self.parts:
            y = np.concatenate(self.parts)
            self.sink[self.first : self.first + len(y)] = y


@lru_cache(maxsize=4)
def _bank(text):
    return Bank.from_json(text)


# Many spans.


def _counted(items, progress, total):
    for done, item in enumerate(items, 1):
        yield item
        if progress is not None:
            progress(done, total)


def _distributed(client, job, progress):
    """All spans, with a few tasks per thread under way, so that the load of the scheduler does not grow."""
    from distributed import as_completed

    todo = deque(range(len(job.spans)))
    shared = client.scatter(job, broadcast=True) if len(job.bank) > 1 << 16 else job
    submit = lambda k: client.submit(_numbered, shared, k, pure=False, retries=3)  # noqa: E731
    under_way = 4 * _threads(client)
    futures = as_completed([submit(todo.popleft()) for _ in range(min(under_way, len(todo)))], with_results=True)
    ends = {}
    for _, (k, end) in _counted(futures, progress, len(job.spans)):
        ends[k] = end
        if todo:
            futures.add(submit(todo.popleft()))
    return ends


def _numbered(job, k, state=None):
    return k, _run(job, k, state)


def _mend(job, ends, report, client):
    """Runs spans again whose seam differs, each from the state that the one before hands over."""
    if job.plan.memory is not None:
        return
    bank = _bank(job.bank)
    for k in range(1, len(job.spans)):
        handed = ends[k - 1].after
        s = bank.stream(axis=0, dtype=job.plan.stream, algorithm=job.plan.asked, state=handed)
        if s.agrees(ends[k].before):
            continue
        report.reruns.append(k)
        again = _run(job, k, handed) if client is None else client.submit(_run, job, k, handed, pure=False).result()
        ends[k] = again


# Designs.


def _designed(task):
    """A bank as text, or the exception as a value: what travels between processes."""
    spec, keywords = task
    try:
        return _design(spec, **keywords).to_json()
    except (HybankError, OSError) as error:
        return error


def _loaded(result):
    return Bank.from_json(result) if isinstance(result, str) else result


# Sources and sinks.


class _Array:
    """An array of samples on disk, read by frames."""

    def __init__(self, array, axis):
        if axis not in (-2, -1, 0, 1):
            raise HybankError(f"axis {axis} is not the axis of time; give 0 or 1")
        if array.ndim not in (1, 2):
            raise HybankError(f"the source has {array.ndim} dimensions; give one of shape (N, T), or (T, N) with axis=0")
        self.array, self.by_frames = array, array.ndim == 2 and axis in (0, -2)
        self.axis = 0 if self.by_frames else -1
        self.dtype = array.dtype
        time = 0 if array.ndim == 1 or self.by_frames else 1
        self.frames, self.channels = array.shape[time], 1 if array.ndim == 1 else array.shape[1 - time]

    def read(self, first, count):
        if self.array.ndim == 1:
            return np.asarray(self.array[first : first + count])
        if self.by_frames:
            return np.asarray(self.array[first : first + count])
        return np.asarray(self.array[:, first : first + count])


class _Recordings:
    """WAV or SigMF files, whose channels are those of the bank one after another."""

    axis = 0

    def __init__(self, paths):
        if not paths:
            raise HybankError("the list of recordings is empty; give one file or more")
        self.files = [Recording(path) for path in paths]
        lengths = {file.frames for file in self.files}
        if len(lengths) != 1:
            raise HybankError(f"the recordings have {sorted(lengths)} frames; they must be equally long")
        self.frames, self.channels = lengths.pop(), sum(file.channels for file in self.files)
        self.dtype = np.result_type(*(file.dtype for file in self.files))

    def read(self, first, count):
        return np.concatenate([file.read(first, count) for file in self.files], axis=1).astype(self.dtype, copy=False)


def _open(source, axis):
    if isinstance(source, tuple):
        import h5py

        path, name = source
        return _Array(h5py.File(path, "r")[name], axis)
    if isinstance(source, list):
        return _Recordings(source)
    if _is_npy(source):
        return _Array(np.asarray(np.load(source, mmap_mode="r")), axis)
    import zarr

    return _Array(zarr.open_array(source, mode="r"), axis)


_RECORDINGS = (".wav", ".sigmf-meta", ".sigmf-data")
_OTHER_FILES = (*_RECORDINGS, ".sigmf", ".h5", ".hdf5", ".npz", ".mat", ".csv", ".flac", ".bin", ".raw")


def _is_npy(name):
    return name.lower().endswith(".npy")


def _is_recording(name):
    return isinstance(name, (str, os.PathLike)) and os.fspath(name).lower().endswith(_RECORDINGS)


def _location(path):
    """An absolute path or a URL: workers may be in another folder."""
    try:
        name = os.fspath(path)
    except TypeError:
        raise TypeError(f"give the path of a file or of a zarr array, not {type(path).__name__}") from None
    return name if "://" in name else os.path.abspath(name)


def _located(source):
    """The source with absolute paths: a path, a pair of a file and a dataset, or a list of recordings."""
    if isinstance(source, (list, tuple)) and (isinstance(source, list) or all(map(_is_recording, source))):
        return [_location(path) for path in source]
    if isinstance(source, tuple):
        path, dataset = source
        return _location(path), dataset
    return [_location(source)] if _is_recording(source) else _location(source)


def _check_sink(sink, source):
    """Refuses a sink that would replace a source, or anything that is no array."""
    sources = source if isinstance(source, list) else [source[0] if isinstance(source, tuple) else source]
    if os.path.realpath(sink) in map(os.path.realpath, sources):
        raise HybankError(f"{sink!r} is the source; give another sink")
    if _is_npy(sink):
        return
    if sink.lower().endswith(_OTHER_FILES) or os.path.isfile(sink):
        raise HybankError(f"{sink!r}: a sink is an .npy file or a zarr array, not another kind of file")
    if os.path.isdir(sink) and os.listdir(sink) and not _is_zarr_array(sink):
        raise HybankError(f"{sink!r} is a folder that is no zarr array, and its files would be lost; give another sink")


def _is_zarr_array(folder):
    if os.path.exists(os.path.join(folder, ".zarray")):
        return True
    try:
        with open(os.path.join(folder, "zarr.json"), encoding="utf-8") as file:
            return json.load(file).get("node_type") == "array"
    except (OSError, ValueError):
        return False


def _create(sink, samples, dtype, chunk):
    if _is_npy(sink):
        np.lib.format.open_memmap(sink, mode="w+", dtype=dtype, shape=(samples,)).flush()
        return
    import zarr

    # A chunk is the region of a span, so no two tasks write to one.
    zarr.create_array(sink, shape=(samples,), chunks=(min(chunk, max(samples, 1)),), dtype=dtype, overwrite=True)


class _NpySink:
    """The samples of an ``.npy`` file. Writing to the file costs less than faults of a map that is shared."""

    def __init__(self, name):
        mapped = np.load(name, mmap_mode="r")
        self.offset, self.dtype = mapped.offset, mapped.dtype
        self.file = open(name, "r+b", buffering=0)

    def __setitem__(self, region, y):
        self.file.seek(self.offset + region.start * self.dtype.itemsize)
        rest = memoryview(np.ascontiguousarray(y, self.dtype)).cast("B")
        while rest:
            rest = rest[self.file.write(rest) :]

    def close(self):
        self.file.close()


def _writer(sink):
    if _is_npy(sink):
        return _NpySink(sink)
    import zarr

    return zarr.open_array(sink, mode="r+")
