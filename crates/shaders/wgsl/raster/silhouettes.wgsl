//!import frame/surfaces
// Shadow volumes of any triangles, closed or not (Crow 1977; the count at edges after Bergeron 1986,
// "A general version of Crow's shadow volumes").
//
// Each triangle that a light may reach casts the volume behind it, oriented towards the light. The
// walls of two triangles cancel where they share an edge in opposite directions; what is left of an
// edge is the sum of its triangles' directions, which is 0 inside a surface, 1 or -1 at a border,
// 2 or -2 at an outline of a closed mesh, and any number where more triangles meet.
//
// A closed part of the mesh (a solid) casts the same shadow from one side alone: then triangles of the
// other side count 0, and its outlines 1 or -1.

struct Caster {
    // Relative to the position: world to clip space of the light's map.
    matrix: mat4x4f,
    position: vec3f,
    range: f32,
    triangles: u32,
    edges: u32,
    pad0: u32,
    pad1: u32,
}

struct Edge {
    // Vertices; the lower number first.
    a: u32,
    b: u32,
    // Its triangles in `incidences`.
    first: u32,
    count: u32,
}

@group(1) @binding(0) var<uniform> caster: Caster;
@group(1) @binding(1) var<storage, read> edges: array<Edge>;
// A triangle and, in the lowest bit, 1 if it has the edge from b to a.
@group(1) @binding(2) var<storage, read> incidences: array<u32>;
// The number of each triangle's solid times 4 (0 if it is of none), and in the lowest bits 1 more than
// what it counts: 1 if it faces the light, -1 if its back does, 0 if no light reaches it or its solid
// casts from the other side.
@group(1) @binding(3) var<storage, read_write> facings: array<u32>;
// Corners of triangles that face the light, and of those that turn their back.
@group(1) @binding(4) var<storage, read_write> fronts: array<u32>;
@group(1) @binding(5) var<storage, read_write> backs: array<u32>;
// Edges to be extruded, each as often as it counts.
@group(1) @binding(6) var<storage, read_write> walls: array<vec2u>;
// Arguments of three draws; the counters are words 0 (indices of `fronts`), 5 (indices of `backs`)
// and 10 (vertices of walls). From `SIDES` on the side from which each solid casts: 1 or -1 as triangles
// count, 0 for both. (Devices need not have more storage buffers than these for a shader.)
@group(1) @binding(7) var<storage, read_write> draws: array<atomic<u32>>;

const GROUP = 64u;
const SIDES = 16u;

var<workgroup> front_count: atomic<u32>;
var<workgroup> back_count: atomic<u32>;
var<workgroup> front_first: u32;
var<workgroup> back_first: u32;

fn place(triangle: u32, k: u32) -> vec3f {
    return vertices[indices[3u * triangle + k]].position - caster.position;
}

// No light can reach a triangle that lies beyond one side of the light's pyramid, behind the light
// or out of its range.
fn beyond(a: vec3f, b: vec3f, c: vec3f) -> bool {
    let p = caster.matrix * vec4f(a, 1.0);
    let q = caster.matrix * vec4f(b, 1.0);
    let r = caster.matrix * vec4f(c, 1.0);
    let x = vec3f(p.x, q.x, r.x);
    let y = vec3f(p.y, q.y, r.y);
    let w = vec3f(p.w, q.w, r.w);
    return all(w <= vec3f(0.0)) || all(w >= vec3f(caster.range))
        || all(x > w) || all(x < -w) || all(y > w) || all(y < -w);
}

fn facing(triangle: u32) -> i32 {
    let a = place(triangle, 0u);
    let b = place(triangle, 1u);
    let c = place(triangle, 2u);
    if beyond(a, b, c) {
        return 0;
    }
    let n = cross(b - a, c - a);
    let side = -dot(n, a);
    // Triangles without area have volumes without space.
    if !(abs(side) > 0.0) {
        return 0;
    }
    return select(-1, 1, side > 0.0);
}

@compute @workgroup_size(GROUP)
fn classify(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    for (var first = group.x * GROUP; first < caster.triangles; first += groups.x * GROUP) {
        let triangle = first + thread;
        var code = 0;
        if triangle < caster.triangles {
            code = facing(triangle);
            let solid = facings[triangle] >> 2u;
            if solid > 0u && code * bitcast<i32>(atomicLoad(&draws[SIDES + solid - 1u])) < 0 {
                code = 0;
            }
            facings[triangle] = (solid << 2u) | u32(code + 1);
        }
        // One place in the lists for the group, so that few threads wait for each other.
        if thread == 0u {
            atomicStore(&front_count, 0u);
            atomicStore(&back_count, 0u);
        }
        workgroupBarrier();
        var at = 0u;
        if code > 0 {
            at = atomicAdd(&front_count, 3u);
        } else if code < 0 {
            at = atomicAdd(&back_count, 3u);
        }
        workgroupBarrier();
        if thread == 0u {
            front_first = atomicAdd(&draws[0], atomicLoad(&front_count));
            back_first = atomicAdd(&draws[5], atomicLoad(&back_count));
        }
        workgroupBarrier();
        if code > 0 {
            at += front_first;
            fronts[at] = indices[3u * triangle];
            fronts[at + 1u] = indices[3u * triangle + 1u];
            fronts[at + 2u] = indices[3u * triangle + 2u];
        } else if code < 0 {
            at += back_first;
            backs[at] = indices[3u * triangle];
            backs[at + 1u] = indices[3u * triangle + 1u];
            backs[at + 2u] = indices[3u * triangle + 2u];
        }
        workgroupBarrier();
    }
}

@compute @workgroup_size(GROUP)
fn silhouettes(
    @builtin(workgroup_id) group: vec3u,
    @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32,
) {
    for (var first = group.x * GROUP; first < caster.edges; first += groups.x * GROUP) {
        let number = first + thread;
        var sum = 0;
        var edge = Edge();
        if number < caster.edges {
            edge = edges[number];
            for (var k = 0u; k < edge.count; k++) {
                let incidence = incidences[edge.first + k];
                let code = i32(facings[incidence >> 1u] & 3u) - 1;
                sum += select(code, -code, (incidence & 1u) != 0u);
            }
        }
        if thread == 0u {
            atomicStore(&front_count, 0u);
        }
        workgroupBarrier();
        var at = 0u;
        let times = u32(abs(sum));
        if times > 0u {
            at = atomicAdd(&front_count, times);
        }
        workgroupBarrier();
        if thread == 0u {
            // Six vertices a wall.
            front_first = atomicAdd(&draws[10], 6u * atomicLoad(&front_count)) / 6u;
        }
        workgroupBarrier();
        let wall = select(vec2u(edge.b, edge.a), vec2u(edge.a, edge.b), sum > 0);
        for (var k = 0u; k < times; k++) {
            walls[front_first + at + k] = wall;
        }
        workgroupBarrier();
    }
}
