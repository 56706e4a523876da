//! The arithmetic of `lbvh/float.wgsl` is that of the CPU, bit for bit.

mod common;

use common::{assert_silent, device};
use niwaki_shaders::{Library, Options};

/// For each pair of operands: sum, product, quotient, the first as a count, and comparisons; then sum
/// and product in integers alone.
const CALCULATE: &str = "
//!import lbvh/float
@group(0) @binding(0) var<storage, read> operands: array<vec2u>;
@group(0) @binding(1) var<storage, read_write> results: array<u32>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&operands) { return; }
    let x = operands[id.x];
    let at = 8 * id.x;
    results[at] = f_add(x.x, x.y);
    results[at + 1] = f_mul(x.x, x.y);
    results[at + 2] = f_div(x.x, x.y);
    results[at + 3] = f_from_u32(x.x);
    results[at + 4] = u32(f_less(x.x, x.y));
    results[at + 5] = u32(f_at_most(x.x, x.y));
    results[at + 6] = f_add_soft(x.x, x.y);
    results[at + 7] = f_mul_soft(x.x, x.y);
}
";

/// The bits, with one NaN.
fn bits(x: f32) -> u32 {
    if x.is_nan() { 0x7fc0_0000 } else { x.to_bits() }
}

#[test]
fn arithmetic_is_that_of_the_cpu() {
    let Some(device) = device() else { return };
    let mut library = Library::embedded();
    library.insert("calculate", CALCULATE);
    let shader = library.compile("calculate", "main", &Options::default()).unwrap();
    let kernel = device.kernel_of(&shader).unwrap();

    // Ends of ranges with each other, then random bits of any and of neighbouring exponents.
    let ends = [
        0.0_f32,
        1.0,
        1.0 + f32::EPSILON,
        1.5,
        f32::MAX,
        f32::MIN_POSITIVE,
        f32::from_bits(1),
        f32::from_bits(0x007f_ffff),
        2.0_f32.powi(-100),
        2.0_f32.powi(-63),
        2.0_f32.powi(63),
        16_777_216.0,
        16_777_217.0,
        1.0 / 3.0,
        f32::INFINITY,
        f32::NAN,
    ];
    let ends: Vec<u32> = ends.iter().flat_map(|x| [x.to_bits(), (-x).to_bits()]).collect();
    let mut operands: Vec<[u32; 2]> =
        ends.iter().flat_map(|&a| ends.iter().map(move |&b| [a, b])).collect();
    let mut random = fastrand::Rng::with_seed(1);
    for _ in 0..100_000 {
        let (a, b) = (random.u32(..), random.u32(..));
        let near = (a & 0x7f80_0000).wrapping_add(random.u32(0..60) << 23).wrapping_sub(30 << 23);
        operands.push([a, b]);
        operands.push([a, b & 0x807f_ffff | near & 0x7f80_0000]);
        // About the reciprocal's exponent, where products turn subnormal or overflow.
        let inverse = 0x3f80_0000_u32.wrapping_sub(a & 0x7f80_0000);
        let shifted = inverse.wrapping_add(random.u32(0..8) << 23).wrapping_sub(129 << 23);
        operands.push([a, b & 0x807f_ffff | shifted & 0x7f80_0000]);
    }

    let source = device.upload(&operands).unwrap();
    let target = device.buffer(32 * operands.len() as u64).unwrap();
    let groups = device.info().groups_for(operands.len() as u64, 64);
    let mut batch = device.batch().unwrap();
    batch.dispatch(&kernel, &[&source, &target], &(), groups).unwrap();
    batch.submit().unwrap();
    let found = target.read::<[u32; 8]>().unwrap();
    for (&[a, b], found) in operands.iter().zip(&found) {
        let [x, y] = [a, b].map(f32::from_bits);
        let (sum, product) = (bits(x + y), bits(x * y));
        let expected = [
            sum,
            product,
            bits(x / y),
            bits(a as f32),
            u32::from(x < y),
            u32::from(x <= y),
            sum,
            product,
        ];
        // A NaN that comes in may keep its bits.
        let found =
            found.map(|word| if word & 0x7fff_ffff > 0x7f80_0000 { 0x7fc0_0000 } else { word });
        assert_eq!(found, expected, "{x:e} {y:e} ({a:#x} {b:#x})");
    }
    assert_silent(&device);
}
