// Vertices of moving and bending objects at a point in time: the equations of
// niwaki_scene::animation::Morphed, then those of niwaki_scene::JointPose, then those of
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
    // Where its influences begin, or NO_SKIN.
    first_influence: u32,
    first_joint: u32,
    // Where the places of its differences begin in `starts`, or NO_TARGETS.
    first_start: u32,
    first_weight: u32,
    // How normals follow: BLENDED, FACETS or MIRRORED_FACETS.
    normals: u32,
    pad: u32,
}

// What a target adds to a vertex at weight 1.
struct Difference {
    position: vec3f,
    target_: u32,
    normal: vec3f,
    pad: u32,
}

// On which joints a vertex hangs: their numbers in its skin, two to a word, and their weights.
struct Influence {
    joints01: u32,
    joints23: u32,
    weight0: f32,
    weight1: f32,
    weight2: f32,
    weight3: f32,
}

struct Joint {
    row0: vec4f,
    row1: vec4f,
    row2: vec4f,
}

const NO_SKIN = 0xffffffffu;
const NO_TARGETS = 0xffffffffu;
const BLENDED = 0u;
const FACETS = 1u;

@group(0) @binding(0) var<storage, read> objects: array<Object>;
@group(0) @binding(1) var<storage, read> rest: array<Vertex>;
@group(0) @binding(2) var<storage, read_write> moved: array<Vertex>;
@group(0) @binding(3) var<storage, read> influences: array<Influence>;
@group(0) @binding(4) var<storage, read> joints: array<Joint>;
// Where the differences of each vertex begin and, in the next word, where they end.
@group(0) @binding(5) var<storage, read> starts: array<u32>;
@group(0) @binding(6) var<storage, read> differences: array<Difference>;
@group(0) @binding(7) var<storage, read> weights: array<f32>;

const TAU = 6.283185307179586;

// A joint by its weight; those of no weight do not count, whatever they hold.
fn pull(blend: Joint, joint: u32, weight: f32) -> Joint {
    if weight == 0.0 {
        return blend;
    }
    let j = joints[joint];
    return Joint(blend.row0 + j.row0 * weight, blend.row1 + j.row1 * weight,
                 blend.row2 + j.row2 * weight);
}

fn blend(influence: Influence, first: u32) -> Joint {
    var j = Joint(vec4f(0.0), vec4f(0.0), vec4f(0.0));
    j = pull(j, first + (influence.joints01 & 0xffffu), influence.weight0);
    j = pull(j, first + (influence.joints01 >> 16u), influence.weight1);
    j = pull(j, first + (influence.joints23 & 0xffffu), influence.weight2);
    j = pull(j, first + (influence.joints23 >> 16u), influence.weight3);
    return j;
}

// A direction by the cofactors of a transform, of unit length; n where there is none.
fn turned(a: vec3f, b: vec3f, c: vec3f, m: vec3f, n: vec3f) -> vec3f {
    return unit(vec3f(dot(cross(b, c), m), dot(cross(c, a), m), dot(cross(a, b), m)), n);
}

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
    return turned(pose.row0.xyz, pose.row1.xyz, pose.row2.xyz, m, n);
}

// Vertex k of an object with the weights of its targets.
fn morphed(object: Object, k: u32) -> vec3f {
    var p = rest[object.first + k].position;
    for (var i = starts[object.first_start + k]; i < starts[object.first_start + k + 1u]; i++) {
        p += differences[i].position * weights[object.first_weight + differences[i].target_];
    }
    return p;
}

// Its normal, given where it is.
fn morphed_normal(object: Object, k: u32) -> vec3f {
    let base = rest[object.first + k].normal;
    var n = base;
    for (var i = starts[object.first_start + k]; i < starts[object.first_start + k + 1u]; i++) {
        n += differences[i].normal * weights[object.first_weight + differences[i].target_];
    }
    n = unit(n, base);
    let first = k - k % 3u;
    if object.normals == BLENDED || first + 2u >= object.count {
        return n;
    }
    let a = morphed(object, first);
    let across = cross(morphed(object, first + 1u) - a, morphed(object, first + 2u) - a);
    return unit(select(-across, across, object.normals == FACETS), n);
}

// Of unit length; `n` where there is no length.
fn unit(t: vec3f, n: vec3f) -> vec3f {
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
            if object.first_start != NO_TARGETS {
                vertex.normal = morphed_normal(object, k);
                vertex.position = morphed(object, k);
            }
            if object.first_influence != NO_SKIN {
                let j = blend(influences[object.first_influence + k], object.first_joint);
                let h = vec4f(vertex.position, 1.0);
                let n = vertex.normal;
                vertex.normal = turned(j.row0.xyz, j.row1.xyz, j.row2.xyz, n, n);
                vertex.position = vec3f(dot(j.row0, h), dot(j.row1, h), dot(j.row2, h));
            }
            vertex.normal = turn(object.pose, vertex.position, vertex.normal);
            vertex.position = place(object.pose, vertex.position);
            moved[at] = vertex;
        }
    }
}
