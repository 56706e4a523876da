// Where nodes go: depth first with siblings adjacent, as `niwaki_core::layout` has them, found by
// prefix sums instead of a walk.
//
// The pair of an inner node's children stands at 1 + 2 * (inner nodes before it, depth first).
// Before node v over places first ..= last are those wholly on its left and its ancestors. Each node
// but leaves has its own split, between two places. The nodes wholly on the left, and the
// ancestors that have v on the right, are those that split before `first`: C(first) of them. The
// ancestors that have v on the left are the nodes whose left part covers `last`: none below v does.
// A left part begins at its node's first place and ends at its split, so E(last), the parts begun
// up to `last` less those ended before it, counts them. Nodes inside of merged leaves do not count.
//!import lbvh/state
//!import lbvh/scan
//!import lbvh/tree

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read_write> state: array<u32>;
// For each place: R_CLOSED, 1 if it is the split of an inner node, then C; R_OPEN, the number of
// inner nodes that begin there, then E.
@group(0) @binding(2) var<storage, read_write> ranks: array<u32>;
// Sums of both for each tile.
@group(0) @binding(3) var<storage, read_write> table: array<u32>;

// The words of a place; zeros after the last.
fn words_at(place: u32, count: u32) -> vec2<u32> {
    if (place >= count) {
        return vec2<u32>(0u);
    }
    return vec2<u32>(
        ranks[R_CLOSED * params.capacity + place],
        ranks[R_OPEN * params.capacity + place],
    );
}

// Sums each tile.
@compute @workgroup_size(128)
fn sum_tiles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let count = state[S_COUNT];
    let tile = group_index(group, groups);
    var sum = vec2<u32>(0u);
    for (var i = 0u; i < TILE_ITEMS; i++) {
        sum += words_at(tile * TILE + i * TILE_THREADS + thread, count);
    }
    let scan = scan_threads(sum, thread);
    if (thread == 0u && tile < tile_count(count)) {
        table[2u * tile] = scan.total.x;
        table[2u * tile + 1u] = scan.total.y;
    }
}

// Turns the sums of tiles into those of the tiles before, in one workgroup.
@compute @workgroup_size(128)
fn scan_tiles(@builtin(local_invocation_index) thread: u32) {
    let tiles = tile_count(state[S_COUNT]);
    var total = vec2<u32>(0u);
    for (var first = 0u; first < tiles; first += TILE_THREADS) {
        let tile = first + thread;
        var value = vec2<u32>(0u);
        if (tile < tiles) {
            value = vec2<u32>(table[2u * tile], table[2u * tile + 1u]);
        }
        let scan = scan_threads(value, thread);
        if (tile < tiles) {
            table[2u * tile] = total.x + scan.before.x;
            table[2u * tile + 1u] = total.y + scan.before.y;
        }
        total += scan.total;
    }
    if (thread == 0u) {
        state[S_NODES] = 1u + 2u * total.x;
    }
}

// Finishes C and E. A thread takes neighbours, whose words share cache lines, so that one scan over
// the threads does.
@compute @workgroup_size(128)
fn scan_places(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let count = state[S_COUNT];
    let tile = group_index(group, groups);
    let first = tile * TILE + thread * TILE_ITEMS;
    var sum = vec2<u32>(0u);
    for (var i = 0u; i < TILE_ITEMS; i++) {
        sum += words_at(first + i, count);
    }
    var before = scan_threads(sum, thread).before;
    if (tile < tile_count(count)) {
        before += vec2<u32>(table[2u * tile], table[2u * tile + 1u]);
    }
    for (var i = 0u; i < TILE_ITEMS; i++) {
        let place = first + i;
        if (place >= count) {
            break;
        }
        let words = words_at(place, count);
        ranks[R_CLOSED * params.capacity + place] = before.x;
        ranks[R_OPEN * params.capacity + place] = before.y + words.y - before.x;
        before += words;
    }
}
