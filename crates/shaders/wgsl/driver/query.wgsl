// The driver's own ray tracing by ray queries: one ray an invocation.
//!import driver/enable_query
//!import driver/common

/// Invocations of a workgroup.
override WORKGROUP: u32 = 64;

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    let i = id.y * groups.x * WORKGROUP + id.x;
    if i >= scene.rays {
        return;
    }
    let ray = ray_setup(scene, rays[2u * i], rays[2u * i + 1u]);
    var hit = Hit(ray.t_max, 0.0, 0.0, NO_PRIM);
    if scene.nodes != 0u && ray.is_usable {
        var mode = RAY_FLAG_FORCE_OPAQUE;
        if ANY {
            mode = RAY_FLAG_FORCE_OPAQUE | RAY_FLAG_TERMINATE_ON_FIRST_HIT;
        }
        var query: ray_query;
        rayQueryInitialize(
            &query,
            structure,
            RayDesc(mode, 0xffu, ray.t_min, ray.t_max, ray.origin, ray.direction),
        );
        // Everything is opaque, so nothing has to be decided here.
        while rayQueryProceed(&query) {
        }
        let found = rayQueryGetCommittedIntersection(&query);
        if found.kind == RAY_QUERY_INTERSECTION_TRIANGLE {
            hit = Hit(found.t, found.barycentrics.x, found.barycentrics.y, found.primitive_index);
        }
    }
    answer(i, ray, hit);
}
