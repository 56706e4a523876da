// All inner nodes at once, each from its own position in the order (Karras 2012, section 3).
//!import lbvh/state
//!import lbvh/tree

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> state: array<u32>;
@group(0) @binding(2) var<storage, read> items: array<u32>;
@group(0) @binding(3) var<storage, read_write> tree: array<u32>;
@group(0) @binding(4) var<storage, read_write> boxes: array<u32>;
@group(0) @binding(5) var<storage, read_write> ranks: array<u32>;

struct Code {
    low: u32,
    high: u32,
}

fn code_at(place: u32) -> Code {
    var high = 0u;
    if (params.code_bits > 32u) {
        high = items[params.capacity + place];
    }
    return Code(items[place], high);
}

// Length of the common prefix of two places' codes, which go on with the places where they are
// equal; -1 outside of the order.
fn common_prefix(code: Code, i: u32, j: u32, count: u32) -> i32 {
    // A place before the first wraps around.
    if (j >= count) {
        return -1;
    }
    let other = code_at(j);
    if (code.high != other.high) {
        return i32(countLeadingZeros(code.high ^ other.high));
    }
    if (code.low != other.low) {
        return 32 + i32(countLeadingZeros(code.low ^ other.low));
    }
    return 64 + i32(countLeadingZeros(i ^ j));
}

@compute @workgroup_size(256)
fn hierarchy(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let i = group_index(group, groups) * ELEMENT_THREADS + thread;
    let count = state[S_COUNT];
    let stride = params.capacity;
    if (i >= count) {
        return;
    }
    // What later stages count and fill in.
    ranks[R_CLOSED * stride + i] = 0u;
    ranks[R_OPEN * stride + i] = 0u;
    for (var word = 0u; word <= B_COST; word++) {
        boxes[word * stride + i] = B_EMPTY;
    }
    if (i == 0u) {
        tree[T_PARENT * stride] = S_NONE;
        if (count == 1u) {
            tree[T_LEAF_PARENT * stride] = S_NONE;
        }
    }
    if (i + 1u >= count) {
        return;
    }

    let code = code_at(i);
    let after = common_prefix(code, i, i + 1u, count);
    let before = common_prefix(code, i, i - 1u, count);
    // The direction in which the range grows, by wrapping addition.
    let up = after > before;
    let step_one = select(0xffffffffu, 1u, up);
    let behind = min(after, before);
    // All places of the node share more than the place behind does.
    var bound = 2u;
    while (common_prefix(code, i, i + bound * step_one, count) > behind) {
        bound *= 2u;
    }
    var extent = 0u;
    for (var step = bound / 2u; step > 0u; step /= 2u) {
        if (common_prefix(code, i, i + (extent + step) * step_one, count) > behind) {
            extent += step;
        }
    }
    let other = i + extent * step_one;
    // The places of the half at this end share more than the whole.
    let whole = common_prefix(code, i, other, count);
    var half = 0u;
    var step = extent;
    loop {
        step = (step + 1u) / 2u;
        if (common_prefix(code, i, i + (half + step) * step_one, count) > whole) {
            half += step;
        }
        if (step <= 1u) {
            break;
        }
    }
    let first = min(i, other);
    let last = max(i, other);
    let split = select(i - half - 1u, i + half, up);

    tree[T_OTHER * stride + i] = other;
    tree[T_SPLIT * stride + i] = split;
    let left = select(T_PARENT, T_LEAF_PARENT, split == first);
    tree[left * stride + split] = i;
    let right = select(T_PARENT, T_LEAF_PARENT, split + 1u == last);
    tree[right * stride + split + 1u] = i;
}
