"""A headless flow graph, by the Python that GNU Radio is installed for, gives the bits of a stream."""

import json
import os
import subprocess

import pytest
from conftest import ROOT

GRAPH = """
import json, sys, time, numpy as np, hybank as hb
from gnuradio import blocks, gr

bank = hb.load(sys.argv[1])
report = {}
for dtype, source, sink in [("f4", blocks.vector_source_f, blocks.vector_sink_f),
                            ("c8", blocks.vector_source_c, blocks.vector_sink_c)]:
    x = np.random.default_rng(5).standard_normal((bank.channels, 50_001)).astype("f4")
    x = x if dtype == "f4" else (x + 1j * x[::-1]).astype("c8")
    graph, block, out = gr.top_block(), hb.gnuradio.fuse(bank, dtype), sink()
    for i, row in enumerate(x):
        graph.connect(source(row.tolist()), (block, i))
    graph.connect(block, out)
    graph.run()
    y, want = np.array(out.data(), dtype), bank.stream(dtype=dtype).process(x)
    report[dtype] = [len(want), len(y), int((y != want[: len(y)]).sum())]
count = 4_000_000
graph, block = gr.top_block(), hb.gnuradio.fuse(bank)
for i in range(bank.channels):
    source, head = blocks.null_source(4), blocks.head(4, count)
    graph.connect(source, head, (block, i))
graph.connect(block, blocks.null_sink(4))
begin = time.perf_counter()
graph.run()
report["outputs_per_second"] = count * bank.ratio / (time.perf_counter() - begin)
print(json.dumps(report))
"""


def test_a_headless_flow_graph_has_the_bits_of_a_stream(filters, tmp_path):
    python = "/usr/bin/python3"
    probe = [python, "-c", "import gnuradio.gr, numpy"]
    if not os.path.exists(python) or subprocess.run(probe, capture_output=True).returncode:
        pytest.skip("GNU Radio is not installed for /usr/bin/python3")
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "python"), "HOME": str(tmp_path)}
    command = [python, "-c", GRAPH, filters / "thesis-fir.json"]
    run = subprocess.run(command, capture_output=True, text=True, env=environment, check=False)
    assert run.returncode == 0, run.stderr
    report = json.loads(run.stdout.splitlines()[-1])
    for dtype in ("f4", "c8"):
        wanted, given, wrong = report[dtype]
        assert wrong == 0 and given == wanted, report
    print(f"GNU Radio: {report['outputs_per_second']:.3g} outputs per second")
