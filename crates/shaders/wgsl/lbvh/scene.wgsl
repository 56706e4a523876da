// What traversal needs beside the nodes: triangles in the order of the leaves, and parents.
//!import lbvh/state

@group(0) @binding(0) var<storage, read> state: array<u32>;
@group(0) @binding(1) var<storage, read> prim_ids: array<u32>;
// Two a node: (min, first), (max, count).
@group(0) @binding(2) var<storage, read> nodes: array<vec4<u32>>;
// Three numbers a vertex, as bits, and three vertices a triangle.
@group(0) @binding(3) var<storage, read> positions: array<u32>;
@group(0) @binding(4) var<storage, read> indices: array<u32>;
// Three rows a triangle: a corner and the triangle's id.
@group(0) @binding(5) var<storage, read_write> rows: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read_write> parents: array<u32>;

fn link(node: u32) {
    if (node < state[S_NODES] && nodes[2u * node + 1u].w == 0u) {
        let child = nodes[2u * node].w;
        parents[child] = node;
        parents[child + 1u] = node;
    }
}

@compute @workgroup_size(256)
fn arrange(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let place = group_index(group, groups) * ELEMENT_THREADS + thread;
    let count = state[S_COUNT];
    if (place >= count) {
        return;
    }
    let id = prim_ids[place];
    for (var corner = 0u; corner < 3u; corner++) {
        let at = 3u * indices[3u * id + corner];
        rows[3u * place + corner] = vec4<u32>(positions[at], positions[at + 1u], positions[at + 2u], id);
    }
    // There are fewer than two nodes a place.
    link(place);
    link(count + place);
    if (place == 0u) {
        parents[0] = 0u;
    }
}
