//!import hybrid/scene
//!import frame/shading
// The shading model with the settings of a frame.

fn point_material(s: Surface) -> PointMaterial {
    return point_material_at(s, frame.mirror_roughness);
}

fn ambient_radiance(normal: vec3f) -> vec3f {
    return mix(frame.ambient_down, frame.ambient_up, 0.5 + 0.5 * normal.y);
}
