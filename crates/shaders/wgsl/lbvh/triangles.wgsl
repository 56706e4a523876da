// References to the triangles of a mesh: what the build starts from, as
// `niwaki_core::TriangleMesh::prim_refs` has them.
//!import lbvh/state
//!import lbvh/float

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> counts: array<u32>;
// Three numbers a vertex, as bits, and three vertices a triangle.
@group(0) @binding(2) var<storage, read> positions: array<u32>;
@group(0) @binding(3) var<storage, read> indices: array<u32>;
// Two a primitive: (min, id), (max, geometry), as bits.
@group(0) @binding(4) var<storage, read_write> prims: array<vec4<u32>>;

// The smaller of two coordinates; of equal ones, which may be zeros of either sign, the second.
fn least(a: u32, b: u32) -> u32 {
    return select(b, a, f_less(a, b));
}

fn most(a: u32, b: u32) -> u32 {
    return select(b, a, f_less(b, a));
}

// A vertex that is not there or not finite makes bounds that are NaN, which the build reports.
@compute @workgroup_size(256)
fn triangles(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let triangle = group_index(group, groups) * ELEMENT_THREADS + thread;
    if (triangle >= min(counts[params.count_word], params.capacity)) {
        return;
    }
    let vertices = arrayLength(&positions) / 3u;
    let a = indices[3u * triangle];
    let b = indices[3u * triangle + 1u];
    let c = indices[3u * triangle + 2u];
    var low = vec3<u32>(F_NAN);
    var high = vec3<u32>(F_NAN);
    if (max(a, max(b, c)) < vertices) {
        for (var axis = 0u; axis < 3u; axis++) {
            let x = positions[3u * a + axis];
            let y = positions[3u * b + axis];
            let z = positions[3u * c + axis];
            if (f_is_finite(x) && f_is_finite(y) && f_is_finite(z)) {
                low[axis] = least(least(x, y), z);
                high[axis] = most(most(x, y), z);
            }
        }
    }
    prims[2u * triangle] = vec4<u32>(low, triangle);
    prims[2u * triangle + 1u] = vec4<u32>(high, 0u);
}
