#!/bin/sh
# Two inertial sensors with rates of their own, 100 Hz and 60 Hz, become one of 300 Hz.
#
#   sh examples/inertial/run.sh [FOLDER]      everything goes into FOLDER, by default a new one
set -eu
work=${1:-$(mktemp -d)}
mkdir -p "$work"
cd "$work"

# A frame of 15 output samples holds 5 samples of the first sensor and 3 of the second one.
hybank init --example inertial -o spec.toml --force
hybank design spec.toml -o bank.json

# Vibrations at 7, 31 and 57 Hz. Each sensor writes a recording at its own rate.
hybank simulate bank.json --source tones:7Hz,31Hz,57Hz --gain 0.25 --noise 1e-4 --samples 18000 -o captures
hybank fuse bank.json captures/ch1.wav captures/ch2.wav -o fused.wav
hybank measure fused.wav --ref captures/target.wav
