#!/usr/bin/env bash
# Writes the page, playground/dist/hybank.html: one file that holds the program, compiled to WebAssembly and
# compressed, and that loads nothing.
set -euo pipefail
cd "$(dirname "$0")"
target=wasm32-wasip1
if ! rustc --print target-libdir --target "$target" 2>/dev/null | xargs -r test -d; then
    echo "playground: Rust's $target is not installed: rustup target add $target" >&2
    exit 1
fi
build=${CARGO_TARGET_DIR:-$PWD/target}
cargo build --quiet --release --target "$target" --target-dir "$build"

# Scripts of the page run only if they are this one.
script=$(openssl dgst -sha256 -binary page/page.js | base64 -w0)
policy="default-src 'none'; script-src 'sha256-$script' 'wasm-unsafe-eval'; worker-src blob:; style-src 'unsafe-inline'; img-src data:"

program() { gzip -9nc "$build/$target/release/playground.wasm" | base64 -w 160; }
examples() {
    for spec in speech-2x thesis-fir thesis-iir interleaved-4x250M oversampled-3for2 vibration-3x; do
        local file=../filters/$spec.toml
        printf '<script type="text/plain" class="example" title="%s">\n' "$(sed -n 's/^name = "\(.*\)"$/\1/p' "$file")"
        cat "$file"
        printf '</script>\n'
    done
}

mkdir -p dist
while IFS= read -r line; do
    case $line in
    @STYLE@) cat page/style.css ;;
    @PROGRAM@) program ;;
    @WORKER@) cat page/worker.js ;;
    @EXAMPLES@) examples ;;
    @SCRIPT@) printf '<script>' && cat page/page.js && printf '</script>\n' ;;
    *) printf '%s\n' "${line/@POLICY@/$policy}" ;;
    esac
done <page/index.html >dist/hybank.html.new
mv dist/hybank.html.new dist/hybank.html
echo "playground/dist/hybank.html: $(wc -c <dist/hybank.html) bytes, $(gzip -9c dist/hybank.html | wc -c) compressed"
