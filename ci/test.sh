#!/usr/bin/env bash
# Installs what the full test suite wants on Debian (Embree, a software Vulkan driver) and runs everything:
# all tests, the examples, and every command of cargo xtask on small scenes.
#
#   ci/test.sh             everything
#   ci/test.sh --no-setup  everything, with what is already installed
set -euo pipefail
cd "$(dirname "$0")/.."

setup=1
case "${1:-}" in
  "") ;;
  --no-setup) setup=0 ;;
  *) sed -n '2,6s/^# \{0,1\}//p' "$0" >&2; exit 2 ;;
esac

step() { printf '\n=== %s (%s s)\n' "$*" "$SECONDS"; }

if [ "$setup" = 1 ]; then
  step "system packages"
  ci/setup-vulkan.sh
  # From here on a missing Vulkan is a failure, not a skipped test.
  if command -v apt-get > /dev/null; then export NIWAKI_REQUIRE_VULKAN=1; fi
  step "Embree"
  # The last line says where the library lies.
  said=$(ci/setup-embree.sh)
  printf '%s\n' "$said"
  eval "$(tail -n 1 <<< "$said")"
  # From here on a missing Embree is a failure, not a skipped test.
  export NIWAKI_REQUIRE_EMBREE=1
fi

step "tests"
cargo test --workspace --locked

# A driver with ray tracing of its own, for the tests and commands that compare with it and for nothing else; where it
# cannot be had, they skip, and nothing fails.
mesa=""
if [ "$setup" = 1 ]; then
  step "driver with ray tracing"
  mesa=$(ci/setup-mesa-ray-tracing.sh | grep ^export) || mesa=""
fi
if [ -n "$mesa" ]; then
  step "tests against the driver's own ray tracing"
  # Of the whole workspace, as above: of one crate, dependencies would be built again for its features.
  (eval "$mesa"; export NIWAKI_REQUIRE_RAY_TRACING=1; cargo test --workspace --locked --test driver)
fi

step "examples"
# All at once, as the tests were built: one crate at a time, cargo would build dependencies again for each set of
# features. Names have to differ, because they share a folder.
cargo build --quiet --workspace --examples --locked
twice=$(basename -a crates/*/examples/*.rs | sort | uniq -d)
[ -z "$twice" ] || { echo "two examples are called $twice" >&2; exit 1; }
for example in crates/*/examples/*.rs; do
  echo "--- $example"
  "${CARGO_TARGET_DIR:-target}/debug/examples/$(basename "$example" .rs)" > /dev/null
done

step "benchmark, small"
cargo xtask bench --quick --scene atrium:20000 --scene hair:20000 --out out/ci-bench

step "accuracy, small"
# Two scenes of different size, so that a cost model is fitted too.
cargo xtask accuracy --quick --scene atrium:2000 --scene hair:8000 --families lbvh,sweep,preset --out out/ci-accuracy
test -s out/ci-accuracy/cost-model.csv
# Fails if a watertight kernel leaks.
cargo xtask accuracy --suite kernels --quick --scene atrium:2000 --out out/ci-accuracy-kernels

step "tables of the thesis, small"
cargo xtask thesis --quick --out out/ci-thesis

step "rays from a file"
printf 'ox,oy,oz,dx,dy,dz\n3.3,2.7,1000,0,0,-1\n0,0,1000,0,0,1\n' > out/ci-rays.csv
cargo xtask trace --scene city:2000 --rays out/ci-rays.csv --out out/ci-trace/hits.csv
cargo xtask trace --scene city:2000 --rays out/ci-rays.csv --out out/ci-trace/brute.csv --kernel brute
cmp out/ci-trace/hits.csv out/ci-trace/brute.csv
test "$(grep -c -- '-1$' out/ci-trace/hits.csv)" = 1

step "pictures, small"
cargo xtask render --scene one_mirror:2000 --frames 2 --size 64x36 --mode whitted --explain --out out/ci-render
# Needs the Vulkan device that was installed above.
if [ "$setup" = 1 ]; then
  cargo xtask render --scene one_mirror:2000 --frames 2 --size 64x36 --mode hybrid --explain --out out/ci-render
  step "accuracy of the hybrid renderer, small"
  cargo xtask accuracy --suite hybrid --quick --out out/ci-accuracy-hybrid
  test -s out/ci-accuracy-hybrid/pictures/gallery-frame.png
  step "accuracy of shadows, small"
  cargo xtask accuracy --suite shadows --quick --out out/ci-accuracy-shadows
  # Shadow volumes are exact but for silhouettes.
  grep -q '^SV,,,,[^,]*,[^,]*,[^,]*,0,' out/ci-accuracy-shadows/csv/shadows-tessellated.csv
  step "accuracy of the model, small"
  cargo xtask accuracy --suite model --quick --out out/ci-accuracy-model
  test -s out/ci-accuracy-model/csv/model-sampling-fairy.csv
fi

# Needs a Vulkan device too.
if [ "$setup" = 1 ]; then
  step "GPU, small"
  # The second scene does not fit the bindings that are pretended, and says so in a row.
  (eval "$mesa"; cargo xtask gpu --quick --scene city:5k --scene hair:40k --trees lbvh,bonsai_p --trace-up-to 20k \
    --rays camera,ao --binding-limit 2 --out out/ci-gpu)
  grep -q "needs bindings of" out/ci-gpu/csv/gpu-builds.csv
  # What fits was checked, and was measured afterwards.
  test "$(grep -c '^city:5k,.*,camera,closest,.*,0,$' out/ci-gpu/csv/gpu-rays.csv)" -ge 16
fi

step "frame times, small"
# A simulated device needs no Vulkan.
cargo xtask tune --quick --device geforce-580 --scene fairy:5000 --turn --out out/ci-tune-simulated
if [ "$setup" = 1 ]; then
  cargo xtask tune --quick --scene fairy:5000 --frames 6 --rank 1 --out out/ci-tune
  test -s out/ci-tune/device.toml
  cargo xtask tune --quick --renderer hybrid --scene gallery:3000 --frames 4 --rank 0 --controller both \
    --out out/ci-tune-hybrid
fi

step "power, from known truth"
cargo xtask power demo --frames 64 --out out/ci-power
if [ "$setup" = 1 ]; then
  step "power, the study without a meter"
  cargo xtask power study --quick --source none --out out/ci-power-study
fi

step "report, merged"
cargo xtask report out/ci-bench/results.json out/ci-thesis/results.json --out out/ci-report

step "stability, small"
# Peers take minutes on some cases, and are not what is tested here.
cargo xtask stability --quick --no-peers --out out/ci-stability

step "verification, small"
cargo xtask verify --quick --out out/ci-verify

# Real scenes when the machine has them: a folder of files that cargo xtask can load.
if [ -n "${NIWAKI_SCENES:-}" ] && [ -d "$NIWAKI_SCENES" ]; then
  step "verification, real scenes of NIWAKI_SCENES"
  cargo xtask verify --quick --no-hard-cases --scenes "$NIWAKI_SCENES" --out out/ci-verify-scenes
fi
step "passed"
