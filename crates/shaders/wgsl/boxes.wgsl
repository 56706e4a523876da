// Slab tests: of a box in full precision, and of the eight quantised boxes of a wide node.
// Twins: `boxes.rs` of niwaki-trace-vulkan.
//!import ray

/// Where the ray enters and leaves a box.
fn slab_test(slabs: Slabs, low: vec3f, high: vec3f, t_min: f32, t_max: f32) -> vec2f {
    let first = select(low, high, slabs.negative);
    let last = select(high, low, slabs.negative);
    // Either rounding does here: the offsets allow for both.
    let near = fma(first, slabs.inverse, slabs.near_offset);
    let far = fma(last, slabs.inverse, slabs.far_offset);
    return vec2f(
        max(max(t_min, near.x), max(near.y, near.z)),
        min(min(t_max, far.x), min(far.y, far.z)),
    );
}

/// A wide node in six rows of four words:
/// origin of the grid, and the masks of inner children (bits 0 to 7) and of used slots (8 to 15);
/// steps of the grid, and the first child node;
/// the first reference, counts of the leaves less one (3 bits a slot), and where a leaf begins
/// relative to the first reference (8 bits a slot, two words);
/// then a row an axis, of the smallest planes of eight slots and of the largest.
struct Node8 {
    origin: vec3f,
    masks: u32,
    step: vec3f,
    first_node: u32,
    leaves: vec4u,
    x: vec4u,
    y: vec4u,
    z: vec4u,
}

fn unpacked(word: u32) -> vec4f {
    return vec4f(
        f32(word & 0xffu),
        f32((word >> 8u) & 0xffu),
        f32((word >> 16u) & 0xffu),
        f32(word >> 24u),
    );
}

/// The slots whose boxes the ray meets between `t_min` and `t_max`, one bit each.
fn slots_met(slabs: Slabs, node: Node8, t_min: f32, t_max: f32) -> u32 {
    // A plane q is crossed at q·(step·r) + (origin·r + offset).
    let step = node.step * slabs.inverse;
    let near_offset = fma(node.origin, slabs.inverse, slabs.near_offset);
    let far_offset = fma(node.origin, slabs.inverse, slabs.far_offset);
    let low = four_met(t_min, t_max, step, near_offset, far_offset, slabs.negative,
        node.x.xz, node.y.xz, node.z.xz);
    let high = four_met(t_min, t_max, step, near_offset, far_offset, slabs.negative,
        node.x.yw, node.y.yw, node.z.yw);
    return (low | (high << 4u)) & (node.masks >> 8u);
}

/// The same of four slots, whose smallest and largest planes are given an axis each.
fn four_met(t_min: f32, t_max: f32, step: vec3f, near_offset: vec3f, far_offset: vec3f,
    negative: vec3<bool>, x: vec2u, y: vec2u, z: vec2u) -> u32 {
    let first_x = unpacked(select(x.x, x.y, negative.x));
    let first_y = unpacked(select(y.x, y.y, negative.y));
    let first_z = unpacked(select(z.x, z.y, negative.z));
    let last_x = unpacked(select(x.y, x.x, negative.x));
    let last_y = unpacked(select(y.y, y.x, negative.y));
    let last_z = unpacked(select(z.y, z.x, negative.z));
    let near_x = fma(first_x, vec4f(step.x), vec4f(near_offset.x));
    let near_y = fma(first_y, vec4f(step.y), vec4f(near_offset.y));
    let near_z = fma(first_z, vec4f(step.z), vec4f(near_offset.z));
    let far_x = fma(last_x, vec4f(step.x), vec4f(far_offset.x));
    let far_y = fma(last_y, vec4f(step.y), vec4f(far_offset.y));
    let far_z = fma(last_z, vec4f(step.z), vec4f(far_offset.z));
    let near = max(max(vec4f(t_min), near_x), max(near_y, near_z));
    let far = min(min(vec4f(t_max), far_x), min(far_y, far_z));
    let bits = select(vec4u(0u), vec4u(1u, 2u, 4u, 8u), near <= far);
    return bits.x | bits.y | bits.z | bits.w;
}
