// Traversal of 8-wide trees of quantised nodes, 96 bytes each (`Node8` in boxes.wgsl), after Ylitie,
// Karras and Laine 2017: what waits is not a node but the rest of a group of siblings, so the stack has
// an entry a level, and the order of siblings is that of their slots, seen from the octant of the ray.
//!import drive

/// Groups that wait, a power of two. Beyond, the oldest is forgotten and found again by way of the
/// parents.
const STACK: u32 = 32;

fn node_at(i: u32) -> Node8 {
    let a = node_row(i, 6u, 0u);
    let b = node_row(i, 6u, 1u);
    return Node8(
        bitcast<vec3f>(a.xyz), a.w, bitcast<vec3f>(b.xyz), b.w,
        node_row(i, 6u, 2u), node_row(i, 6u, 3u), node_row(i, 6u, 4u), node_row(i, 6u, 5u),
    );
}

/// Bit i of the mask at place i ^ octant.
fn by_octant(mask: u32, octant: u32) -> u32 {
    var m = mask;
    m = select(m, ((m & 0x55u) << 1u) | ((m >> 1u) & 0x55u), (octant & 1u) != 0u);
    m = select(m, ((m & 0x33u) << 2u) | ((m >> 2u) & 0x33u), (octant & 2u) != 0u);
    return select(m, ((m & 0x0fu) << 4u) | ((m >> 4u) & 0x0fu), (octant & 4u) != 0u);
}

fn traverse(ray: Ray, before: Hit, start: vec2u) -> Hit {
    var hit = before;
    let slabs = slabs_of(scene, ray);
    let test = test_of(ray);
    // Slot 0 is the lower corner, which a ray with a positive direction meets first.
    let bits = select(vec3u(1u, 2u, 4u), vec3u(0u), slabs.negative);
    let octant = bits.x | bits.y | bits.z;
    var index = 0u;
    // All that waited is forgotten in a ray that goes on.
    var has_forgotten = false;
    var is_climbing = false;
    if start.x != FRESH {
        has_forgotten = true;
        is_climbing = (start.x & CLIMBING) != 0u;
        index = start.x & ~CLIMBING;
    }
    // A ring: `waiting` entries end at `top`. An entry is the first sibling, the mask of those that wait,
    // in order, and the mask of inner slots.
    var stack: array<vec2u, STACK>;
    var top = 0u;
    var waiting = 0u;
    loop {
        var group = vec2u(0u);
        if !is_climbing {
            if !may_step() {
                suspended = vec2u(index, 0u);
                return hit;
            }
            let node = node_at(index);
            let inner = node.masks & 0xffu;
            count(1u, countOneBits((node.masks >> 8u) & 0xffu), 0u, 0u);
            let met = slots_met(slabs, node, ray.t_min, hit.t);
            var leaves = by_octant(met & ~inner, octant);
            while leaves != 0u {
                let place = firstLeadingBit(leaves);
                leaves ^= 1u << place;
                let slot = place ^ octant;
                if BUDGET != 0u {
                    steps += 8u;
                }
                let n = ((node.leaves.y >> (3u * slot)) & 7u) + 1u;
                let word = select(node.leaves.w, node.leaves.z, slot < 4u);
                let first = node.leaves.x + ((word >> (8u * (slot & 3u))) & 0xffu);
                hit = leaf_hit(test, ray.t_min, first, n, hit);
                if ANY && hit.prim_id != NO_PRIM {
                    return hit;
                }
            }
            group = vec2u(node.first_node, by_octant(met & inner, octant) | (inner << 8u));
        }
        if (group.y & 0xffu) == 0u && waiting > 0u {
            top--;
            waiting--;
            group = stack[top % STACK];
        }
        if DEEP && has_forgotten {
            // The entries that are left are done, so what was forgotten is above: the slots of a parent
            // that come after that of its child.
            while (group.y & 0xffu) == 0u && index != 0u {
                if !may_step() {
                    suspended = vec2u(index | CLIMBING, 0u);
                    return hit;
                }
                let link = parents[index];
                index = link >> 3u;
                let parent = node_at(index);
                let siblings = parent.masks & 0xffu;
                count(1u, countOneBits((parent.masks >> 8u) & 0xffu), 0u, 0u);
                let met_now = slots_met(slabs, parent, ray.t_min, hit.t);
                let rest = (1u << ((link & 7u) ^ octant)) - 1u;
                group = vec2u(
                    parent.first_node,
                    (by_octant(met_now & siblings, octant) & rest) | (siblings << 8u),
                );
            }
        }
        if (group.y & 0xffu) == 0u {
            return hit;
        }
        is_climbing = false;
        let place = firstLeadingBit(group.y & 0xffu);
        group.y ^= 1u << place;
        if (group.y & 0xffu) != 0u {
            stack[top % STACK] = group;
            top++;
            if waiting < STACK {
                waiting++;
            } else {
                has_forgotten = true;
            }
        }
        let below = (group.y >> 8u) & ((1u << (place ^ octant)) - 1u);
        index = group.x + countOneBits(below);
    }
    return hit;
}

