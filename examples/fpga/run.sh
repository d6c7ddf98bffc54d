#!/bin/sh
# From captures to hardware: four 12-bit converters are calibrated, a bank with taps of 14 bits is designed for
# them and exported as Verilog, and the circuit runs on captures in a simulator. Its outputs must equal those of
# `fuse --bit-true`; the SFDR of both is printed beside that of the floating-point bank. Then the converters
# drift, and a circuit whose taps and offsets are loaded takes those of a new calibration.
#
#   sh examples/fpga/run.sh [FOLDER]      needs Icarus Verilog; everything goes into FOLDER, by default a new one
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=${1:-$(mktemp -d)}
mkdir -p "$work"
cd "$work"

# The true converters. Only `simulate` knows these errors.
errors="--delay-error 10ps,-8ps,9ps,0 --gain-error 1%,-0.8%,-1%,0 --offset 0.0024,-0.0020,0.0015,-0.0024 --bits 12"
four() { echo "$1/ch1.wav $1/ch2.wav $1/ch3.wav $1/ch4.wav"; }
hybank simulate "$here/spec.toml" --source tones:37.1MHz,161.3MHz,211.7MHz --gain 0.32 --samples 65536 \
    $errors --seed 1 -o training
hybank simulate "$here/spec.toml" --source tones:183.1MHz --gain 0.9 --samples 65536 $errors --seed 2 -o held-out
hybank calibrate "$here/spec.toml" $(four training) -o measured.toml --reference 4 --tone 37.1MHz,161.3MHz,211.7MHz

# The bank as numbers of 64 bits and with taps of 14 bits.
hybank design measured.toml -o float.json
hybank design measured.toml -o fixed.json --bits 14
hybank fuse float.json $(four held-out) -o float.wav --bits 64f --keep-latency
hybank fuse fixed.json $(four held-out) -o integer.wav --bit-true --keep-latency

# The circuit with its testbench. The WAV files hold the 12 bits in words of 16, so that the outputs have 16 too.
hybank export fixed.json -o core.v --input-bits 16 --testbench . --json
iverilog -g2001 -o test core.v core_tb.v
vvp test

# The same testbench with the captures: 16384 frames of words of 16 bits, at the ends of the files.
words() { tail -c $((16384 * $2)) "$1" | od -An -v -t d2 -w"$2"; }
for i in 1 2 3 4; do words held-out/ch$i.wav 2 >ch$i.txt; done
paste -d ' ' ch1.txt ch2.txt ch3.txt ch4.txt >captures.txt
words integer.wav 8 >wanted.txt
iverilog -g2001 -P core_tb.INPUT='"captures.txt"' -P core_tb.EXPECTED='"wanted.txt"' \
    -P core_tb.FRAMES=16384 -P core_tb.OUTPUT='"rtl.csv"' -o captures core.v core_tb.v
vvp captures

# A circuit for every board and drift: its taps and offsets are loaded. Its testbench loads two banks.
hybank export fixed.json -o loadable.v --input-bits 16 --loadable --testbench loadable --json
(cd loadable && iverilog -g2001 -o test ../loadable.v loadable_tb.v && vvp test)

# The converters drift. They are calibrated again; the bank has the same number of taps, bits and fraction bits.
drifted="--delay-error 4ps,-1ps,12ps,0 --gain-error 1.4%,-0.5%,-1.3%,0 --offset 0.0030,-0.0024,0.0011,-0.0020 --bits 12"
hybank simulate "$here/spec.toml" --source tones:37.1MHz,161.3MHz,211.7MHz --gain 0.32 --samples 65536 \
    $drifted --seed 3 -o drifted-training
hybank simulate "$here/spec.toml" --source tones:183.1MHz --gain 0.9 --samples 65536 $drifted --seed 4 -o drifted
hybank calibrate "$here/spec.toml" $(four drifted-training) -o drifted.toml --reference 4 \
    --tone 37.1MHz,161.3MHz,211.7MHz
hybank design drifted.toml -o drifted.json --bits 14 --fraction-bits 13
hybank fuse fixed.json $(four drifted) -o outdated.wav --bit-true --keep-latency
hybank fuse drifted.json $(four drifted) -o loaded.wav --bit-true --keep-latency

# The words of the new bank, and the circuit with them. No other words follow: SWITCH is the end.
hybank export drifted.json -o drifted.mem --input-bits 16 --loadable
test "$(grep -o 'Layout: .*' loadable.v)" = "$(grep -o 'Layout: .*' drifted.mem)"
for i in 1 2 3 4; do words drifted/ch$i.wav 2 >ch$i.txt; done
paste -d ' ' ch1.txt ch2.txt ch3.txt ch4.txt >captures.txt
words loaded.wav 8 >wanted.txt
iverilog -g2001 -P loadable_tb.INPUT='"captures.txt"' -P loadable_tb.EXPECTED='"wanted.txt"' \
    -P loadable_tb.LOAD='"drifted.mem"' -P loadable_tb.NEXT='"drifted.mem"' -P loadable_tb.SWITCH=16384 \
    -P loadable_tb.FRAMES=16384 -o loaded loadable.v loadable/loadable_tb.v
vvp loaded

for what in float.wav integer.wav "rtl.csv --rate 1e9 --full-scale 16bits" outdated.wav loaded.wav; do
    echo "${what%%.*}"
    hybank measure $what --tone 183.1MHz --interleaved 4 --skip 200
done
