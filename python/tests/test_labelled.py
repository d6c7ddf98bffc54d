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
    y, report = fir.fuse(given.where(given.time != times[5]), gaps="hold", full_output=True)
    assert report.gaps == [(1, 5, 1), (2, 5, 1)] and y.sizes["time"] == 800
    with pytest.raises(hb.HybankError, match='call it "channel"'):
        fir.fuse(xarray.DataArray(np.zeros((2, 2, 9)), dims=("p", "q", "time")))


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
        fir.fuse(long, gaps="hold")
