#!/bin/sh
# Builds the fuzz targets with coverage on the stable toolchain and runs one of them, or `all` in turn.
# usage: ./run.sh TARGET|all [seconds of each]; TARGET is the name of a file in fuzz_targets
# Corpora, logs and what was found stay in hybank-corpus in the folder for temporary files. A line for each target has its counts.
set -eu
cd "$(dirname "$0")"
targets=$(ls fuzz_targets | sed 's/\.rs$//')
[ "${1:?usage: ./run.sh TARGET|all [seconds], TARGET one of: $(echo $targets)}" = all ] || targets=$1
host=$(rustc -vV | sed -n 's/^host: //p')
corpus=${TMPDIR:-/tmp}/hybank-corpus
RUSTFLAGS="-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
-Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
-Cllvm-args=-sanitizer-coverage-trace-compares --cfg fuzzing -Ccodegen-units=1 -Cdebug-assertions" \
    cargo build --release --target "$host" $(printf ' --bin %s' $targets)
found=0
for target in $targets; do
    mkdir -p "$corpus/$target"
    log="$corpus/$target.log"
    "${CARGO_TARGET_DIR:-target}/$host/release/$target" "$corpus/$target" "seeds/$target" -max_len=4096 -timeout=30 \
        -max_total_time="${2:-60}" -print_final_stats=1 -artifact_prefix="$corpus/$target-" >"$log" 2>&1 || {
        found=1
        echo "$target: found, see $log"
    }
    count() { sed -n "s/^stat::$1: *//p" "$log"; }
    echo "$target: ${2:-60} s, $(count number_of_executed_units) executions, $(count peak_rss_mb) MB," \
        "$(ls "$corpus/$target" | wc -l) inputs kept"
done
exit $found
