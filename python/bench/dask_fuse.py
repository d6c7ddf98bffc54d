"""CPU and bits of `hybank.dask.fuse` over two processes against one process; what a cluster needs to start and while it
has nothing to do; and the load of a scheduler by empty tasks. Every figure is the least of three runs.

    python python/bench/dask_fuse.py [FRAMES [TAPS]]      100 million unless given; needs dask and distributed

The bank of the thesis has 22 taps per channel, so that reading and writing cost more than filtering. TAPS makes one
of so many taps, which are noise.
"""

import json
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from distributed import Client, LocalCluster, wait

import hybank as hb

ROOT = Path(__file__).resolve().parents[2]


def cpu(client):
    """CPU seconds of this process, and of the workers if there is a client."""
    used = lambda: sum(os.times()[:2])  # noqa: E731
    return used() + (sum(client.run(used).values()) if client else 0)


def archive(path, channels, frames):
    """Noise, written a part at a time."""
    x = np.lib.format.open_memmap(path, mode="w+", dtype="f4", shape=(channels, frames))
    random = np.random.default_rng(1)
    for first in range(0, frames, 1 << 22):
        part = x[:, first : first + (1 << 22)]
        part[:] = random.standard_normal(part.shape, dtype="f4")
    x.flush()


def seconds(client, run):
    """CPU seconds of everybody while something runs, and its result."""
    begin = cpu(client)
    result = run()
    return cpu(client) - begin, result


def fused(client, bank, folder, algorithm, frames):
    """From a file into a file: as a whole, span by span in this process, and by tasks."""
    x = np.load(folder / "in.npy", mmap_mode="r")
    whole, spans, tasks = (folder / f"{name}.npy" for name in ("whole", "spans", "tasks"))
    by_spans = lambda sink, client: hb.dask.fuse(bank, folder / "in.npy", sink, client=client, algorithm=algorithm)  # noqa: E731
    runs = {
        "whole": lambda: np.save(whole, bank.fuse(x, algorithm=algorithm)),
        "spans": lambda: by_spans(spans, None),
        "tasks": lambda: by_spans(tasks, client),
    }
    # What the workers need while one process works alone is not its own.
    counted = lambda name: client if name == "tasks" else None  # noqa: E731
    used = {name: min(seconds(counted(name), run)[0] for _ in range(3)) for name, run in runs.items()}
    want = whole.read_bytes()
    same = all(path.read_bytes() == want for path in (spans, tasks))
    one = min(used["whole"], used["spans"])
    print(
        f"{algorithm}: {frames} frames, equal {same}, CPU {used['whole']:.2f} s as a whole, {used['spans']:.2f} s in"
        f" spans, {used['tasks']:.2f} s by tasks; tasks over the less of one process: {used['tasks'] / one:.3f}"
    )


def overhead(client, before):
    """What is paid without any samples."""
    start = cpu(client) - before
    idle = min(seconds(client, lambda: time.sleep(1))[0] for _ in range(3))
    print(f"cluster: {start:.2f} s of CPU to start, {idle:.2f} s in each second without tasks")


def empty(client, count=20_000):
    begin = time.perf_counter()
    wait(client.map(lambda k: k, range(count), pure=False))
    seconds = time.perf_counter() - begin
    print(f"scheduler: {count} empty tasks in {seconds:.2f} s, {1e6 * seconds / count:.0f} us each")


def noise_bank(taps):
    """Two channels with taps that cost as much as designed ones."""
    random = np.random.default_rng(2)
    channels = [{"delay": 0.0, "taps": list(random.standard_normal(taps) / taps)} for _ in range(2)]
    head = {"format": "hybank-bank", "version": 1, "fast_period": 1.0, "ratio": 2, "latency": 0, "method": "fir"}
    gamma = dict.fromkeys(("norm", "upper", "lower", "noncausal"))
    return hb.Bank.from_json(json.dumps({**head, "channels": channels, "gamma": gamma}))


def main():
    frames = int(float(sys.argv[1])) if len(sys.argv) > 1 else 100_000_000
    bank = noise_bank(int(sys.argv[2])) if len(sys.argv) > 2 else hb.load(ROOT / "filters" / "thesis-fir.json")
    settings = {"n_workers": 2, "threads_per_worker": 1, "processes": True, "dashboard_address": ":0"}
    before = sum(os.times()[:2])
    with tempfile.TemporaryDirectory() as name, LocalCluster(**settings) as cluster, Client(cluster) as client:
        overhead(client, before)
        archive(Path(name) / "in.npy", bank.channels, frames)
        for algorithm in ("direct", "overlap-save"):
            fused(client, bank, Path(name), algorithm, frames)
        empty(client)


if __name__ == "__main__":
    main()
