"""Arrays with names: xarray, pandas and dask in, the same out."""

import numpy as np
import pytest

import hybank as hb


@pytest.fixture
def x(random):
    return random.standard_normal((2, 400))


def test_a_data_array_keeps_its_dimensions_and_coordinates(fir, x):
    xarray = pytest.importorskip("xarray")
    times = np.datetime64("2026-01-01T00:00:00", "ns") + np.arange(400) * np.timedelta64(250, "us")
    given = xarray.DataArray(
        x, dims=("channel", "time"), name="volts", attrs={"unit": "V"},
        coords={"time": times, "channel": ["a", "b"], "site": "north", "height": ("channel", [1.0, 2.0])},
    )  # fmt: skip
    y = fir.fuse(given)
    np.testing.assert_array_equal(y.data, fir.fuse(x))
    assert y.dims == ("time",) and y.name == "volts" and y.attrs == {"unit": "V"}
    assert y.coords["site"] == "north" and "height" not in y.coords and "channel" not in y.coords
    np.testing.assert_array_equal(y.coords["time"], times[0] + np.arange(800) * np.timedelta64(125, "us"))
    # The axes may stand in any order, and further dimensions stay.
    np.testing.assert_array_equal(fir.fuse(given.T).data, y.data)
    runs = xarray.concat([given, 2 * given], dim=xarray.DataArray([7, 8], dims="run", name="run"))
    both = fir.fuse(runs)
    assert both.dims == ("run", "time") and both.coords["run"].data.tolist() == [7, 8]
    np.testing.assert_array_equal(both.sel(run=8).data, fir.fuse(2 * x))
    y, report = fir.fuse(given.where(given.time != times[5]), gaps=True, full_output=True)
    assert [gap[:3] for gap in report.gaps] == [(1, 5, 1), (2, 5, 1)] and y.sizes["time"] == 800
    with pytest.raises(hb.HybankError, match='call it "channel"'):
        fir.fuse(xarray.DataArray(np.zeros((2, 2, 9)), dims=("p", "q", "time")))


def test_a_list_of_series_is_a_list_of_channels(fir, x):
    pandas = pytest.importorskip("pandas")
    np.testing.assert_array_equal(fir.fuse([pandas.Series(row) for row in x]), fir.fuse(x))


def test_a_data_frame_keeps_its_index(fir, x):
    pandas = pytest.importorskip("pandas")
    for index, want in [
        (pandas.RangeIndex(400), np.arange(800) / 2),
        (pandas.Index(np.arange(400) * 0.5, name="s"), np.arange(800) * 0.25),
        (
            pandas.date_range("2026-01-01", periods=400, freq="1ms", tz="Europe/Paris"),
            pandas.date_range("2026-01-01", periods=800, freq="500us", tz="Europe/Paris"),
        ),
        (pandas.timedelta_range("0s", periods=400, freq="1ms"), pandas.timedelta_range("0s", periods=800, freq="500us")),
    ]:
        frame = pandas.DataFrame(x.T, index=index, columns=["left", "right"])
        y = fir.fuse(frame)
        assert isinstance(y, pandas.Series) and y.index.name == index.name
        np.testing.assert_array_equal(y.to_numpy(), fir.fuse(x))
        np.testing.assert_array_equal(np.asarray(y.index), np.asarray(want))
    y, report = fir.fuse(frame, full_output=True)
    assert report.replaced == 0 and len(y) == 800


def test_uneven_times_are_divided_period_by_period(fir):
    from hybank._inputs import finer

    np.testing.assert_array_equal(finer([0.0, 1.0, 3.0], 2), [0.0, 0.5, 1.0, 2.0, 3.0, 4.0])
    with pytest.raises(hb.HybankError, match="fewer than two"):
        finer([0.0], 2)


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
@pytest.mark.parametrize("kind", ["M", "m"])
def test_dates_are_divided_exactly_whatever_their_unit(kind, unit):
    from hybank._inputs import finer

    times = np.arange(4).astype(f"{kind}8[{unit}]")
    if unit != "ns":
        for ratio in (2, 3, 4):
            y = finer(times, ratio)
            periods = (y - y[0]) / np.timedelta64(1, unit)
            np.testing.assert_allclose(periods, np.arange(4 * ratio) / ratio, atol=1e-3)
            assert len(set(y.tolist())) == 4 * ratio
    # Without need for another unit there is none, far from 1970 neither.
    far = np.array(["2926-01-01", "2926-01-03"], f"M8[{unit if unit != 'ns' else 'us'}]")
    assert finer(far, 2).dtype == far.dtype and str(finer(far, 2)[1]).startswith("2926-01-02")


def test_the_times_of_pandas_and_xarray_become_those_of_the_output(stereo):
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    x = np.zeros((2, 4))
    times = np.datetime64("2026-01-01", "us") + np.arange(4) * np.timedelta64(25, "us")
    want = times[0] + np.arange(8) * np.timedelta64(12_500, "ns")
    y = stereo.fuse(xarray.DataArray(x, dims=("channel", "time"), coords={"time": times}))
    np.testing.assert_array_equal(y.coords["time"].to_numpy(), want)
    y = stereo.fuse(pandas.DataFrame(x.T, index=pandas.DatetimeIndex(times)))
    np.testing.assert_array_equal(y.index.to_numpy(), want)


@pytest.fixture(scope="module")
def stereo():
    channels = [hb.Channel(delay="12 us"), hb.Channel(delay="2 us")]
    return hb.design(
        fast_rate=80e3, ratio=2, target=hb.butterworth(2, 9e3), channels=channels, latency=4, method="fir", taps=8, proof=False
    )


def _frames(stereo, times):
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    x = np.zeros((2, len(times)))
    yield "the coordinate 'time'", lambda: stereo.fuse(xarray.DataArray(x, dims=("c", "time"), coords={"time": times}))
    yield "the index", lambda: stereo.fuse(pandas.DataFrame(x.T, index=pandas.Index(times)))


@pytest.mark.parametrize("share", [1.5, 0.5, 1 + 1e-5])
@pytest.mark.parametrize("as_dates", [False, True])
def test_times_of_another_rate_are_refused(stereo, share, as_dates):
    seconds = np.arange(4000) * 25e-6 * share
    times = np.datetime64("2026-01-01", "ns") + np.round(seconds * 1e9).astype("m8[ns]") if as_dates else seconds
    for place, fuse in _frames(stereo, times):
        with pytest.raises(hb.HybankError, match=f"^{place}: the times are those of .* frames of 40000 Hz; give times in s"):
            fuse()


def test_times_with_a_hole_are_refused_where_it_is(stereo):
    seconds = np.delete(np.arange(400) * 25e-6, [100, 101])
    for place, fuse in _frames(stereo, seconds):
        with pytest.raises(hb.HybankError, match=f"^{place}: 7.5e-05 s lie between samples 99 and 100, and 2.5e-05 s"):
            fuse()
    for times in (seconds[::-1], np.full(400, 3.0), np.full(400, np.nan)):
        for _, fuse in _frames(stereo, times):
            with pytest.raises(hb.HybankError, match="lie between samples"):
                fuse()


def test_times_of_the_rate_are_taken_as_exactly_as_they_are_stated(stereo):
    seconds = np.arange(400) * 25e-6
    for times in (
        seconds, seconds * (1 + 5e-7), seconds + 1e6, np.round(seconds, 5), np.arange(400), 7 * np.arange(400),
        np.round(seconds * 1e5).astype("m8[us]") * 10, seconds[:1].repeat(2) + [0, 25e-6],
    ):  # fmt: skip
        for _, fuse in _frames(stereo, times):
            assert len(fuse()) == 2 * len(times)


def test_columns_that_are_no_channels_are_refused_with_the_remedy(stereo):
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    x = np.zeros((400, 2))
    frame = pandas.DataFrame(x, columns=["a", "b"])
    frame.insert(0, "Time", np.arange(400) * 25e-6)
    spec = stereo.spec
    for given, words in [
        (frame, r"the column 'Time' is no channel; make it the index: set_index\('Time'\)"),
        (frame[["a"]], "1 columns of pandas for 2 channels; .* interleaved=2"),
        (frame["a"], "1 columns of pandas for 2 channels; .* interleaved=2"),
        (xarray.DataArray(x[:, 0], dims="time"), "one dimension 'time' for 2 channels; .* interleaved=2"),
    ]:
        for call in (stereo.fuse, lambda given: hb.calibrate(given, stereo)):
            with pytest.raises(hb.HybankError, match=words):
                call(given)
    for call in (stereo.fuse, lambda given: hb.calibrate(given, stereo), stereo.stream().process):
        with pytest.raises(hb.HybankError, match="give a row for each channel; .* interleaved=2"):
            call(x[:, 0])
    assert spec and len(stereo.fuse(frame.set_index("Time"))) == 800
    assert len(stereo.fuse(frame["a"], interleaved=2)) == 400


@pytest.mark.parametrize("dtype", ["f4", "f8", "i2"])
@pytest.mark.parametrize("chunks", [(100,) * 4, (400,), (1, 398, 1), (17, 300, 83)])
@pytest.mark.parametrize("which", ["fir", "iir"])
def test_a_dask_array_stays_lazy_and_has_the_same_bits(which, chunks, dtype, random, request):
    da = pytest.importorskip("dask.array")
    bank = request.getfixturevalue(which)
    x = (0.2 * random.standard_normal((2, 400))).astype("f4") if dtype != "i2" else random.integers(-9999, 9999, (2, 400))
    x = x.astype(dtype)
    computed = []

    def seen(block):
        computed.append(block.shape)
        return block

    lazy = da.from_array(x, chunks=((2,), chunks)).map_blocks(seen, dtype=dtype, meta=np.empty((0, 0), dtype))
    y = bank.fuse(lazy)
    assert isinstance(y, da.Array) and not computed and y.shape == (800,) and len(y.chunks[0]) == len(chunks)
    want = bank.fuse(x)
    found = y.compute()
    assert found.dtype == want.dtype == y.dtype and computed
    np.testing.assert_array_equal(found, want)
    np.testing.assert_array_equal(bank.fuse(lazy.T, axis=0, keep_latency=True).compute(), bank.fuse(x, keep_latency=True))


def test_lazy_arrays_in_xarray_stay_lazy(fir, x):
    xarray, da = pytest.importorskip("xarray"), pytest.importorskip("dask.array")
    given = xarray.DataArray(da.from_array(x, chunks=(2, 100)), dims=("channel", "time"))
    y = fir.fuse(given)
    assert isinstance(y.data, da.Array) and y.dims == ("time",)
    np.testing.assert_array_equal(y.compute().data, fir.fuse(x))
    long = da.from_array(0.1 * x, chunks=(2, 100))
    with pytest.raises(hb.HybankError, match="^gaps: a lazy array"):
        fir.fuse(long, gaps=True)
