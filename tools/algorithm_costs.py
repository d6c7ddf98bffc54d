#!/usr/bin/env python3
"""Fits the cost model of runtime/src/algorithms/choice.rs to the table of `cargo bench --bench algorithm_crossover`.

usage: algorithm_costs.py LANES < table      (LANES of 32 bytes: 8 for f32, 4 for f64; needs numpy and scipy)

Prints nanoseconds for each term of a frame, and quantiles of measured / fitted. Divided by the time of a vector of
products and rounded they are the constants of the model. Then prints how much longer the choices of the plan take
than the fastest algorithm: run it for the table of each instruction set, because one model serves them all.
"""

import sys
from math import ceil, log2

import numpy as np
from scipy.optimize import nnls

GROUP = int(sys.argv[1])


def blocks(n, m, k, length):
    """Terms of overlap-save: rows x passes, vectors of products, batches, outputs, inputs, frames."""
    depth = min(1 << (max(n, m) - 1).bit_length(), GROUP)
    batch = 2 * (GROUP // depth) * (length - k + 1)
    inputs, outputs = -(-n // depth), -(-m // depth)
    share = length / batch
    passes = ceil(log2(length) / 2) * (1 + 0.15 * max(0, log2(length / 256)))
    return [share * (inputs + outputs) * passes, share * 4 * n * outputs, 1 / batch, m, n, 1]


def direct(n, m, k):
    """Terms of the direct algorithm: vectors of products, vectors of sums, outputs, frames."""
    depth = n if n < GROUP and n & (n - 1) == 0 else GROUP
    steps = -(-k * n // depth)
    return [steps * depth * m / GROUP, depth * m / GROUP, m, 1]


def fit(name, rows):
    """Non-negative least squares of the relative error; what a busy host delayed weighs less."""
    terms, times = (np.array(column, float) for column in zip(*rows))
    weights = 1 / times
    for _ in range(30):
        costs, _ = nnls(terms * weights[:, None], times * weights)
        ratio = times / (terms @ costs)
        weights = np.where(ratio > 1.15, 0.2, 1) / times
    print(name, np.round(costs, 3), "measured / fitted:", np.round(np.percentile(ratio, [5, 50, 95]), 2))
    return costs


def losses(rows):
    """How much longer the plan's choice takes than the fastest measured algorithm."""
    ratios = []
    for row in rows:
        times = {"direct": float(row[3])}
        times |= {f"overlap-save {f}": float(t) for f, t in (part.split(":") for part in row[4].split(","))}
        if row[5] in times:
            ratios.append((times[row[5]] / min(times.values()), "N {} M {} K {}".format(*row[:3]), row[5]))
    values = [ratio for ratio, *_ in ratios]
    wrong = sum(value > 1.1 for value in values)
    print(f"auto: {len(values)} sizes, {wrong} lose more than a tenth; median and 95 %:",
          np.round(np.percentile(values, [50, 95]), 2), "worst:", *max(ratios))


rows = [[cell.strip() for cell in line.strip().strip("|").split("|")] for line in sys.stdin]
rows = [row for row in rows if len(row) == 6 and row[0].isdigit()]
sizes = [tuple(map(int, row[:3])) for row in rows]
fit("direct", [(direct(*size), float(row[3])) for size, row in zip(sizes, rows)])
pairs = [(size, part.split(":")) for size, row in zip(sizes, rows) for part in row[4].split(",")]
fit("overlap-save", [(blocks(*size, int(length)), float(time)) for size, (length, time) in pairs])
losses(rows)
