// What both ways to the driver's own ray tracing have in common: bindings, and the answer to a ray. Modules
// that import this enable one of the two; by itself, this file is no module.
//!import triangle

/// Ends at the first hit, whichever it is.
override ANY: bool = false;
/// Distance and barycentrics of the triangle that the driver found are computed by our own test, so that they
/// have the bits of our kernels. Otherwise they are what the driver says.
override RECOMPUTE: bool = true;

/// `nodes` is 0 for an empty scene; nothing is scaled.
var<immediate> scene: Scene;
@group(0) @binding(0) var structure: acceleration_structure;
/// Two rows a ray.
@group(0) @binding(1) var<storage, read> rays: array<vec4f>;
/// One row a ray: t, u, v, id.
@group(0) @binding(2) var<storage, read_write> hits: array<vec4u>;
/// One word a ray: 1 if something is hit.
@group(0) @binding(3) var<storage, read_write> flags: array<u32>;
/// Three numbers a vertex.
@group(0) @binding(4) var<storage, read> positions: array<f32>;
/// Three vertices a triangle.
@group(0) @binding(5) var<storage, read> indices: array<u32>;

fn corner(reference: u32) -> vec3f {
    let i = 3u * indices[reference];
    return vec3f(positions[i], positions[i + 1u], positions[i + 2u]);
}

/// The driver's hit with our numbers.
fn recomputed(ray: Ray, found: Hit) -> Hit {
    let first = 3u * found.prim_id;
    let a = corner(first);
    let b = corner(first + 1u);
    let c = corner(first + 2u);
    let ours = met(test_of(ray), a, b, c);
    if ours.prim_id != NO_PRIM && ours.t >= ray.t_min && ours.t <= ray.t_max {
        return Hit(ours.t, ours.u, ours.v, found.prim_id);
    }
    // The driver rounds otherwise and hits where we miss: weights of the point that is nearest to its own.
    let e1 = b - a;
    let e2 = c - a;
    let p = ray.origin + found.t * ray.direction - a;
    let d11 = dot(e1, e1);
    let d12 = dot(e1, e2);
    let d22 = dot(e2, e2);
    let p1 = dot(p, e1);
    let p2 = dot(p, e2);
    let det = d11 * d22 - d12 * d12;
    var hit = found;
    if det > 0.0 {
        hit.u = clamp((d22 * p1 - d12 * p2) / det, 0.0, 1.0);
        hit.v = clamp((d11 * p2 - d12 * p1) / det, 0.0, 1.0 - hit.u);
    }
    return hit;
}

/// Writes what was found for ray `i`.
fn answer(i: u32, ray: Ray, found: Hit) {
    if ANY {
        flags[i] = select(1u, 0u, found.prim_id == NO_PRIM);
        return;
    }
    var hit = found;
    if RECOMPUTE && hit.prim_id != NO_PRIM {
        hit = recomputed(ray, hit);
    }
    hits[i] = finished(ray, hit);
}
