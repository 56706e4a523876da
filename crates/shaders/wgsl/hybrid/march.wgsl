//!import hybrid/linear
//!import hybrid/walk
// Rays in the cube map: following them through the depth of a face in its perspective space
// (Ganestam and Doggett 2014, section 3.4).

// From pixel to pixel instead of in steps.
override WALK: bool = false;

// Follows the line origin + t direction, both in clip space of the face, from t_start to where it
// hits or leaves.
// `ray` is its direction in the world.
fn march(
    face: u32,
    origin: vec4f,
    direction: vec4f,
    t_start: f32,
    ray: vec3f,
) -> MarchResult {
    var r = MarchResult(MAP_FAR, t_start, vec2f(0.0), 0.0, vec2u(0u), 0u, false, 0u, 0u);
    // Clipped before the division by w: no point behind the centre is ever projected.
    var t0 = t_start;
    var t1 = INFINITE;
    for (var k = 0u; k < 6u; k++) {
        var a = origin.w;
        var b = direction.w;
        if k < 4u {
            let sign = select(-1.0, 1.0, (k & 1u) == 1u);
            a += sign * origin[k >> 1u];
            b += sign * direction[k >> 1u];
        } else if k == 4u {
            a = origin.z;
            b = direction.z;
        } else {
            a -= origin.z;
            b -= direction.z;
        }
        if b < 0.0 {
            let t = -a / b;
            if t < t1 {
                t1 = t;
                r.outcome = select(MAP_FAR, MAP_SIDE + k, k < 4u);
                if k == 4u {
                    r.outcome = MAP_NEAR;
                }
            }
        } else if b > 0.0 {
            t0 = max(t0, -a / b);
        }
    }
    t1 = max(t1, t_start);
    r.t = t1;
    if !(t0 < t1) || t1 >= INFINITE || (frame.face_mask & (1u << face)) == 0u {
        return r;
    }
    let p0 = origin + t0 * direction;
    let p1 = origin + t1 * direction;
    let i0 = 1.0 / p0.w;
    let i1 = 1.0 / p1.w;
    let a = p0.xyz * i0;
    let b = p1.xyz * i1;
    let delta = b - a;
    let line = Line(face, a.xy, b.xy, i0, i1, t0 * i0, t1 * i1);
    if WALK {
        return walk(line, ray, r);
    }
    return march_linear(line, delta, ray, r);
}
