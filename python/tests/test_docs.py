"""The snippets of docs/python.md run, one after another, in one folder."""

import importlib.util
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import ROOT

SPEC = """\
fast_rate = "48 kS/s"
ratio = 2
target = { filter = { family = "butterworth", order = 4, cutoff = "9 kHz" } }
channel = [{ delay = "25 us" }, { delay = "12.5 us" }]
design = { method = "iir" }
"""


def test_the_snippets_run_and_say_what_is_true(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("spec.toml").write_text(SPEC)
    text = (ROOT / "docs" / "python.md").read_text()
    names, missing = {}, set()
    for snippet in re.findall(r"```python\n(.*?)```", text, re.S):
        absent = {p for p in ("scipy", "soundfile", "control") if p in snippet and importlib.util.find_spec(p) is None}
        missing |= absent
        if absent:
            continue
        exec(compile(snippet, "docs/python.md", "exec"), names)
        if "error =" in snippet:
            # What the figures promise for the signal is what a chirp in its band measures.
            snr = 20 * np.log10(np.std(names["capture"].target) / np.std(names["error"]))
            assert abs(snr - names["bank"].figures().snr.total_db) < 1
        if "same =" in snippet:
            np.testing.assert_allclose(names["same"], names["bank"].fuse(names["x"]), atol=1e-12)
        if "dlsim" in snippet or "forced_response" in snippet:
            want = names["bank"].fuse(names["x"], keep_latency=True)
            np.testing.assert_allclose(names["causal"], want, atol=1e-10)
        if "full_output" in snippet:
            assert names["report"].gaps[0][:3] == (2, 100, 4) and names["report"].mask.any()
    if missing:
        pytest.skip(f"all snippets hold, except those of {', '.join(sorted(missing))}, which is not installed")
