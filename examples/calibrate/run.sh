#!/bin/sh
# From captures to a bank and back: four 12-bit converters with skews, gain errors and offsets that nobody knows
# are measured with three tones; a bank is designed for them, proven, and used on a tone that it has not seen.
#
#   sh examples/calibrate/run.sh [FOLDER]      everything goes into FOLDER, by default a new one
set -eu
here=$(cd "$(dirname "$0")" && pwd)
work=${1:-$(mktemp -d)}
mkdir -p "$work"
cd "$work"

# The true converters. Only `simulate` knows these errors.
errors="--delay-error 10ps,-8ps,9ps,0 --gain-error 1%,-0.8%,-1%,0 --offset 0.0024,-0.0020,0.0015,-0.0024"
errors="$errors --bits 12 --noise 1e-4"
four() { echo "$1/ch1.wav $1/ch2.wav $1/ch3.wav $1/ch4.wav"; }

# Captures of three tones to learn from, and of another tone to judge by.
hybank simulate "$here/spec.toml" --source tones:37.1MHz,161.3MHz,211.7MHz --gain 0.32 --samples 65536 \
    $errors --seed 1 -o training
hybank simulate "$here/spec.toml" --source tones:183.1MHz --gain 0.9 --samples 65536 $errors --seed 2 -o held-out

# Delays, gains and offsets with their intervals; the held-out captures must agree.
hybank calibrate "$here/spec.toml" $(four training) -o measured.toml --reference 4 \
    --tone 37.1MHz,161.3MHz,211.7MHz --check $(four held-out)

# A bank for the drawing and one for the converters; the second with its proof.
hybank design "$here/spec.toml" -o nominal.json
hybank design --prove measured.toml -o measured.json
hybank verify measured.json

# The held-out tone through both.
hybank fuse nominal.json $(four held-out) -o nominal.wav
hybank fuse measured.json $(four held-out) -o measured.wav

# Measured again, where the filters have settled: the interleaving spurs of the first are not in the second.
hybank measure nominal.wav --tone 183.1MHz --interleaved 4 --skip 200
hybank measure measured.wav --tone 183.1MHz --interleaved 4 --skip 200
