#!/bin/sh
# Two recordings of one event by two recorders become one: their clocks drift apart by 1.5 ppm, and it is not known
# when the second one began to the microsecond.
#
#   sh examples/recorders/run.sh [FOLDER]      everything goes into FOLDER, by default a new one
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=${1:-$(mktemp -d)}
mkdir -p "$work"
cd "$work"

# The bank, its taps affine in the delay of the second recorder.
hybank design "$here/spec.toml" -o bank.json
hybank verify bank.json

# What the recorders write. Only `simulate` knows how their clocks differ.
hybank simulate bank.json --source tones:440Hz,3.1kHz,9.7kHz --samples 76800 -o captures \
    --drift 0,1.5 --delay-error 0,-0.5us --noise 1e-4

# With taps that stay, and with taps that follow the delay as the recordings show it.
hybank fuse bank.json captures/ch1.wav captures/ch2.wav -o fixed.wav
hybank fuse bank.json captures/ch1.wav captures/ch2.wav -o fused.wav --track blind --track-log delays.jsonl
hybank measure fixed.wav --ref captures/target.wav
hybank measure fused.wav --ref captures/target.wav
tail -n 1 delays.jsonl
