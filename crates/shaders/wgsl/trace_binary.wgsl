// Traversal of binary trees, whose nodes are `niwaki_core::BvhNode` as they are: the box in the first
// three words of two rows, the first child or reference in the last word of the first, the number of
// references in that of the second.
//!import drive

/// Nodes that wait, a power of two. Beyond, the oldest is forgotten and found again by way of the
/// parents.
const STACK: u32 = 64;

fn traverse(ray: Ray, before: Hit, start: vec2u) -> Hit {
    var hit = before;
    let slabs = slabs_of(scene, ray);
    let test = test_of(ray);
    // The node at hand, its first child or reference, how many of the latter, and how many of those are done.
    var index = 0u;
    var skip = 0u;
    // All that waited is forgotten in a ray that goes on.
    var has_forgotten = false;
    var is_climbing = false;
    if start.x != FRESH {
        has_forgotten = true;
        is_climbing = (start.x & CLIMBING) != 0u;
        index = start.x & ~CLIMBING;
        skip = start.y;
    }
    let low = node_row(index, 2u, 0u);
    let high = node_row(index, 2u, 1u);
    if start.x == FRESH {
        count(0u, 1u, 0u, 0u);
        let ends = slab_test(slabs, bitcast<vec3f>(low.xyz), bitcast<vec3f>(high.xyz), ray.t_min, hit.t);
        if ends.x > ends.y {
            return hit;
        }
    }
    var first = low.w;
    var n = high.w;
    // A ring: `waiting` entries end at `top`.
    var stack: array<vec2u, STACK>;
    var top = 0u;
    var waiting = 0u;
    loop {
        if is_climbing {
            // Nothing waits.
        } else if !may_step() {
            suspended = vec2u(index, skip);
            return hit;
        } else if n == 0u {
            let a_low = node_row(first, 2u, 0u);
            let a_high = node_row(first, 2u, 1u);
            let b_low = node_row(first + 1u, 2u, 0u);
            let b_high = node_row(first + 1u, 2u, 1u);
            count(1u, 2u, 0u, 0u);
            let a = slab_test(slabs, bitcast<vec3f>(a_low.xyz), bitcast<vec3f>(a_high.xyz), ray.t_min, hit.t);
            let b = slab_test(slabs, bitcast<vec3f>(b_low.xyz), bitcast<vec3f>(b_high.xyz), ray.t_min, hit.t);
            let meets_a = a.x <= a.y;
            let meets_b = b.x <= b.y;
            if meets_a || meets_b {
                let a_first = meets_a && (!meets_b || a.x <= b.x);
                if meets_a && meets_b {
                    let far = first + select(0u, 1u, a_first);
                    stack[top % STACK] = vec2u(far, bitcast<u32>(max(a.x, b.x)));
                    top++;
                    if waiting < STACK {
                        waiting++;
                    } else {
                        has_forgotten = true;
                    }
                }
                index = first + select(1u, 0u, a_first);
                first = select(b_low.w, a_low.w, a_first);
                n = select(b_high.w, a_high.w, a_first);
                continue;
            }
        } else {
            var m = n - skip;
            if BUDGET != 0u {
                m = min(m, max(BUDGET - steps, 1u));
                steps += m;
            }
            hit = leaf_hit(test, ray.t_min, first + skip, m, hit);
            skip += m;
            if ANY && hit.prim_id != NO_PRIM {
                return hit;
            }
            if BUDGET != 0u && skip < n {
                suspended = vec2u(index, skip);
                return hit;
            }
            skip = 0u;
        }
        var is_found = false;
        while waiting > 0u && !is_found {
            top--;
            waiting--;
            let entry = stack[top % STACK];
            // Boxes at the same distance as the hit may hold one with a smaller id.
            if bitcast<f32>(entry.y) <= hit.t {
                index = entry.x;
                is_found = true;
            }
        }
        if DEEP && has_forgotten {
            // All that is nearer than what was forgotten is done, so it is found on the way up: a far child whose
            // near sibling was just finished. Where a ray enters boxes does not depend on the hit, so the order is that of
            // the way down (Hapala et al. 2011).
            while index != 0u && !is_found {
                if !may_step() {
                    suspended = vec2u(index | CLIMBING, 0u);
                    return hit;
                }
                let parent = parents[index];
                let child = node_row(parent, 2u, 0u).w;
                let a_low = node_row(child, 2u, 0u);
                let a_high = node_row(child, 2u, 1u);
                let b_low = node_row(child + 1u, 2u, 0u);
                let b_high = node_row(child + 1u, 2u, 1u);
                count(1u, 2u, 0u, 0u);
                let a = slab_test(slabs, bitcast<vec3f>(a_low.xyz), bitcast<vec3f>(a_high.xyz), ray.t_min, hit.t);
                let b = slab_test(slabs, bitcast<vec3f>(b_low.xyz), bitcast<vec3f>(b_high.xyz), ray.t_min, hit.t);
                let a_first = a.x <= b.x;
                let is_a = index == child;
                let sibling = select(a, b, is_a);
                if is_a == a_first && sibling.x <= sibling.y {
                    index = child + select(0u, 1u, is_a);
                    is_found = true;
                } else {
                    index = parent;
                }
            }
        }
        if !is_found {
            return hit;
        }
        is_climbing = false;
        first = node_row(index, 2u, 0u).w;
        n = node_row(index, 2u, 1u).w;
    }
    return hit;
}

