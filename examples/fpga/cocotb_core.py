"""Runs an exported core in cocotb: the vectors of its testbench, with random pauses between the frames.

    hybank export fixed.json -o core.v --testbench vectors
    python examples/fpga/cocotb_core.py core.v vectors

needs Icarus Verilog and `pip install cocotb`. A core of several clocks per frame is asked by `in_ready`. Each
output must equal that of `fuse --bit-true`, which `expected.txt` holds.
"""

import os
import random
import sys
from pathlib import Path

import cocotb
from cocotb.clock import Clock
from cocotb.triggers import FallingEdge
from cocotb_tools.runner import get_runner

PERIOD_NS = 4


def table(name):
    """The rows of integers of a file of vectors."""
    path = Path(os.environ["VECTORS"], name)
    return [[int(number) for number in line.split()] for line in path.read_text().splitlines()]


async def give(dut, frames, dice):
    """Gives the frames, each after a random pause, as soon as the core takes one."""
    for frame in frames:
        for _ in range(dice.choice([0, 0, 0, 1, 5])):
            dut.in_valid.value = 0
            await FallingEdge(dut.clk)
        while hasattr(dut, "in_ready") and not dut.in_ready.value:
            dut.in_valid.value = 0
            await FallingEdge(dut.clk)
        dut.in_valid.value = 1
        for channel, sample in enumerate(frame, 1):
            getattr(dut, f"x{channel}").value = sample
        await FallingEdge(dut.clk)
    dut.in_valid.value = 0


async def take(dut, wanted):
    """Compares every output with the wanted one, in their order."""
    for frame, outputs in enumerate(wanted):
        while not dut.out_valid.value:
            await FallingEdge(dut.clk)
        found = [getattr(dut, f"y{phase}").value.to_signed() for phase in range(len(outputs))]
        assert found == outputs, f"frame {frame}: {found}, not {outputs}"
        await FallingEdge(dut.clk)


@cocotb.test()
async def outputs_are_those_of_bit_true(dut):
    """Inputs change at falling edges, and the core acts at rising ones."""
    cocotb.start_soon(Clock(dut.clk, PERIOD_NS, unit="ns").start())
    dut.rst.value, dut.in_valid.value = 1, 0
    for _ in range(3):
        await FallingEdge(dut.clk)
    dut.rst.value = 0
    taking = cocotb.start_soon(take(dut, table("expected.txt")))
    await give(dut, table("input.txt"), random.Random(2007))
    await taking


def main():
    core, vectors = (Path(argument).resolve() for argument in sys.argv[1:])
    runner = get_runner("icarus")
    runner.build(
        sources=[core],
        hdl_toplevel=core.stem,
        build_dir=vectors / "cocotb",
        build_args=["-g2001"],
        timescale=("1ns", "1ps"),
    )
    results = runner.test(
        hdl_toplevel=core.stem,
        test_module="cocotb_core",
        test_dir=vectors / "cocotb",
        extra_env={"VECTORS": str(vectors), "PYTHONPATH": str(Path(__file__).parent)},
    )
    tree = Path(results).read_text()
    sys.exit("<failure" in tree or "<error" in tree)


if __name__ == "__main__":
    main()
