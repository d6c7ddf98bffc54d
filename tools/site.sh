#!/usr/bin/env bash
# The site of the documents: the pages of the repository, the Python API, rustdoc and the gallery.
#
#   tools/site.sh [FOLDER]        by default target/site; needs Python 3.10 with venv
set -euo pipefail
cd "$(dirname "$0")/.."
export CARGO_TARGET_DIR="${CARGO_TARGET_DIR:-$PWD/target}"
site=${1:-$CARGO_TARGET_DIR/site}
environment=$CARGO_TARGET_DIR/site-python

# One choice of packages, as it decides features of the crates that they share.
PYO3_NO_PYTHON=1 cargo build --quiet --workspace --lib --bins
cargo doc --quiet --no-deps -p hybank -p hybank-runtime -p hybank-linalg -p hybank-ibr --lib \
    --features hybank/flac
install -m 755 "$CARGO_TARGET_DIR/debug/lib_hybank.so" python/hybank/_hybank.abi3.so

"${HYBANK_PYTHON:-python3}" -m venv "$environment"
"$environment/bin/pip" --quiet --disable-pip-version-check install \
    'sphinx>=8,<10' 'myst-parser>=4' furo numpydoc numpy matplotlib

# The pictures of the gallery, by the commands that stand there, with the spec of README.md.
gallery=$(mktemp -d)
trap 'rm -rf "$gallery"' EXIT
awk '/^```toml/ {on = 1; next} /^```/ {on = 0} on' README.md >"$gallery/spec.toml"
grep -E '^hybank(-ibr)? ' docs/gallery.md >"$gallery/commands.sh"
(cd "$gallery" && PATH="$CARGO_TARGET_DIR/debug:$PATH" sh -e commands.sh >/dev/null)
mkdir -p docs/pictures
cp "$gallery"/pictures/* docs/pictures/

# A page that cannot be read, a link without an end or a missing picture fails.
PYTHONPATH=python "$environment/bin/sphinx-build" --quiet --fail-on-warning --keep-going -c docs . "$site"
# Text with an @ that was taken for an address.
if grep -rlE --include='*.html' 'href="mailto:' "$site"; then
    echo "site: these pages link to an address of mail; write such text between double backquotes" >&2
    exit 1
fi
rm -rf "$site/rust"
cp -r "$CARGO_TARGET_DIR/doc" "$site/rust"
cat >"$site/index.html" <<'END'
<!doctype html>
<html lang="en">
<meta charset="utf-8">
<title>hybank</title>
<meta http-equiv="refresh" content="0; url=docs/index.html">
<a href="docs/index.html">The documents of hybank</a>
</html>
END
echo "$site/index.html"
