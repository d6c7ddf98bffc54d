#!/usr/bin/env bash
# Runs the portable kernels under Miri: each load and store of runtime/src/simd, on calls of a few frames (fewer shapes
# than natively, see runtime/src/tests/small_calls.rs).
# Skipped, and says so, where the nightly toolchain has no Miri (rustup component add --toolchain nightly miri).
set -euo pipefail
cd "$(dirname "$0")/.."
if ! cargo +nightly miri --version >/dev/null 2>&1; then
    echo "miri.sh: SKIPPED, cargo +nightly miri is not installed" >&2
    exit 0
fi
cargo +nightly miri test -p hybank-runtime --lib -- small_calls simd::
