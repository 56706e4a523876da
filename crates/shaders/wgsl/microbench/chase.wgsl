// Latency: each load's address is the value of the one before.

struct Params {
    /// Loads, a multiple of 8.
    loads: u32,
}
var<immediate> params: Params;
/// One cycle over all elements.
@group(0) @binding(0) var<storage, read> next: array<u32>;
/// Where to begin; where it ended, so that the next run finds elements that no cache has.
@group(0) @binding(1) var<storage, read_write> position: array<u32>;

@compute @workgroup_size(1)
fn main() {
    var p = position[0];
    for (var i = 0u; i < params.loads; i += 8u) {
        p = next[p];
        p = next[p];
        p = next[p];
        p = next[p];
        p = next[p];
        p = next[p];
        p = next[p];
        p = next[p];
    }
    position[0] = p;
}
