// One pass of a stable radix sort, least significant digit first, 8 bits a pass, in three
// dispatches: digits are counted by tile, the counts become places, the tiles are scattered
// (reduce, then scan: Merrill and Grimshaw 2011, section 3). No workgroup waits for another, so it
// works on every device. What bounds it is bandwidth: a pass reads a digit's word, then reads and
// writes all words of an item once.
//!import lbvh/state
//!import lbvh/scan

@group(0) @binding(0) var<uniform> params: LbvhParams;
@group(0) @binding(1) var<storage, read> state: array<u32>;
// Three arrays of `capacity` words each: lower 32 bits of the keys, upper bits, values.
@group(0) @binding(2) var<storage, read> source: array<u32>;
@group(0) @binding(3) var<storage, read_write> target_items: array<u32>;
// For each digit one word a tile, then for each digit the total.
@group(0) @binding(4) var<storage, read_write> table: array<u32>;

const DIGITS = 256u;

// The word of an item that holds this pass's digit, by its array.
fn digit_array() -> u32 {
    return select(0u, params.capacity, params.shift >= 32u);
}

fn digit_of(word: u32) -> u32 {
    return (word >> (params.shift & 31u)) & 255u;
}

var<workgroup> histogram: array<atomic<u32>, 256>;

// Counts the digits of each tile.
@compute @workgroup_size(128)
fn count_digits(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let count = state[S_COUNT];
    let tiles = tile_count(count);
    let tile = group_index(group, groups);
    atomicStore(&histogram[thread], 0u);
    atomicStore(&histogram[thread + TILE_THREADS], 0u);
    workgroupBarrier();
    let from_word = digit_array() + tile * TILE;
    for (var i = 0u; i < TILE_ITEMS; i++) {
        let at = i * TILE_THREADS + thread;
        if (tile * TILE + at < count) {
            atomicAdd(&histogram[digit_of(source[from_word + at])], 1u);
        }
    }
    workgroupBarrier();
    if (tile < tiles) {
        table[thread * tiles + tile] = atomicLoad(&histogram[thread]);
        let second = thread + TILE_THREADS;
        table[second * tiles + tile] = atomicLoad(&histogram[second]);
    }
}

// Turns the counts of one digit, in all tiles, into sums over the tiles before; a workgroup a digit.
@compute @workgroup_size(128)
fn scan_digits(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let tiles = tile_count(state[S_COUNT]);
    let digit = group_index(group, groups);
    let row = digit * tiles;
    // Nothing for those that only fill the last row of workgroups.
    let end = select(0u, tiles, digit < DIGITS);
    var total = 0u;
    for (var first = 0u; first < end; first += 4u * TILE_THREADS) {
        let at = first + 4u * thread;
        var values = vec4<u32>(0u);
        for (var i = 0u; i < 4u; i++) {
            if (at + i < tiles) {
                values[i] = table[row + at + i];
            }
        }
        let scan = scan_threads(vec2<u32>(values.x + values.y + values.z + values.w, 0u), thread);
        var sum = total + scan.before.x;
        for (var i = 0u; i < 4u; i++) {
            if (at + i < tiles) {
                table[row + at + i] = sum;
            }
            sum += values[i];
        }
        total += scan.total.x;
    }
    if (thread == 0u && digit < DIGITS) {
        table[DIGITS * tiles + digit] = total;
    }
}

// Threads that rank their items together: as many as a word has bits.
const WAVE = 32u;
const WAVES = 4u;
// Parts of `pool`: for even and odd items a word for each wave and digit, whose bits are the threads
// with that digit; then for each wave and digit how many there were before.
const P_ODD = 1024u;
const P_SEEN = 2048u;

var<workgroup> pool: array<atomic<u32>, 3072>;
// For each digit where its items go, less where they stand in the sorted tile.
var<workgroup> targets: array<u32, 256>;

// Moves each tile to its places. Within the tile, items are ranked by bit masks in shared memory
// (as CUB's `WARP_MATCH_ATOMIC_OR`, but with barriers of the workgroup and thus for any subgroup
// size), then sorted there, so that neighbours are written together.
@compute @workgroup_size(128)
fn scatter(
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
    @builtin(local_invocation_index) thread: u32,
) {
    let count = state[S_COUNT];
    let tiles = tile_count(count);
    let tile = group_index(group, groups);
    let start = tile * TILE;
    for (var i = 0u; i < 24u; i++) {
        atomicStore(&pool[i * TILE_THREADS + thread], 0u);
    }
    workgroupBarrier();

    // Each wave ranks a run of items, 32 at a time.
    let wave = thread / WAVE;
    let lane_bit = 1u << (thread % WAVE);
    let run = start + wave * (WAVE * TILE_ITEMS) + thread % WAVE;
    let key_array = digit_array();
    // Rank in the run over digit.
    var ranks: array<u32, 16>;
    for (var i = 0u; i < TILE_ITEMS; i++) {
        let place = run + i * WAVE;
        let is_item = place < count;
        var digit = 0u;
        if (is_item) {
            digit = digit_of(source[key_array + place]);
        }
        let row = wave * DIGITS + digit;
        let mask = (i % 2u) * P_ODD + row;
        if (is_item) {
            atomicOr(&pool[mask], lane_bit);
        }
        workgroupBarrier();
        let peers = atomicLoad(&pool[mask]);
        let seen = atomicLoad(&pool[P_SEEN + row]);
        let before = peers & (lane_bit - 1u);
        ranks[i] = ((seen + countOneBits(before)) << 8u) | digit;
        workgroupBarrier();
        // The first of those with the digit clears the mask, which is used again after the next.
        if (is_item && before == 0u) {
            atomicStore(&pool[P_SEEN + row], seen + countOneBits(peers));
            atomicStore(&pool[mask], 0u);
        }
    }
    workgroupBarrier();

    // Two digits a thread: where each begins in the sorted tile and in the whole, and for each wave.
    let d = 2u * thread;
    var in_tile = vec2<u32>(0u);
    for (var w = 0u; w < WAVES; w++) {
        for (var k = 0u; k < 2u; k++) {
            let at = P_SEEN + w * DIGITS + d + k;
            let seen = atomicLoad(&pool[at]);
            atomicStore(&pool[at], in_tile[k]);
            in_tile[k] += seen;
        }
    }
    let totals = vec2<u32>(table[DIGITS * tiles + d], table[DIGITS * tiles + d + 1u]);
    let sums = vec2<u32>(in_tile.x + in_tile.y, totals.x + totals.y);
    let scan = scan_threads(sums, thread);
    let is_tile = tile < tiles;
    for (var k = 0u; k < 2u; k++) {
        let local_first = scan.before.x + select(0u, in_tile.x, k == 1u);
        let whole_first = scan.before.y + select(0u, totals.x, k == 1u);
        if (is_tile) {
            targets[d + k] = whole_first + table[(d + k) * tiles + tile] - local_first;
        }
        for (var w = 0u; w < WAVES; w++) {
            let at = P_SEEN + w * DIGITS + d + k;
            atomicStore(&pool[at], atomicLoad(&pool[at]) + local_first);
        }
    }
    workgroupBarrier();
    for (var i = 0u; i < TILE_ITEMS; i++) {
        let digit = ranks[i] & 255u;
        ranks[i] = (ranks[i] >> 8u) + atomicLoad(&pool[P_SEEN + wave * DIGITS + digit]);
    }

    // Word by word through shared memory, the word with the digit first.
    var places: array<u32, 16>;
    let words = select(2u, 3u, params.code_bits > 32u);
    for (var word = 0u; word < words; word++) {
        // With two words: key, value. With three: the digit's word, the other, value.
        var array_start = 2u * params.capacity;
        if (word == 0u) {
            array_start = key_array;
        } else if (word + 1u < words) {
            array_start = params.capacity - key_array;
        }
        for (var i = 0u; i < TILE_ITEMS; i++) {
            let place = run + i * WAVE;
            if (place < count) {
                atomicStore(&pool[ranks[i]], source[array_start + place]);
            }
        }
        workgroupBarrier();
        for (var i = 0u; i < TILE_ITEMS; i++) {
            let at = i * TILE_THREADS + thread;
            if (start + at < count) {
                let value = atomicLoad(&pool[at]);
                if (word == 0u) {
                    places[i] = targets[digit_of(value)] + at;
                }
                target_items[array_start + places[i]] = value;
            }
        }
        workgroupBarrier();
    }
}
