// The entry points of the traversal kernels. Modules that import this define
// `traverse(ray: Ray, before: Hit, start: vec2u) -> Hit`: the nearest of `before` and what the ray hits, from
// `start` on (`progress` in tracing.wgsl), with `suspended` set if it ran out of steps. By itself, this file
// is no module.
//!import tracing

/// Where workgroups of the persistent kernels take the next rays from.
var<workgroup> taken: u32;

/// Rays that a workgroup takes at once, a ray of each invocation at a time.
const TURNS: u32 = 4;

fn trace_ray(i: u32) {
    var start = vec2u(FRESH, 0u);
    if BUDGET != 0u {
        start = progress[i];
        if start.x == DONE {
            return;
        }
        if steps >= BUDGET {
            atomicAdd(&pending, 1u);
            return;
        }
    }
    let ray = ray_setup(scene, rays[2u * i], rays[2u * i + 1u]);
    var hit = Hit(ray.t_max, 0.0, 0.0, NO_PRIM);
    if COUNT {
        counts = vec4u(0u);
    }
    if BUDGET != 0u && start.x != FRESH {
        if !ANY {
            // In scaled distance, as it was left.
            let row = hits[i];
            hit = Hit(bitcast<f32>(row.x), bitcast<f32>(row.y), bitcast<f32>(row.z), row.w);
        }
        if COUNT {
            counts = work[i];
        }
    }
    suspended = vec2u(DONE, 0u);
    if scene.nodes != 0u && ray.is_usable {
        hit = traverse(ray, hit, start);
    }
    if COUNT {
        work[i] = counts;
    }
    if BUDGET != 0u {
        progress[i] = suspended;
        if suspended.x != DONE {
            atomicAdd(&pending, 1u);
            if !ANY {
                hits[i] = vec4u(bitcast<u32>(hit.t), bitcast<u32>(hit.u), bitcast<u32>(hit.v), hit.prim_id);
            }
            return;
        }
    }
    if ANY {
        flags[i] = select(1u, 0u, hit.prim_id == NO_PRIM);
    } else {
        hits[i] = finished(ray, hit);
    }
}

/// One ray an invocation.
@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u) {
    steps = 0u;
    let i = id.y * groups.x * WORKGROUP + id.x;
    if i < scene.rays {
        trace_ray(i);
    }
}

/// A fixed number of workgroups, each of which takes rays until there are none (Aila and Laine 2009,
/// section 3.3).
@compute @workgroup_size(WORKGROUP)
fn persistent(@builtin(local_invocation_index) local: u32) {
    steps = 0u;
    let share = WORKGROUP * TURNS;
    loop {
        if local == 0u {
            taken = atomicAdd(&next_ray, share);
        }
        let first = workgroupUniformLoad(&taken);
        // Rays are fewer than 2³² by more than all workgroups take in vain.
        if first >= scene.rays {
            break;
        }
        for (var i = first + local; i < min(first + share, scene.rays); i += WORKGROUP) {
            trace_ray(i);
        }
    }
}
