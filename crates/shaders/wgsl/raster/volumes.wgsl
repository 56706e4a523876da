// Drawing shadow volumes into the stencil buffer: caps and walls, without a far plane.

struct View {
    // Relative to the eye.
    matrix: mat4x4f,
    eye: vec3f,
    pad: f32,
}

struct Vertex {
    position: vec3f,
    u: f32,
    normal: vec3f,
    v: f32,
}

struct Origin {
    light: vec3f,
    pad: f32,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<uniform> origin: Origin;
@group(0) @binding(2) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(3) var<storage, read> walls: array<vec2u>;

struct Corner {
    // As scenes are drawn, so that a cap has the depth of the triangle that casts it.
    @invariant @builtin(position) clip: vec4f,
}

fn near_corner(position: vec3f) -> vec4f {
    return view.matrix * vec4f(position - view.eye, 1.0);
}

// Infinitely far behind a point.
fn far_corner(position: vec3f) -> vec4f {
    return view.matrix * vec4f(position - origin.light, 0.0);
}

@vertex
fn near_main(@location(0) position: vec3f) -> Corner {
    return Corner(near_corner(position));
}

@vertex
fn far_main(@location(0) position: vec3f) -> Corner {
    return Corner(far_corner(position));
}

// A wall from an edge a, b of a triangle, whose corners are in order as seen from the light: b, a,
// and both at infinity.
@vertex
fn wall_main(@builtin(vertex_index) i: u32) -> Corner {
    let edge = walls[i / 6u];
    let a = vertices[edge.x].position;
    let b = vertices[edge.y].position;
    switch i % 6u {
        case 0u, 3u: { return Corner(near_corner(b)); }
        case 1u: { return Corner(near_corner(a)); }
        case 2u, 4u: { return Corner(far_corner(a)); }
        default: { return Corner(far_corner(b)); }
    }
}
