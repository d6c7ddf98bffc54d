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

# What the recorders write: a dozen tones, two of them above 20 kHz. Only `simulate` knows
# starts and clocks.
hybank simulate "$here/spec.toml" -o captures --samples 153600 --gain 0.01 --noise 1e-5 \
    --source tones:294Hz,562Hz,904Hz,1320Hz,1810Hz,22374Hz,3012Hz,1763Hz,2549Hz,3409Hz,2382Hz,23390Hz \
    --delay-error 0,-50.4ms --drift 0,1.5

# Starts, drift and gains from the recordings; the spec and the recordings that begin together.
hybank align "$here/spec.toml" captures/ch1.wav captures/ch2.wav -o aligned.toml --trim aligned --within 100ms

# The bank, for all delays of the second recorder.
hybank design aligned.toml -o bank.json --prove
hybank verify bank.json

hybank fuse bank.json aligned/ch1.wav aligned/ch2.wav -o fused.wav
hybank measure fused.wav --ref captures/target.wav
