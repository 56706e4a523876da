// Which triangles of the objects that meet the near region meet it themselves (Ganestam and Doggett
// 2014, section 3.3): their boxes, appended for the builder of the tree.

struct Cull {
    low: vec3f,
    // Room in `prims`.
    capacity: u32,
    high: vec3f,
    pad: u32,
}

struct Vertex {
    position: vec3f,
    u: f32,
    normal: vec3f,
    v: f32,
}

@group(0) @binding(0) var<uniform> cull_box: Cull;
// First triangle and number of triangles of each object.
@group(0) @binding(1) var<storage, read> ranges: array<vec2u>;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> indices: array<u32>;
@group(0) @binding(4) var<storage, read_write> counts: array<atomic<u32>>;
// Two a primitive: (min, triangle), (max, 0), as bits.
@group(0) @binding(5) var<storage, read_write> prims: array<vec4u>;

var<workgroup> group_count: atomic<u32>;
var<workgroup> group_first: u32;

fn finite(v: vec3f) -> bool {
    return all((bitcast<vec3u>(v) & vec3u(0x7f800000u)) != vec3u(0x7f800000u));
}

@compute @workgroup_size(256)
fn cull(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    for (var i = group.y; i < arrayLength(&ranges); i += groups.y) {
        let range = ranges[i];
        for (var first = group.x * 256u; first < range.y; first += groups.x * 256u) {
            var low = vec3f(0.0);
            var high = vec3f(0.0);
            let triangle = range.x + first + thread;
            var is_near = false;
            if first + thread < range.y {
                let a = vertices[indices[3u * triangle]].position;
                let b = vertices[indices[3u * triangle + 1u]].position;
                let c = vertices[indices[3u * triangle + 2u]].position;
                low = min(a, min(b, c));
                high = max(a, max(b, c));
                is_near = all(low <= cull_box.high) && all(high >= cull_box.low)
                    && finite(low) && finite(high);
            }
            // One place in the list for the group, so that few threads wait for each other.
            if thread == 0u {
                atomicStore(&group_count, 0u);
            }
            workgroupBarrier();
            var at = 0u;
            if is_near {
                at = atomicAdd(&group_count, 1u);
            }
            workgroupBarrier();
            if thread == 0u {
                group_first = atomicAdd(&counts[0], atomicLoad(&group_count));
            }
            workgroupBarrier();
            at += group_first;
            if is_near && at < cull_box.capacity {
                prims[2u * at] = vec4u(bitcast<vec3u>(low), triangle);
                prims[2u * at + 1u] = vec4u(bitcast<vec3u>(high), 0u);
            }
            workgroupBarrier();
        }
    }
}
