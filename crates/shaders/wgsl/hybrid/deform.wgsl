// Vertices of moving and bending objects at a point in time: the equations of
// niwaki_scene::ObjectPose, one row of workgroups an object.

struct Vertex {
    position: vec3f,
    u: f32,
    normal: vec3f,
    v: f32,
}

struct Pose {
    row0: vec4f,
    row1: vec4f,
    row2: vec4f,
    displacement: vec4f,
    wave: vec4f,
    hold: vec4f,
}

struct Object {
    pose: Pose,
    first: u32,
    count: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<storage, read> objects: array<Object>;
@group(0) @binding(1) var<storage, read> rest: array<Vertex>;
@group(0) @binding(2) var<storage, read_write> moved: array<Vertex>;

const TAU = 6.283185307179586;

fn place(pose: Pose, p: vec3f) -> vec3f {
    var q = p;
    let s = clamp(dot(pose.hold, vec4f(p, 1.0)), 0.0, 1.0);
    let turns = dot(pose.wave, vec4f(p, 1.0));
    q += pose.displacement.xyz * (s * s * sin((turns - floor(turns)) * TAU));
    let h = vec4f(q, 1.0);
    return vec3f(dot(pose.row0, h), dot(pose.row1, h), dot(pose.row2, h));
}

fn turn(pose: Pose, p: vec3f, n: vec3f) -> vec3f {
    let s = clamp(dot(pose.hold, vec4f(p, 1.0)), 0.0, 1.0);
    let turns = dot(pose.wave, vec4f(p, 1.0));
    let angle = (turns - floor(turns)) * TAU;
    var g = pose.wave.xyz * (TAU * s * s * cos(angle));
    if s > 0.0 && s < 1.0 {
        g += pose.hold.xyz * (2.0 * s * sin(angle));
    }
    let d = pose.displacement.xyz;
    let m = n - g * (dot(d, n) / (1.0 + dot(d, g)));
    let a = pose.row0.xyz;
    let b = pose.row1.xyz;
    let c = pose.row2.xyz;
    let t = vec3f(dot(cross(b, c), m), dot(cross(c, a), m), dot(cross(a, b), m));
    let length_squared = dot(t, t);
    return select(n, t * inverseSqrt(length_squared), length_squared > 0.0);
}

@compute @workgroup_size(64)
fn deform(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    for (var i = id.y; i < arrayLength(&objects); i += groups.y) {
        let object = objects[i];
        for (var k = id.x; k < object.count; k += groups.x * 64u) {
            let at = object.first + k;
            var vertex = rest[at];
            vertex.normal = turn(object.pose, vertex.position, vertex.normal);
            vertex.position = place(object.pose, vertex.position);
            moved[at] = vertex;
        }
    }
}
