// Prefix sums over the threads of a workgroup of TILE_THREADS. Two levels of serial sums: more reads
// than a tree of log2 steps, but two barriers instead of fourteen, and barriers are what costs.
//!import lbvh/state

const SCAN_RUN = 8u;
const SCAN_RUNS = 16u;

var<workgroup> scan_values: array<vec2<u32>, 128>;
var<workgroup> scan_runs: array<vec2<u32>, 16>;

struct Scan {
    // The sum over the threads before this one.
    before: vec2<u32>,
    // The sum over all.
    total: vec2<u32>,
}

fn scan_threads(value: vec2<u32>, thread: u32) -> Scan {
    scan_values[thread] = value;
    workgroupBarrier();
    if (thread < SCAN_RUNS) {
        var sum = vec2<u32>(0u);
        for (var i = 0u; i < SCAN_RUN; i++) {
            sum += scan_values[thread * SCAN_RUN + i];
        }
        scan_runs[thread] = sum;
    }
    workgroupBarrier();
    let run = thread / SCAN_RUN;
    var before = vec2<u32>(0u);
    var total = vec2<u32>(0u);
    for (var i = 0u; i < SCAN_RUNS; i++) {
        if (i == run) {
            before = total;
        }
        total += scan_runs[i];
    }
    for (var i = run * SCAN_RUN; i < thread; i++) {
        before += scan_values[i];
    }
    // For the next scan.
    workgroupBarrier();
    return Scan(before, total);
}
