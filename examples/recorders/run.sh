#!/bin/sh
# Two recordings of one event become one. The recorders were started by hand, 50 ms apart, and their clocks drift
# apart by 1.5 ppm.
#
#   sh examples/recorders/run.sh [FOLDER]      everything goes into FOLDER, by default a new one
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=${1:-$(mktemp -d)}
mkdir -p "$work"
cd "$work"

# What the recorders write: a short sweep, another one above what they resolve, three claps and a tone. Only `simulate` knows starts and clocks.
hybank simulate "$here/spec.toml" -o captures --samples 153600 --gain 0.08 --noise 1e-4 \
    --source chirp:200Hz..15kHz@0.2s+chirp:33kHz..24kHz@0.3s+step@0.31+step@0.46+step@0.58+tones:440Hz \
    --delay-error 0,-50.4ms --drift 0,1.5

# Starts, drift and gains from the recordings; the spec and the recordings that begin together.
hybank align "$here/spec.toml" captures/ch1.wav captures/ch2.wav -o aligned.toml --trim aligned

# The bank, for all delays of the second recorder.
hybank design aligned.toml -o bank.json
hybank verify bank.json

hybank fuse bank.json aligned/ch1.wav aligned/ch2.wav -o fused.wav
hybank measure fused.wav --ref captures/target.wav
