// Loads that need nothing of each other, 16 a turn: how fast they leave a core, and how fast the
// memory answers all of them.

override WORKGROUP: u32 = 64;

struct Params {
    /// Turns of the loop.
    turns: u32,
    /// Elements less one, a power of two less one.
    mask: u32,
    /// Where in the memory to begin, an element.
    start: u32,
}
var<immediate> params: Params;
@group(0) @binding(0) var<storage, read> words: array<u32>;
@group(0) @binding(1) var<storage, read> rows: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> results: array<u32>;

/// The threads of a workgroup read words that lie side by side.
@compute @workgroup_size(WORKGROUP)
fn coalesced(@builtin(global_invocation_id) id: vec3u) {
    var at = params.start + id.x;
    var sum = 0u;
    for (var i = 0u; i < params.turns; i++) {
        for (var j = 0u; j < 4u; j++) {
            sum += words[at & params.mask];
            sum += words[(at + WORKGROUP) & params.mask];
            sum += words[(at + 2u * WORKGROUP) & params.mask];
            sum += words[(at + 3u * WORKGROUP) & params.mask];
            at += 4u * WORKGROUP;
        }
    }
    if sum == 1u {
        results[0] = sum;
    }
}

/// Every thread reads words that are at least 128 bytes from those of all others, in no order.
@compute @workgroup_size(WORKGROUP)
fn uncoalesced(@builtin(global_invocation_id) id: vec3u) {
    // Odd factors make a permutation of the lines.
    var at = (params.start + id.x) * 0x9e3779b1u;
    var sum = 0u;
    for (var i = 0u; i < params.turns; i++) {
        for (var j = 0u; j < 4u; j++) {
            sum += words[(at << 5u) & params.mask];
            sum += words[((at + 0x85ebca6bu) << 5u) & params.mask];
            sum += words[((at + 0x0bd794d6u) << 5u) & params.mask];
            sum += words[((at + 0x91c35f41u) << 5u) & params.mask];
            at += 0x17af29acu;
        }
    }
    if sum == 1u {
        results[0] = sum;
    }
}

/// All threads of all cores read 16 bytes each, side by side.
@compute @workgroup_size(WORKGROUP)
fn bandwidth(
    @builtin(global_invocation_id) id: vec3u,
    @builtin(num_workgroups) groups: vec3u,
) {
    let all = groups.x * WORKGROUP;
    var at = params.start + id.x;
    var sum = vec4u(0u);
    for (var i = 0u; i < params.turns; i++) {
        for (var j = 0u; j < 4u; j++) {
            sum += rows[at & params.mask];
            sum += rows[(at + all) & params.mask];
            sum += rows[(at + 2u * all) & params.mask];
            sum += rows[(at + 3u * all) & params.mask];
            at += 4u * all;
        }
    }
    if sum.x + sum.y + sum.z + sum.w == 1u {
        results[0] = sum.x;
    }
}
