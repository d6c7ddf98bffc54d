"""Captures that are no arrays of NumPy: files, one recording of several converters, xarray, pandas, dask."""

import os
import sys
from dataclasses import dataclass

import numpy as np

from hybank import _hybank
from hybank._hybank import HybankError
from hybank._keywords import checked
from hybank._times import check, check_rate, finer, seconds


@dataclass(eq=False)
class Captures:
    """Recordings in memory.

    ``channels`` is an array (N, T) with NaN for lost samples, or a list of arrays of unequal lengths; ``rate`` that of a
    recording in hertz, or None; ``output_rate`` that of a bank's output, if ``read`` was given a bank.
    """

    channels: object
    rate: float | None
    output_rate: float | None = None

    def __len__(self):
        return len(self.channels)

    @checked
    def mono(self):
        """The only channel."""
        if len(self.channels) != 1:
            raise HybankError(f"the recording has {len(self.channels)} channels, and one is needed; give channel=")
        return self.channels[0]


def is_file(x):
    """Whether this is the name of a file; a signal as a text has a colon or an @ before its first dot."""
    if isinstance(x, os.PathLike):
        return True
    return isinstance(x, str) and os.path.splitext(x)[1].lower() in (".wav", ".wave", ".flac")


def _are_files(x):
    first = x[0] if isinstance(x, (list, tuple)) and len(x) else x
    return isinstance(first, (str, os.PathLike))


@checked
def read(
    files, *, bank=None, format="wav", channels=None, channel=None, iq=False, full_scale=None,
    interleaved=None, lost=None, max_lost=None, longest=False, skip_lines=0, columns=None, time_column=None, delimiter=None,
    decimal=None
):
    """Read recordings as ``hybank fuse`` reads them.

    Parameters
    ----------
    files : str or os.PathLike, or a list of them
        WAV, FLAC, SigMF, tables (.csv), arrays (.npy, .mat), or raw samples with `format`.
    bank : Bank, optional
        Checks that channels and rates are those of the bank.
    format : str
        Sample format of raw files as in ffmpeg ("s16le", "cf32", ..), or "csv"; other files state their own.
    channels : int, optional
        Interleaved channels of each raw file.
    channel : int, optional
        Read only this channel of each file, from 1.
    iq : bool
        Pairs of channels are the real and the imaginary parts of complex samples.
    full_scale : float or str, optional
        Full scale of the converters: a number, or "12bits", "u12bits". WAV and FLAC state it, the bank may.
    interleaved : int, optional
        One recording of one channel in which so many converters take turns; needs `bank`.
    lost : str or os.PathLike, optional
        A file of JSON lines that name lost samples.
    max_lost : int, optional
        The most frames that an input may leave out.
    longest : bool
        Read until the last channel ends; the others are NaN from their ends on.
    skip_lines : int
        Lines at the beginning of a table that are not looked at.
    columns : list of int or str, optional
        The columns of a table that are channels, by number from 1 or by heading; all but the time otherwise.
    time_column : int or str, optional
        The column of a table that says when each line was taken, or "none".
    delimiter : str, optional
        Between the cells of a table: ",", ";", "tab" or "space".
    decimal : str, optional
        The mark before the decimals in a table: "point" or "comma".

    Returns
    -------
    Captures

    Examples
    --------
    >>> capture = hb.simulate(bank, "tones:0.3", samples=400)
    >>> np.save("ch1.npy", capture.channels[0]); np.save("ch2.npy", capture.channels[1])
    >>> captures = hb.read(["ch1.npy", "ch2.npy"])
    >>> captures.channels.shape, bank.fuse(captures).shape
    ((2, 200), (400,))
    """
    if interleaved is not None and bank is None:
        raise HybankError("interleaved: give the bank, whose delays say in which order the converters take turns")
    options = {
        "format": format, "channels": channels, "channel": channel,
        "iq": iq, "full_scale": full_scale, "interleaved": interleaved,
        "lost": lost, "max_lost": max_lost, "longest": longest, "skip_lines": skip_lines,
        "columns": [str(column) for column in columns or ()],
        "time_column": None if time_column is None else str(time_column), "delimiter": delimiter, "decimal": decimal,
    }
    return _read(files, bank, options)


def _read(files, source, options):
    """Recordings for a bank, for a spec, or for nothing in particular."""
    names = [files] if isinstance(files, (str, os.PathLike)) else list(files)
    usual = dict.fromkeys(
        ("channels", "channel", "full_scale", "interleaved", "lost", "max_lost", "time_column", "delimiter", "decimal")
    )
    options = {"format": "wav", "iq": False, "longest": False, "skip_lines": 0, "columns": [], **usual, **options}
    found = _hybank.read(names, options, source)
    parts = found["channels"]
    is_even = all(len(part) == len(parts[0]) for part in parts)
    return Captures(np.stack(parts) if is_even and parts else parts, found["rate"], found["output_rate"])


def fuse(bank, x, interleaved, *, axis, full_output, rate, **keywords):
    """``Bank.fuse`` of what is no array of NumPy."""
    if _are_files(x):
        x, interleaved = read(x, bank=bank, interleaved=interleaved, full_scale=keywords.pop("full_scale")), None
        # As `hybank fuse` writes it: 32-bit floats.
        keywords["dtype"] = "f4" if keywords["dtype"] is None else keywords["dtype"]
        rate = x.output_rate if rate is None else rate
    if isinstance(x, Captures):
        check_rate(bank, x, interleaved)
        rate = x.output_rate if rate is None else rate
        x, axis = x.channels, -1
    if isinstance(x, (list, tuple)):
        x = [np.asarray(one) for one in x]
    keywords = {**keywords, "full_output": full_output, "rate": rate}
    if interleaved is not None:
        return bank.fuse(in_turn(bank, x, interleaved), axis=-1, **keywords)
    package = type(x).__module__.split(".")[0]
    if package == "pandas":
        return _fuse_frame(bank, x, keywords)
    if package == "xarray":
        return _fuse_named(bank, x, axis, keywords)
    if package == "dask":
        return _fuse_lazily(bank, x, axis, keywords)
    return bank.fuse(x, axis=axis, **keywords)


def in_turn(source, x, interleaved):
    """The channels of one recording in which converters take turns; what is no whole frame at its end is left out."""
    x = np.asarray(x)
    x = x[0] if x.ndim == 2 and len(x) == 1 else x
    if x.ndim != 1:
        raise HybankError(f"interleaved: one recording of one channel is needed, not an array of the shape {x.shape}")
    order = _hybank.turns(source, interleaved)
    frames = x[: len(x) // interleaved * interleaved].reshape(-1, interleaved)
    channels = np.empty((interleaved, len(frames)), x.dtype)
    channels[order] = frames.T
    return channels


def plain(x, axis, source, interleaved):
    """Captures for a bank or a spec as arrays of NumPy, with their axis of time."""
    if _are_files(x):
        x, interleaved = _read(x, source, {"interleaved": interleaved}), None
    if isinstance(x, Captures):
        x, axis = x.channels, -1
    if interleaved is not None:
        return in_turn(source, x, interleaved), -1
    package = type(x).__module__.split(".")[0]
    if package == "pandas":
        _check_columns(_hybank.frame_samples(source), x)
        return x.to_numpy(), 0
    if package == "xarray":
        time, channel = _dimensions(_hybank.frame_samples(source), x, axis)
        if x.ndim > 2:
            raise HybankError(f"dimensions {x.dims}: give one signal, of the dimensions of channel and time")
        return x.transpose(*([channel] if channel else []), time).to_numpy(), -1
    return (np.asarray(x) if package == "dask" else x), axis


def recordings(x, axis, source):
    """A list with an array for each channel, of any lengths."""
    if _are_files(x):
        source = source.spec if isinstance(source, _hybank.Bank) else source
        files = [x] if isinstance(x, (str, os.PathLike)) else x
        # One by one: together they would end with the shortest.
        return [channel for file in files for channel in _read(file, source, {}).channels]
    if isinstance(x, (list, tuple)):
        return [np.asarray(one) for one in x]
    x, axis = plain(x, axis, source, None)
    return list(np.asarray(x).T if axis in (0, -2) else x)


def with_rates(x, rate, times):
    """A list with an array for each recording, and their rates."""
    if _are_files(x):
        read_all = [_read(file, None, {}) for file in ([x] if isinstance(x, (str, os.PathLike)) else x)]
        pairs = [(channel, one.rate if rate is None else rate) for one in read_all for channel in one.channels]
        return [channel for channel, _ in pairs], [float(own) for _, own in pairs]
    x = [np.asarray(one) for one in x]
    if times is not None:
        if len(times) != len(x):
            raise HybankError(f"times: {len(times)} lists for {len(x)} recordings; give one for each")
        spans = [np.asarray(one, float) for one in times]
        if any(one.ndim != 1 or len(one) < 2 or not one[-1] > one[0] for one in spans):
            raise HybankError("times: give two or more times of each recording, in ascending order")
        return x, [(len(one) - 1) / (one[-1] - one[0]) for one in spans]
    if rate is None:
        raise HybankError("rate: arrays state none; give the samples per second, or times")
    rates = np.broadcast_to(np.asarray(rate, float), len(x)) if np.ndim(rate) == 0 else np.asarray(rate, float)
    if len(rates) != len(x) or not np.all((rates > 0) & np.isfinite(rates)):
        raise HybankError(f"rate: give one positive number, or one for each of {len(x)} recordings")
    return x, rates.tolist()


def channels(bank, x, axis, full_scale):
    """A list of samples for each channel, in double precision, and the rate of the bank's output."""
    if _are_files(x):
        x = read(x, bank=bank)
    rate = getattr(x, "output_rate", None) or bank.fast_rate
    x, axis = plain(x, axis, bank, None)
    if isinstance(x, (list, tuple)) and max(bank.samples) > 1:
        rows = [np.asarray(row, float) for row in x]
        frames = min(len(row) // samples for row, samples in zip(rows, bank.samples))
        x = np.concatenate([row[: frames * s].reshape(frames, s) for row, s in zip(rows, bank.samples)], axis=1).T
    return _hybank.numbers(x, bank, axis, full_scale), rate


def record(y, rate):
    """A record as an array, and its rate in hertz."""
    if isinstance(y, (str, os.PathLike)):
        y = read(y)
    if isinstance(y, Captures):
        y, rate = y.mono(), y.rate if rate is None else rate
    if rate is None:
        step = _step(y)
        if step is None:
            raise HybankError("rate: give samples per second")
        rate = 1 / step
    return y, rate


def _step(y):
    """The distance of the samples of an xarray or of pandas in seconds, if its coordinate says it."""
    package = type(y).__module__.split(".")[0]
    if package == "pandas":
        times = y.index.to_numpy()
    elif package == "xarray" and y.ndim == 1 and y.dims[0] in y.coords:
        times = y.coords[y.dims[0]].to_numpy()
    else:
        return None
    if len(times) < 2:
        return None
    since, _ = seconds(times)
    return float(since[-1]) / (len(times) - 1)


# Axes with names.


def _check_columns(count, frame):
    """Refuse a frame whose columns are not those of so many channels."""
    columns = list(getattr(frame, "columns", ["the series"]))
    time = next((name for name in columns if str(name).lower() in ("time", "t")), None)
    if time is not None:
        raise HybankError(f"the column {time!r} is no channel; make it the index: set_index({time!r})")
    if len(columns) != count:
        raise HybankError(
            f"there are {len(columns)} columns of pandas for {count} channels; give a column for each, or with "
            f"interleaved={count} one recording in which {count} converters take turns"
        )


def _fuse_frame(bank, frame, keywords):
    """A DataFrame with a column for each channel becomes a Series with its index at the fast rate."""
    pandas = sys.modules["pandas"]
    full_output = keywords.pop("full_output")
    _check_columns(sum(bank.samples), frame)
    if isinstance(frame.index, pandas.PeriodIndex):
        raise HybankError("an index of periods cannot be divided; convert it with to_timestamp()")
    zone = getattr(frame.index, "tz", None)
    times = frame.index if zone is None else frame.index.tz_convert("UTC").tz_localize(None)
    check(bank, times.to_numpy(), "the index")
    found = bank.fuse(frame.to_numpy(), axis=0, full_output=full_output, **keywords)
    y, report = found if full_output else (found, None)
    name = frame.name if isinstance(frame, pandas.Series) else None
    index = pandas.Index(finer(times.to_numpy(), bank.ratio), name=frame.index.name)
    if zone is not None:
        index = index.tz_localize("UTC").tz_convert(zone)
    series = pandas.Series(y, index=index, name=name)
    return (series, report) if full_output else series


def _fuse_named(bank, x, axis, keywords):
    """A DataArray loses the dimension of the channels, and has the fast rate along that of time."""
    xarray = sys.modules["xarray"]
    if not isinstance(x, xarray.DataArray):
        raise HybankError("give a DataArray; of a Dataset choose a variable: dataset[name]")
    time, channel = _dimensions(sum(bank.samples), x, axis)
    if time in x.coords:
        check(bank, x.coords[time].to_numpy(), f"the coordinate {time!r}")
    others = [name for name in x.dims if name not in (time, channel)]
    order = others + ([channel] if channel else []) + [time]
    data = x.transpose(*order).data
    full_output = keywords.pop("full_output")
    if full_output and (others or _is_lazy(data)):
        raise HybankError("full_output: there is one report per signal; fuse them one by one, as arrays of NumPy")
    shape = data.shape[: len(others)]
    report = None
    if full_output:
        y, report = bank.fuse(data, full_output=True, **keywords)
    elif not others:
        y = _fuse_lazily(bank, data, -1, {**keywords, "full_output": False}) if _is_lazy(data) else bank.fuse(data, **keywords)
    else:
        signals = [bank.fuse(data[index], **keywords) for index in np.ndindex(*shape)]
        stack = sys.modules["dask.array"].stack if _is_lazy(data) else np.stack
        y = stack(signals).reshape(*shape, -1)
    coords = {
        name: coord for name, coord in x.coords.items() if time not in coord.dims and channel not in coord.dims
    }
    if time in x.coords:
        coord = x.coords[time]
        coords[time] = (time, finer(coord.to_numpy(), bank.ratio), coord.attrs)
    fused = xarray.DataArray(y, coords=coords, dims=[*others, time], name=x.name, attrs=x.attrs)
    return (fused, report) if full_output else fused


def _dimensions(count, x, axis):
    """The names of the dimensions of time and of the channels."""
    time = "time" if "time" in x.dims and axis == -1 else x.dims[axis]
    left = [name for name in x.dims if name != time]
    if "channel" in left:
        return time, "channel"
    fitting = [name for name in left if x.sizes[name] == count]
    if len(fitting) == 1 or len(left) == 1:
        return time, (fitting or left)[0]
    if not left and count == 1:
        return time, None
    if not left:
        raise HybankError(
            f"one dimension {time!r} for {count} channels; give a dimension \"channel\", or with interleaved={count} one "
            f"recording in which {count} converters take turns"
        )
    raise HybankError(
        f"dimensions {x.dims} with sizes {x.shape}: which holds the {count} channels? call it \"channel\""
    )


def _is_lazy(data):
    return type(data).__module__.split(".")[0] == "dask"


# Lazy arrays.


def _fuse_lazily(bank, x, axis, keywords):
    """A dask array of the output, a block for each block along time, with the bits of ``bank.fuse`` over all of it."""
    import dask
    import dask.array as da

    from hybank.dask import _plan

    wrong = [name for name in ("gaps", "full_output") if keywords[name]]
    if wrong:
        raise HybankError(f"{wrong[0]}: a lazy array is fused block by block; compute it first, or leave {wrong[0]} out")
    x = x.T if axis in (0, -2) and x.ndim == 2 else x
    x = x[None, :] if x.ndim == 1 else x
    if np.isnan(x.shape[1]):
        raise HybankError("a dask array of unknown length; compute_chunk_sizes() finds it")
    plan = _plan(bank, x.dtype, keywords["dtype"], keywords["algorithm"])
    skip = 0 if keywords["keep_latency"] else plan.latency
    if keywords["keep_latency"]:
        skip = plan.latency - bank.latency
    frames, parts, state = x.shape[1], [], None
    ends = np.cumsum(x.chunks[1])
    for first, last in zip(ends - x.chunks[1], ends):
        job = dask.delayed(_block, pure=True, nout=2)
        ahead = min(int(last) + -(-skip // bank.ratio), frames)
        begin = 0
        if plan.memory is not None:
            begin = max(int(first) - plan.memory, 0) // plan.alignment * plan.alignment
        elif state is not None:
            begin = int(first)
        span = (begin, int(first), int(last), ahead, ahead == frames)
        y, state = job(bank, x[:, begin:ahead], span, skip, plan, state)
        length = int(last - first) * bank.ratio
        parts.append(da.from_delayed(y, shape=(length,), dtype=np.dtype(plan.output)))
        state = None if plan.memory is not None else state
    return da.concatenate(parts) if parts else da.zeros(0, dtype=plan.output)


def _block(bank, x, span, skip, plan, state):
    """The outputs of the frames first to last, and the state of a recursion after them."""
    begin, first, last, ahead, is_end = span
    x = np.ascontiguousarray(x)
    s = bank.stream(dtype=plan.stream, algorithm=plan.asked, state=state)
    outputs = [s.process(x[:, : last - begin])]
    after = s.state if plan.memory is None else None
    outputs.append(s.process(x[:, last - begin : ahead - begin]))
    if is_end:
        outputs.append(s.flush())
    y = np.concatenate(outputs)
    start = (first - begin) * bank.ratio + skip
    y = y[start : start + (last - first) * bank.ratio]
    return (_hybank.encode(y, plan.output)[0] if np.dtype(plan.output).kind in "iu" else y), after
