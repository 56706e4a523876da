// Bounds of all primitives and of their centroids, and what follows from them: the record of a
// build, and how many workgroups its stages take.
//!import lbvh/state
//!import lbvh/float

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
// Two a primitive: (min, id), (max, geometry), as bits.
@group(0) @binding(2) var<storage, read> prims: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read_write> state: array<atomic<u32>>;
@group(0) @binding(4) var<storage, read_write> args: array<u32>;

// Workgroups along an axis at most: what every device allows.
override max_groups: u32 = 65535u;

fn write_args(triple: u32, groups: u32) {
    let rows = (groups + max_groups - 1u) / max_groups;
    args[3u * triple] = (groups + max(rows, 1u) - 1u) / max(rows, 1u);
    args[3u * triple + 1u] = rows;
    args[3u * triple + 2u] = 1u;
}

// Begins a build: clears the record and sizes the check of the input.
@compute @workgroup_size(1)
fn begin() {
    let requested = counts[params.count_word];
    let fits = requested <= params.capacity;
    let count = select(0u, requested, fits);
    for (var word = 0u; word < S_WORDS; word++) {
        atomicStore(&state[word], 0u);
    }
    atomicStore(&state[S_COUNT], count);
    atomicStore(&state[S_REQUESTED], requested);
    atomicStore(&state[S_BAD], S_NONE);
    for (var axis = 0u; axis < 3u; axis++) {
        atomicStore(&state[S_BOUNDS + axis], 0xffffffffu);
        atomicStore(&state[S_CENTROIDS + axis], 0xffffffffu);
    }
    write_args(A_CHECK, tile_count(count));
}

// Per thread: the bounds as sortable bits, smallest before largest, then those of the centroids.
var<workgroup> shared_bounds: array<u32, 1536>;

fn is_good(low: vec4<u32>, high: vec4<u32>) -> bool {
    var good = true;
    for (var axis = 0u; axis < 3u; axis++) {
        good = good && f_is_finite(low[axis]) && f_is_finite(high[axis]);
        good = good && f_at_most(low[axis], high[axis]);
    }
    return good;
}

@compute @workgroup_size(128)
fn bounds(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    f_opaque_zero = atomicLoad(&state[S_ZERO]);
    let count = atomicLoad(&state[S_COUNT]);
    let first = group_index(group, groups) * TILE;
    var least = vec3<u32>(0xffffffffu);
    var most = vec3<u32>(0u);
    var least2 = vec3<u32>(0xffffffffu);
    var most2 = vec3<u32>(0u);
    for (var i = 0u; i < TILE_ITEMS; i++) {
        let place = first + i * TILE_THREADS + thread;
        if (place >= count) {
            break;
        }
        let low = prims[2u * place];
        let high = prims[2u * place + 1u];
        if (!is_good(low, high)) {
            atomicMin(&state[S_BAD], place);
            continue;
        }
        for (var axis = 0u; axis < 3u; axis++) {
            let sum = f_sortable(f_add(low[axis], high[axis]));
            least[axis] = min(least[axis], f_sortable(low[axis]));
            most[axis] = max(most[axis], f_sortable(high[axis]));
            least2[axis] = min(least2[axis], sum);
            most2[axis] = max(most2[axis], sum);
        }
    }
    for (var axis = 0u; axis < 3u; axis++) {
        shared_bounds[axis * TILE_THREADS + thread] = least[axis];
        shared_bounds[(3u + axis) * TILE_THREADS + thread] = most[axis];
        shared_bounds[(6u + axis) * TILE_THREADS + thread] = least2[axis];
        shared_bounds[(9u + axis) * TILE_THREADS + thread] = most2[axis];
    }
    for (var half = TILE_THREADS / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if (thread < half) {
            for (var word = 0u; word < 12u; word++) {
                let at = word * TILE_THREADS + thread;
                let a = shared_bounds[at];
                let b = shared_bounds[at + half];
                shared_bounds[at] = select(max(a, b), min(a, b), word % 6u < 3u);
            }
        }
    }
    workgroupBarrier();
    if (thread < 12u) {
        let value = shared_bounds[thread * TILE_THREADS];
        if (thread % 6u < 3u) {
            atomicMin(&state[S_BOUNDS + thread], value);
        } else {
            atomicMax(&state[S_BOUNDS + thread], value);
        }
    }
}

// Edge lengths of a box whose sortable bits begin at `word`.
fn extent(word: u32) -> vec3<u32> {
    var result = vec3<u32>(0u);
    for (var axis = 0u; axis < 3u; axis++) {
        let low = f_from_sortable(atomicLoad(&state[word + axis]));
        let high = f_from_sortable(atomicLoad(&state[word + 3u + axis]));
        result[axis] = f_sub(high, low);
    }
    return result;
}

fn larger(a: u32, b: u32) -> u32 {
    return select(b, a, f_less(b, a));
}

// The power of two that brings the longest edge near 1 if it is not from 2^-20 to 2^30; else 1.
fn area_scale(edges: vec3<u32>) -> u32 {
    let longest = larger(edges.x, larger(edges.y, edges.z));
    if (!f_less(0u, longest) || (longest >= 0x35800000u && longest <= 0x4e800000u)) {
        return F_ONE;
    }
    let exponent = i32(longest >> 23u) - 127;
    return u32(clamp(-exponent, -126, 126) + 127) << 23u;
}

// Ends the check: settles what primitives are quantised by, and sizes all other stages.
@compute @workgroup_size(1)
fn settle() {
    f_opaque_zero = atomicLoad(&state[S_ZERO]);
    let is_bad = atomicLoad(&state[S_BAD]) != S_NONE;
    let count = select(atomicLoad(&state[S_COUNT]), 0u, is_bad);
    atomicStore(&state[S_COUNT], count);
    write_args(A_ELEMENTS, (count + ELEMENT_THREADS - 1u) / ELEMENT_THREADS);
    write_args(A_TILES, tile_count(count));
    write_args(A_DIGITS, select(0u, 256u, count > 0u));
    write_args(A_ONE, select(0u, 1u, count > 0u));
    if (count == 0u) {
        return;
    }
    atomicStore(&state[S_AREA_SCALE], area_scale(extent(S_BOUNDS)));
    let edges = extent(S_CENTROIDS);
    let pre = area_scale(edges);
    let cells = f_from_u32(1u << (params.code_bits / 3u));
    for (var axis = 0u; axis < 3u; axis++) {
        let low = f_from_sortable(atomicLoad(&state[S_CENTROIDS + axis]));
        atomicStore(&state[S_LOW + axis], low);
        let edge = f_mul(edges[axis], pre);
        let scale = f_div(cells, edge);
        let is_good = f_less(0u, edge) && f_is_finite(scale);
        atomicStore(&state[S_SCALE + axis], select(0u, scale, is_good));
    }
    atomicStore(&state[S_PRE], pre);
    atomicStore(&state[S_LAST], f_from_u32((1u << (params.code_bits / 3u)) - 1u));
}
