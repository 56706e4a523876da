//! Functions of the shaders against their twins in Rust: bit for bit.

mod common;

use bytemuck::{Pod, Zeroable};
use common::{assert_silent, device};
use niwaki_shaders::{Library, Options};
use niwaki_trace_vulkan::{Device, Tracer};

/// Runs `body` for each row of input, which is `x`; it assigns `y`.
fn run<A: Pod, B: Pod>(device: &Device, import: &'static str, body: &str, input: &[A]) -> Vec<B> {
    let mut library = Library::embedded();
    let (rows_in, rows_out) = (size_of::<A>() / 16, size_of::<B>() / 16);
    let text = format!(
        "//!import {import}
        @group(0) @binding(0) var<storage, read> xs: array<array<vec4f, {rows_in}>>;
        @group(0) @binding(1) var<storage, read_write> ys: array<array<vec4f, {rows_out}>>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{
            if id.x < arrayLength(&xs) {{
                let x = xs[id.x];
                var y: array<vec4f, {rows_out}>;
                {body}
                ys[id.x] = y;
            }}
        }}"
    );
    library.insert("twin", text);
    let tracer = Tracer::new(device).unwrap();
    let fused = [("FUSED", f64::from(u8::from(tracer.is_fused())))];
    let options = Options { constants: &fused, ..Options::default() };
    let kernel = device.kernel_of(&library.compile("twin", "main", &options).unwrap()).unwrap();
    let (xs, ys) = (
        device.upload(input).unwrap(),
        device.buffer((input.len() * size_of::<B>()) as u64).unwrap(),
    );
    let mut batch = device.batch().unwrap();
    let groups = device.info().groups_for(input.len() as u64, 64);
    batch.dispatch(&kernel, &[&xs, &ys], &(), groups).unwrap();
    batch.submit().unwrap();
    let mut output = vec![B::zeroed(); input.len()];
    ys.read_into(&mut output).unwrap();
    output
}

/// Numbers of both signs from 2⁻²⁰ to 2²⁰, some of which differ in the last bits only.
fn number(rng: &mut fastrand::Rng) -> f32 {
    let x = match rng.u8(0..4) {
        0 => 1.0 + f32::EPSILON * rng.i32(-4..5) as f32,
        _ => (rng.f32() + 0.5) * 2.0_f32.powi(rng.i32(-20..20)),
    };
    if rng.bool() { x } else { -x }
}

#[test]
fn multiply_adds_round_once() {
    let Some(device) = device() else { return };
    let mut rng = fastrand::Rng::with_seed(1);
    let input: Vec<[f32; 4]> = (0..100_000)
        .map(|_| {
            let (a, b) = (number(&mut rng), number(&mut rng));
            // Half of them cancel.
            let c = if rng.bool() { number(&mut rng) } else { -a * b };
            [a, b, c, 0.0]
        })
        .collect();
    let body = "y[0] = vec4f(
        madd(x[0].x, x[0].y, x[0].z), divide(x[0].x, x[0].y),
        product_error(x[0].x, x[0].y, x[0].x * x[0].y), 0.0);";
    let output: Vec<[f32; 4]> = run(&device, "float", body, &input);
    let mut wrong = 0;
    for ([a, b, c, _], [sum, quotient, error, _]) in input.into_iter().zip(output) {
        assert_eq!(error, a.mul_add(b, -(a * b)), "{a} {b}");
        let (exact, exact_quotient) = (a.mul_add(b, c), a / b);
        let near = |x: f32, y: f32| (x - y).abs() <= y.abs() * f32::EPSILON;
        assert!(near(sum, exact), "{a}·{b} + {c} = {exact}, not {sum}");
        assert!(near(quotient, exact_quotient), "{a} / {b} = {exact_quotient}, not {quotient}");
        wrong += usize::from(sum != exact) + usize::from(quotient != exact_quotient);
    }
    // Twice rounded at the middle between two numbers.
    assert!(wrong <= 10, "{wrong} of 200,000");
    assert_silent(&device);
}

#[test]
fn powers_of_two_scale_numbers_of_any_size() {
    let Some(device) = device() else { return };
    let mut rng = fastrand::Rng::with_seed(2);
    let input: Vec<[f32; 4]> = (0..10_000)
        .map(|_| {
            let x = f32::from_bits(rng.u32(..));
            let x = if x.is_finite() { x } else { 1.0 };
            [x, rng.i32(-300..300) as f32, 0.0, 0.0]
        })
        .collect();
    let body = "y[0] = vec4f(scaled_by(x[0].x, i32(x[0].y)), f32(exponent_of(x[0].x)), 0.0, 0.0);";
    let output: Vec<[f32; 4]> = run(&device, "float", body, &input);
    for ([x, power, ..], [scaled, exponent, ..]) in input.into_iter().zip(output) {
        let exact = f64::from(x) * 2.0_f64.powf(f64::from(power));
        // Denormal results may be rounded on the way, or be 0.
        if exact == 0.0 || exact.abs() >= f64::from(f32::MIN_POSITIVE) {
            let is_exact = f64::from(scaled) == exact;
            let is_over = exact.abs() > f64::from(f32::MAX) && scaled.is_infinite();
            assert!(is_exact || is_over, "{x:e}·2^{power} = {scaled:e}");
        } else {
            let tiny = f64::from(f32::MIN_POSITIVE);
            assert!((f64::from(scaled) - exact).abs() <= tiny, "{x:e}·2^{power} = {scaled:e}");
        }
        if x != 0.0 {
            assert_eq!(f64::from(exponent), f64::from(x).abs().log2().floor(), "{x:e}");
        }
    }
    assert_silent(&device);
}

/// `Slabs`, a box, and the range of t.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct BoxCase {
    inverse: [f32; 3],
    t_min: f32,
    near: [f32; 3],
    t_max: f32,
    far: [f32; 3],
    octant: f32,
    low: [f32; 3],
    pad: f32,
    high: [f32; 3],
    pad2: f32,
}

/// Twin of `slab_test`, without the fused instruction that lavapipe lacks.
fn slab_test(case: &BoxCase, is_fused: bool) -> [f32; 2] {
    let (mut near, mut far) = (case.t_min, case.t_max);
    for axis in 0..3 {
        let negative = case.inverse[axis] < 0.0;
        let (low, high) = (case.low[axis], case.high[axis]);
        let (first, last) = if negative { (high, low) } else { (low, high) };
        let at = |x: f32, offset: f32| {
            let inverse = case.inverse[axis];
            if is_fused { x.mul_add(inverse, offset) } else { x * inverse + offset }
        };
        near = near.max(at(first, case.near[axis]));
        far = far.min(at(last, case.far[axis]));
    }
    [near, far]
}

const SLABS: &str = "
    let octant = u32(x[2].w);
    let slabs = Slabs(x[0].xyz, x[1].xyz, x[2].xyz,
        vec3<bool>((octant & 1u) != 0u, (octant & 2u) != 0u, (octant & 4u) != 0u));";

#[test]
fn slab_tests() {
    let Some(device) = device() else { return };
    let is_fused = Tracer::new(&device).unwrap().is_fused();
    let mut rng = fastrand::Rng::with_seed(3);
    let mut three = || [(); 3].map(|()| number(&mut rng));
    let input: Vec<BoxCase> = (0..10_000)
        .map(|i| {
            let (a, b, inverse, offset) = (three(), three(), three(), three());
            let negative = |axis: usize| u8::from(inverse[axis] < 0.0) << axis;
            BoxCase {
                inverse,
                t_min: if i % 2 == 0 { 0.0 } else { 0.5 },
                near: offset,
                t_max: if i % 3 == 0 { f32::MAX } else { 100.0 },
                far: offset.map(|x| x + 0.25),
                octant: f32::from(negative(0) | negative(1) | negative(2)),
                low: [0, 1, 2].map(|axis| a[axis].min(b[axis])),
                pad: 0.0,
                high: [0, 1, 2].map(|axis| a[axis].max(b[axis])),
                pad2: 0.0,
            }
        })
        .collect();
    let body = format!(
        "{SLABS} y[0] = vec4f(slab_test(slabs, x[3].xyz, x[4].xyz, x[0].w, x[1].w), 0.0, 0.0);"
    );
    let output: Vec<[f32; 4]> = run(&device, "boxes", &body, &input);
    for (case, [near, far, ..]) in input.iter().zip(output) {
        assert_eq!([near, far], slab_test(case, is_fused), "{:?} {:?}", case.low, case.high);
    }
    assert_silent(&device);
}

/// `Slabs`, the range of t, and `Node8`.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct NodeCase {
    inverse: [f32; 3],
    t_min: f32,
    near: [f32; 3],
    t_max: f32,
    far: [f32; 3],
    octant: f32,
    origin: [f32; 3],
    masks: u32,
    step: [f32; 3],
    first_node: u32,
    leaves: [u32; 4],
    planes: [[u8; 8]; 6],
}

/// Twin of `slots_met`: dequantises with the ray.
fn slots_met(case: &NodeCase, is_fused: bool) -> u32 {
    let madd = |a: f32, b: f32, c: f32| if is_fused { a.mul_add(b, c) } else { a * b + c };
    let mut met = 0;
    for slot in 0..8 {
        let (mut near, mut far) = (case.t_min, case.t_max);
        for axis in 0..3 {
            let inverse = case.inverse[axis];
            let step = case.step[axis] * inverse;
            let upper = usize::from(inverse < 0.0);
            let first = f32::from(case.planes[2 * axis + upper][slot]);
            let last = f32::from(case.planes[2 * axis + 1 - upper][slot]);
            near = near.max(madd(first, step, madd(case.origin[axis], inverse, case.near[axis])));
            far = far.min(madd(last, step, madd(case.origin[axis], inverse, case.far[axis])));
        }
        met |= u32::from(near <= far) << slot;
    }
    met & case.masks >> 8
}

#[test]
fn quantised_boxes() {
    let Some(device) = device() else { return };
    let is_fused = Tracer::new(&device).unwrap().is_fused();
    let mut rng = fastrand::Rng::with_seed(4);
    let input: Vec<NodeCase> = (0..20_000)
        .map(|_| {
            // A ray through a point of the grid, whose boxes are small enough to be missed.
            let mut three = |size: f32| [(); 3].map(|()| (rng.f32() * 2.0 - 1.0) * size);
            let (around, from, origin) = (three(0.5), three(2.0), three(0.5));
            let step = three(0.01);
            let middle = |axis: usize| origin[axis] + 128.0 * step[axis] + around[axis];
            let direction = [0, 1, 2].map(|axis| middle(axis) - from[axis]);
            let inverse = direction.map(|d| 1.0 / d);
            let offset = [0, 1, 2].map(|axis| -from[axis] * inverse[axis]);
            let negative = |axis: usize| u8::from(inverse[axis] < 0.0) << axis;
            let mut planes = [[0; 8]; 6];
            for axis in 0..3 {
                let ends = [(); 8].map(|()| (rng.u8(..), rng.u8(..)));
                // With a negative step, the largest coordinate has the smallest plane.
                let is_reverse = step[axis] < 0.0;
                planes[2 * axis + usize::from(is_reverse)] = ends.map(|(a, b)| a.min(b));
                planes[2 * axis + usize::from(!is_reverse)] = ends.map(|(a, b)| a.max(b));
            }
            NodeCase {
                inverse,
                t_min: 0.0,
                near: offset,
                t_max: 100.0,
                far: offset.map(|x| x + 1e-3),
                octant: f32::from(negative(0) | negative(1) | negative(2)),
                origin,
                masks: u32::from(rng.u8(..)) << 8,
                step,
                first_node: 0,
                leaves: [0; 4],
                planes,
            }
        })
        .collect();
    let body = format!(
        "{SLABS}
        let node = Node8(x[3].xyz, bitcast<u32>(x[3].w), x[4].xyz, bitcast<u32>(x[4].w),
            bitcast<vec4u>(x[5]), bitcast<vec4u>(x[6]), bitcast<vec4u>(x[7]), bitcast<vec4u>(x[8]));
        y[0] = vec4f(f32(slots_met(slabs, node, x[0].w, x[1].w)), 0.0, 0.0, 0.0);"
    );
    let output: Vec<[f32; 4]> = run(&device, "boxes", &body, &input);
    let mut met = 0;
    for (case, [mask, ..]) in input.iter().zip(output) {
        let expected = slots_met(case, is_fused);
        assert_eq!(f64::from(mask), f64::from(expected), "{:?} {:?}", case.planes, case.inverse);
        met += expected.count_ones();
    }
    // Neither all nor none.
    assert!((1_000..60_000).contains(&met), "{met}");
    assert_silent(&device);
}
