// The driver's own ray tracing by a pipeline of three stages. There are no barycentrics without `RECOMPUTE`:
// they are an attribute of the hit, which the translator does not know.
//!import driver/enable_pipeline
//!import driver/common

/// Distance, as bits, and triangle.
var<ray_payload> outgoing: vec2u;
var<incoming_ray_payload> incoming: vec2u;

@ray_generation
fn generate(@builtin(ray_invocation_id) id: vec3u, @builtin(num_ray_invocations) size: vec3u) {
    let i = id.y * size.x + id.x;
    if i >= scene.rays {
        return;
    }
    let ray = ray_setup(scene, rays[2u * i], rays[2u * i + 1u]);
    outgoing = vec2u(0u, NO_PRIM);
    if scene.nodes != 0u && ray.is_usable {
        var mode = RAY_FLAG_FORCE_OPAQUE;
        if ANY {
            // Nothing runs for a hit, so that is what the payload says beforehand.
            outgoing.y = 0u;
            mode = RAY_FLAG_FORCE_OPAQUE | RAY_FLAG_TERMINATE_ON_FIRST_HIT | RAY_FLAG_SKIP_CLOSEST_HIT_SHADER;
        }
        traceRay(
            structure,
            RayDesc(mode, 0xffu, ray.t_min, ray.t_max, ray.origin, ray.direction),
            &outgoing,
        );
    }
    answer(i, ray, Hit(bitcast<f32>(outgoing.x), 0.0, 0.0, outgoing.y));
}

@miss
@incoming_payload(incoming)
fn missed() {
    incoming = vec2u(0u, NO_PRIM);
}

@closest_hit
@incoming_payload(incoming)
fn nearest(@builtin(ray_t_current_max) t: f32, @builtin(primitive_index) id: u32) {
    incoming = vec2u(bitcast<u32>(t), id);
}
