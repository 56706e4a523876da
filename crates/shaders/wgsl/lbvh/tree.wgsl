// The radix tree over sorted Morton codes: arrays and ranges (Karras 2012, section 3).
//
// Inner node `i` covers the places from or to `i`; node 0 is the root. Its first child ends at
// `split`, its second begins one after; a child that covers one place is that place's leaf, else it
// is the inner node of number `split` or `split + 1`.

// Arrays of `capacity` words each in `tree`: the other end of the node's range; the split, with
// T_IS_LEAF where the node became one leaf; the parent of the inner node; the parent of the leaf.
const T_OTHER = 0u;
const T_SPLIT = 1u;
const T_PARENT = 2u;
const T_LEAF_PARENT = 3u;

const T_IS_LEAF = 0x80000000u;
const T_PLACE = 0x7fffffffu;

// Arrays of `capacity` words each in `boxes`: smallest and largest coordinates as bits, and cost.
const B_COST = 6u;
// What a word of `boxes` holds until the first child brings its value: no value ever, as bounds are
// finite and costs have one NaN.
const B_EMPTY = 0xffffffffu;

// Arrays of `capacity` words each in `ranks`, see rank.wgsl.
const R_CLOSED = 0u;
const R_OPEN = 1u;
