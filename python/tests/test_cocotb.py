"""An exported core in cocotb and Icarus Verilog: a frame per clock, several clocks per frame, several frames per clock."""

import shutil
import subprocess
import sys

import pytest
from conftest import ROOT

SPEC = """
fast_rate = "48 kS/s"
ratio = 2
latency = 12
target = { filter = { family = "butterworth", order = 4, cutoff = "9 kHz" } }
channel = [{ delay = "25 us" }, { delay = "12.5 us" }]
signal = { band = "14 kHz" }
design = { method = "fir", taps = 24, bits = 12 }
"""


@pytest.mark.parametrize("circuit", [[], ["--clocks-per-frame", "4"], ["--frames-per-clock", "2"]])
def test_a_core_has_the_bits_of_the_model(binary, tmp_path, circuit):
    pytest.importorskip("cocotb")
    if shutil.which("iverilog") is None:
        pytest.skip("Icarus Verilog is not installed")
    (tmp_path / "spec.toml").write_text(SPEC)

    def run(*words):
        return subprocess.run(words, cwd=tmp_path, capture_output=True, text=True)

    assert run(binary, "design", "spec.toml", "-o", "fixed.json").returncode == 0
    core = ["-o", "core.v", "--input-bits", "12", "--testbench", "vectors", *circuit]
    assert run(binary, "export", "fixed.json", *core).returncode == 0
    simulate = [sys.executable, ROOT / "examples/fpga/cocotb_core.py", "core.v", "vectors"]
    done = run(*simulate)
    assert done.returncode == 0 and "PASS=1" in done.stdout + done.stderr, done.stdout + done.stderr
    # One wrong number among the wanted ones is seen.
    wanted = tmp_path / "vectors" / "expected.txt"
    lines = wanted.read_text().splitlines()
    lines[5] = " ".join(str(1 - int(number)) for number in lines[5].split())
    wanted.write_text("\n".join(lines))
    assert run(*simulate).returncode != 0
