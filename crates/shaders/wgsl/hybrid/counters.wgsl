// Counts of what kernels did, 64 bits each in two words. The numbers are those of the fields of
// `niwaki_hybrid::Counters`, in order.

@group(1) @binding(11) var<storage, read_write> counters: array<atomic<u32>>;

const C_PRIMARY = 0u;
const C_SPAWNING = 1u;
const C_REFLECTED = 2u;
const C_REFRACTED = 3u;
const C_CONTINUED = 4u;
const C_SHADOW = 5u;
const C_TREE = 6u;
const C_FACES = 7u;
const C_SAMPLES = 8u;
const C_HOPS = 9u;
const C_RETURNS = 10u;
const C_TREE_HITS = 11u;
const C_MAP_HITS = 12u;
const C_SKY = 13u;
const C_BEHIND = 14u;
const C_CUT = 15u;
const C_CELLS = 16u;
const C_SECOND = 17u;
const C_OCCLUSION = 18u;

fn count(which: u32, n: u32) {
    if n == 0u {
        return;
    }
    let before = atomicAdd(&counters[2u * which], n);
    if before + n < before {
        atomicAdd(&counters[2u * which + 1u], 1u);
    }
}
