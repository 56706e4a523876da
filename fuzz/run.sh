#!/usr/bin/env bash
# Builds a fuzz target on the stable toolchain and runs it, from its seeds and what earlier runs found.
#
#   fuzz/run.sh TARGET [libFuzzer's options...]
#   fuzz/run.sh kernels -max_total_time=1800
#   fuzz/run.sh gltf fuzz/artifacts/gltf/crash-...   one input again, by its path from the repository's top
#   fuzz/run.sh all -max_total_time=60               every target, one after the other
#
# Findings are written to fuzz/artifacts/TARGET, what covers new code to fuzz/corpus/TARGET. Needs a C++ compiler.
# Wherever nightly Rust is at hand, cargo fuzz run TARGET does the same with an address sanitizer.
set -euo pipefail
cd "$(dirname "$0")/.."

targets=(obj gltf tree_file forged_tree ray_file builders kernels batches)
[ "$#" -ge 1 ] || { sed -n '2,12s/^# \{0,1\}//p' "$0" >&2; exit 2; }
wanted=$1
shift
[ "$wanted" = all ] || targets=("$wanted")

# As cargo-fuzz does with `-s none`: LLVM's coverage pass is reached by stable flags. With a target given, build scripts
# and procedural macros stay without it.
host=$(rustc -vV | sed -n 's/^host: //p')
flags=(
  -Cpasses=sancov-module
  -Cllvm-args=-sanitizer-coverage-level=4
  -Cllvm-args=-sanitizer-coverage-inline-8bit-counters
  -Cllvm-args=-sanitizer-coverage-pc-table
  -Cllvm-args=-sanitizer-coverage-trace-compares
  -Cllvm-args=-simplifycfg-branch-fold-threshold=0
  -Ccodegen-units=1
  --cfg=fuzzing
)
bins=()
for target in "${targets[@]}"; do bins+=(--bin "$target"); done
(cd fuzz && RUSTFLAGS="${flags[*]}" cargo build --release --locked --target "$host" "${bins[@]}")

# Seeds come from the checks themselves, by a program without coverage.
cargo run --quiet --locked -p niwaki-checks --example fuzz_seeds -- fuzz/seeds > /dev/null
# Options begin with a dash; anything else is an input to run again.
replay=0
for argument in "$@"; do case $argument in -*) ;; *) replay=1 ;; esac; done
for target in "${targets[@]}"; do
  mkdir -p "fuzz/corpus/$target" "fuzz/artifacts/$target"
  folders=()
  [ "$replay" = 1 ] || folders=("fuzz/corpus/$target" "fuzz/seeds/$target")
  "fuzz/target/$host/release/$target" -artifact_prefix="fuzz/artifacts/$target/" -max_len=4096 -timeout=20 \
    -rss_limit_mb=4096 -print_final_stats=1 "$@" "${folders[@]}"
done
