#!/bin/sh
# Builds one fuzz target with coverage on the stable toolchain and runs it.
# usage: ./run.sh spec|bank|taps|response|wav|sigmf|lost|csv|npy|mat|tar|pfm|tracks|colmap|transforms|calib|scene [seconds]
set -eu
cd "$(dirname "$0")"
target=${1:?usage: ./run.sh spec|bank|taps|response|wav|sigmf|lost|csv|npy|mat|tar|pfm|tracks|colmap|transforms|calib|scene [seconds]}
host=$(rustc -vV | sed -n 's/^host: //p')
RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Ccodegen-units=1 -Cdebug-assertions" \
    cargo build --release --target "$host" --bin "$target"
mkdir -p "corpus/$target"
"target/$host/release/$target" "corpus/$target" "seeds/$target" -max_total_time="${2:-60}" -max_len=4096
