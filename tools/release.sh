#!/usr/bin/env bash
# Makes what is published, without publishing it: the crates and the source package for Python, in FOLDER.
#
# tools/release.sh ADDRESS [FOLDER]    FOLDER is target/release-candidate unless given; it is made anew
#
# ADDRESS is that of the public repository (https://host/owner/hybank). It becomes `repository`, and the pages of
# the registries get links that lead there: relative ones lead nowhere on docs.rs and PyPI. The repository itself
# names no address. Afterwards the crates are checked from what was packed alone. CONTRIBUTING.md has the steps.
set -euo pipefail
cd "$(dirname "$0")/.."
address=${1:?tools/release.sh ADDRESS [FOLDER]}
build=${CARGO_TARGET_DIR:-$PWD/target}
folder=${2:-$build/release-candidate}
version=$(sed -n '/^\[workspace.package\]/,/^\[/s/^version = "\(.*\)"/\1/p' Cargo.toml)
# Bytes of a packed crate; crates.io takes 10 MiB.
most=1500000
# In the order of dependence.
crates=(hybank-linalg hybank-runtime hybank-sampling hybank-core hybank-instants hybank-verify hybank-design hybank-program hybank hybank-ibr hybank-cli)

# crates.io takes five keywords of 20 characters.
if grep -nE '^keywords = ([^]]*$|.*"[^",]{21,}"|(.*,){5})' {.,linalg,runtime,sampling,core,instants,verify,design,program,ibr,cli}/Cargo.toml; then
    echo "release: crates.io takes at most five keywords, each of at most 20 characters; give them in one line" >&2
    exit 1
fi

rm -rf "$folder"
mkdir -p "$folder"
git ls-files -z --cached --others --exclude-standard | xargs -0 cp --parents --no-dereference -t "$folder"
cd "$folder"

sed -i "s|^# .repository. is set.*|repository = \"$address\"|" Cargo.toml
sed -i 's|^license\.workspace = true|&\nrepository.workspace = true|' {.,linalg,runtime,sampling,core,instants,verify,design,program,ibr,cli}/Cargo.toml
sed -i "s|^\[project.optional-dependencies\]|[project.urls]\nRepository = \"$address\"\nChangelog = \"$address/blob/v$version/CHANGELOG.md\"\n\n&|" pyproject.toml
# The pages of the registries, each with the folder from which its links lead.
for page in README.md {linalg,runtime,sampling,core,instants,verify,design,program,ibr}/README.md docs/python.md; do
    base=$(dirname "$page")/
    # A picture is the file itself, not the page around it.
    sed -Ei "s|(!\[[^]]*\]\()([A-Za-z0-9_./-]+)\)|\1${address}/raw/v$version/${base#./}\2)|g" "$page"
    sed -Ei "s|\]\(([A-Za-z0-9_./-]+)(#[a-z0-9-]+)?\)|](${address}/blob/v$version/${base#./}\1\2)|g" "$page"
    if grep -nE '\]\([^)#:]+[)#]' "$page"; then
        echo "release: $page has links that lead nowhere on the page of a registry" >&2
        exit 1
    fi
done

# Outside of any repository of git, so that `include` alone decides.
export CARGO_TARGET_DIR="$build"
chosen=("${crates[@]/#/--package=}")
cargo package --quiet --no-verify --allow-dirty "${chosen[@]}"
packed=$build/package/packed
rm -rf "$packed"
mkdir "$packed"
members=()
for crate in "${crates[@]}"; do
    # Files of a package have one date for ever, by which cargo would take an earlier build for this one.
    tar --touch -xzf "$build/package/$crate-$version.crate" -C "$packed"
    for file in LICENSE-MIT LICENSE-APACHE README.md; do
        [ -s "$packed/$crate-$version/$file" ] || { echo "release: $crate has no $file" >&2; exit 1; }
    done
    if [ "$(stat -c %s "$build/package/$crate-$version.crate")" -gt "$most" ]; then
        echo "release: $crate has more than $most bytes; see \`cargo package --list -p $crate\`, or raise the limit" >&2
        exit 1
    fi
    members+=("$crate-$version")
    printf '%s: %s packed, %s unpacked\n' "$crate $version" "$(du -h --apparent-size "$build/package/$crate-$version.crate" | cut -f1)" \
        "$(du -sh --apparent-size "$packed/$crate-$version" | cut -f1)"
done
# The crates as they are in their packages, each of the others from its package too.
{
    printf '[workspace]\nresolver = "3"\nmembers = ['
    printf '"%s", ' "${members[@]}"
    printf ']\n[patch.crates-io]\n'
    for crate in "${crates[@]}"; do printf '%s = { path = "%s" }\n' "$crate" "$crate-$version"; done
} >"$packed/Cargo.toml"
cp Cargo.lock "$packed"
cd "$packed"
# With HYBANK_SLOW also their tests, which takes minutes.
if [ -n "${HYBANK_SLOW:-}" ]; then cargo test --quiet --workspace; else cargo check --quiet --workspace; fi
