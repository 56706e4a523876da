//!import hybrid/depth
// The pyramid of least and greatest depths of the cube map's faces. A cell of level k covers 2^k by
// 2^k pixels; x is the least distance along the face's axis of its surfaces, y the greatest, their
// thickness included: a ray whose distances in the cell all lie below x or above y meets nothing
// there. Cells without a surface have the least above the greatest.
// Twin: reduce in the tests of crates/hybrid/src/pyramid.rs.

struct Reduction {
    // Levels that the dispatch makes, 1 to 4.
    levels: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
    // Array layers by the number of the workgroup along z.
    layers: array<vec4u, 3>,
}

@group(1) @binding(0) var<uniform> reduction: Reduction;
@group(1) @binding(1) var map_depth: texture_depth_2d_array;
@group(1) @binding(2) var map_surface: texture_2d_array<u32>;
// The level below, for levels above the fourth.
@group(1) @binding(3) var below: texture_2d_array<f32>;
@group(1) @binding(4) var first: texture_storage_2d_array<rg32float, write>;
@group(1) @binding(5) var second: texture_storage_2d_array<rg32float, write>;
@group(1) @binding(6) var third: texture_storage_2d_array<rg32float, write>;
@group(1) @binding(7) var fourth: texture_storage_2d_array<rg32float, write>;

const NO_RANGE = vec2f(NOWHERE, -NOWHERE);

var<workgroup> ranges: array<vec2f, 64>;

fn join(a: vec2f, b: vec2f) -> vec2f {
    return vec2f(min(a.x, b.x), max(a.y, b.y));
}

fn pixel_range(at: vec2u, layer: u32) -> vec2f {
    if any(at >= textureDimensions(map_depth)) {
        return NO_RANGE;
    }
    let z = textureLoad(map_depth, at, layer, 0);
    if z >= 1.0 {
        return NO_RANGE;
    }
    let w = linear_depth(z);
    let id = textureLoad(map_surface, at, layer, 0).z >> 16u;
    return vec2f(w, w + materials[id].thickness);
}

fn cell_range(at: vec2u, layer: u32) -> vec2f {
    if any(at >= textureDimensions(below)) {
        return NO_RANGE;
    }
    return textureLoad(below, at, layer, 0).xy;
}

// The 8 by 8 cells of the workgroup, whose first cell is `group` times 8, and three more levels from them.
fn reduce_on(own: vec2f, group: vec2u, thread: vec2u, layer: u32) {
    let own_cell = 8u * group + thread;
    if all(own_cell < textureDimensions(first)) {
        textureStore(first, own_cell, layer, vec4f(own, 0.0, 0.0));
    }
    let place = 8u * thread.y + thread.x;
    ranges[place] = own;
    for (var k = 1u; k < reduction.levels; k++) {
        workgroupBarrier();
        let side = 8u >> k;
        let stride = 1u << (k - 1u);
        let active_ = all(thread < vec2u(side));
        var range = NO_RANGE;
        if active_ {
            // Results of the level below stand `stride` apart.
            let corner = 2u * stride * thread;
            let first_place = 8u * corner.y + corner.x;
            range = join(
                join(ranges[first_place], ranges[first_place + stride]),
                join(ranges[first_place + 8u * stride], ranges[first_place + 9u * stride]),
            );
        }
        workgroupBarrier();
        if active_ {
            let corner = 2u * stride * thread;
            ranges[8u * corner.y + corner.x] = range;
            let cell = group * side + thread;
            let value = vec4f(range, 0.0, 0.0);
            if k == 1u && all(cell < textureDimensions(second)) {
                textureStore(second, cell, layer, value);
            } else if k == 2u && all(cell < textureDimensions(third)) {
                textureStore(third, cell, layer, value);
            } else if k == 3u && all(cell < textureDimensions(fourth)) {
                textureStore(fourth, cell, layer, value);
            }
        }
    }
}

// Levels 1 to 4, from the map.
@compute @workgroup_size(8, 8)
fn from_map(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let layer = reduction.layers[group.z >> 2u][group.z & 3u];
    let cell = 8u * group.xy + thread.xy;
    var range = NO_RANGE;
    for (var k = 0u; k < 4u; k++) {
        range = join(range, pixel_range(2u * cell + vec2u(k & 1u, k >> 1u), layer));
    }
    reduce_on(range, group.xy, thread.xy, layer);
}

// The next four levels, from the one below them.
@compute @workgroup_size(8, 8)
fn from_level(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) thread: vec3u) {
    let layer = reduction.layers[group.z >> 2u][group.z & 3u];
    let cell = 8u * group.xy + thread.xy;
    var range = NO_RANGE;
    for (var k = 0u; k < 4u; k++) {
        range = join(range, cell_range(2u * cell + vec2u(k & 1u, k >> 1u), layer));
    }
    reduce_on(range, group.xy, thread.xy, layer);
}
