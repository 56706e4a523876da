//!import hybrid/occlusion
// What surfaces send back of the light of lamps and of all around.

// What a surface sends back along a ray of direction `d`, reflected and refracted rays aside.
fn shade(s: Surface, d: vec3f) -> vec3f {
    let m = point_material(s);
    let to_viewer = -d;
    let cosine = clamp(dot(s.normal, to_viewer), 0.0, 1.0);
    var ambient = ambient_radiance(s.normal) * ambient_weight(m, cosine);
    if OCCLUSION {
        // Where no ambient light counts, no ray is worth it; the directions are drawn all the same.
        if any(ambient > vec3f(0.0)) {
            ambient *= open_surroundings(s);
        } else {
            occlusion_first += frame.occlusion_rays;
        }
    }
    var sum = s.emission + ambient;
    for (var i = 0u; i < frame.light_count; i++) {
        let light = lights[i];
        let lit = illuminate(light, s.point);
        if all(lit.irradiance <= vec3f(0.0)) {
            continue;
        }
        let f = direct_weight(m, s.normal, to_viewer, lit.direction);
        if all(f <= vec3f(0.0)) || !(dot(s.geometric, lit.direction) > 0.0) {
            continue;
        }
        let share = visibility(s, light, lit);
        if share > 0.0 {
            sum += f * lit.irradiance * share;
        }
    }
    return sum;
}
