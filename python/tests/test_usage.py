"""The package as a user writes it: one session from a spec to many machines."""

import importlib

import numpy as np
import pytest
from test_calibrate_measure import capture, plant

import hybank as hb

SPEC = """\
fast_rate = "48 kS/s"
ratio = 2
target = { filter = { family = "butterworth", order = 4, cutoff = "9 kHz" } }
channel = [{ delay = "25 us" }, { delay = "12.5 us" }]
design = { method = "fir", taps = 16 }
"""

SESSION = """
bank = hb.design("spec.toml")
bank = hb.design(fast_rate=48e3, ratio=2, target=hb.butterworth(4, 9e3),
                 channels=[hb.Channel(delay=25e-6), hb.Channel(delay=12.5e-6)], method="iir", order=6)
bank.save("bank.json"); bank = hb.load("bank.json")
bank.gamma.upper; bank.taps; bank.ss; bank.latency
f, e = bank.error_response(512)
y = bank.fuse(x)
y, info = bank.fuse(x, gaps=True, dtype="f4", threads=2, full_output=True)
with bank.stream(axis=0) as s:
    s.latency, s.memory, s.alignment, s.state
    for block in blocks("in.wav", 4096): sink(s.process(block))
    sink(s.flush())
cap = hb.simulate(bank, "chirp:50Hz..8kHz@1s"); p = hb.verify("bank.json"); a = hb.analyze(bank, delay_error=[1e-9, 0])
m = hb.measure(y, rate)
bank.export("fir.h", format="c")
"""


def _optional(name):
    try:
        return importlib.import_module(name)
    except ImportError:
        return None


@pytest.mark.filterwarnings("ignore:the tone at", "ignore:the first and the last")
def test_a_session(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.toml").write_text(SPEC)
    rate = 48e3
    x = np.sin(0.3 * np.arange(10_000) + np.array([[0.0], [0.15]])).astype("f4")
    written = []
    blocks = lambda _name, size: (x.T[k : k + size] for k in range(0, x.shape[1], size))  # noqa: E731
    if soundfile := _optional("soundfile"):
        soundfile.write("in.wav", x.T, 24000, subtype="FLOAT")
        blocks = lambda name, size: soundfile.blocks(name, size, dtype="float32")  # noqa: E731
    names = {"hb": hb, "x": x, "rate": rate, "sink": written.append, "blocks": blocks}
    exec(compile(SESSION, "session", "exec"), names)
    bank, y = names["bank"], np.concatenate(written)
    np.testing.assert_array_equal(y[bank.latency :][: 2 * x.shape[1]], bank.fuse(x))
    assert bank.method == "iir" and bank.taps is None and names["p"].upper == bank.gamma.upper
    assert names["info"].gaps == [] and names["m"].enob_from_sinad > 3 and names["a"].gamma != bank.gamma.norm
    assert len(names["e"]) == 512 and names["cap"].channels.shape[0] == 2 and (tmp_path / "fir.h").exists()
    if zarr := _optional("zarr"):
        zarr.create_array("in.zarr", data=x)
        hb.dask.fuse(bank, "in.zarr", "out.zarr")
        np.testing.assert_array_equal(zarr.open_array("out.zarr")[:], bank.fuse(x))
    cal = hb.calibrate(capture(), plant([60e-9, 30e-9]), tones=[1e6, 7e6])
    assert len(cal.delay) == 2
