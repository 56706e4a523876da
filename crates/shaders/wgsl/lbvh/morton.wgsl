// Morton codes of the primitives, in the order of the input: the bits of the quantised centroid,
// interleaved (Morton 1966; Lauterbach et al. 2009, section 3.1).
//!import lbvh/state
//!import lbvh/float

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> state: array<u32>;
@group(0) @binding(2) var<storage, read> prims: array<vec4<u32>>;
// Three arrays of `capacity` words each: lower 32 bits of the codes, upper bits, places in the input.
@group(0) @binding(3) var<storage, read_write> items: array<u32>;

// Puts two zero bits between the lowest 10 bits.
fn spread_10(v: u32) -> u32 {
    var x = (v | (v << 16u)) & 0x030000ffu;
    x = (x | (x << 8u)) & 0x0300f00fu;
    x = (x | (x << 4u)) & 0x030c30c3u;
    return (x | (x << 2u)) & 0x09249249u;
}

// Lower and upper 32 bits of the code whose bits are those of `cell` in turn, x in the highest.
fn interleave(cell: vec3<u32>) -> vec2<u32> {
    // 30 bits, 30 bits and 3 bits.
    let a = (spread_10(cell.x & 1023u) << 2u) | (spread_10(cell.y & 1023u) << 1u)
        | spread_10(cell.z & 1023u);
    let b = (spread_10((cell.x >> 10u) & 1023u) << 2u) | (spread_10((cell.y >> 10u) & 1023u) << 1u)
        | spread_10((cell.z >> 10u) & 1023u);
    let c = ((cell.x >> 20u) << 2u) | ((cell.y >> 20u) << 1u) | (cell.z >> 20u);
    return vec2<u32>(a | (b << 30u), (b >> 2u) | (c << 28u));
}

// The cell that a scaled coordinate (bits) lies in; the ends take what is outside, and NaN the first.
fn cell_of(f: u32) -> u32 {
    let last = state[S_LAST];
    if (!f_less(0u, f)) {
        return 0u;
    }
    return u32(bitcast<f32>(select(last, f, f_less(f, last))));
}

@compute @workgroup_size(256)
fn morton(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    f_opaque_zero = state[S_ZERO];
    let place = group_index(group, groups) * ELEMENT_THREADS + thread;
    if (place >= state[S_COUNT]) {
        return;
    }
    let low = prims[2u * place];
    let high = prims[2u * place + 1u];
    var cell = vec3<u32>(0u);
    for (var axis = 0u; axis < 3u; axis++) {
        let offset = f_sub(f_add(low[axis], high[axis]), state[S_LOW + axis]);
        cell[axis] = cell_of(f_mul(f_mul(offset, state[S_PRE]), state[S_SCALE + axis]));
    }
    let code = interleave(cell);
    items[place] = code.x;
    items[params.capacity + place] = code.y;
    items[2u * params.capacity + place] = place;
}
