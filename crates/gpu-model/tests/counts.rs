//! Instructions counted by hand, and those of the kernels that trace rays.
#![cfg(feature = "vulkan")]

use niwaki_gpu_model::{
    KernelCounts,
    counts::{CountError, Counted, InstructionMix, Place, count},
};
use niwaki_shaders::{Library, Options, Shader, Stage};

fn compile(text: &'static str) -> Shader {
    compile_with(text, &[])
}

fn compile_with(text: &'static str, constants: &[(&str, f64)]) -> Shader {
    let mut library = Library::embedded();
    library.insert("test", text);
    library.compile("test", "main", &Options { constants, ..Options::default() }).unwrap()
}

fn counted(text: &'static str) -> Counted {
    let shader = compile(text);
    count(&shader.words, &shader.entry).unwrap()
}

/// Where in the module a name is bound.
fn place(binding: u32) -> Place {
    Place { group: 0, binding }
}

#[test]
fn straight_code_by_hand() {
    let counted = counted(
        "struct Row { position: vec3f, weight: f32, rest: array<vec4f, 2> }
        @group(0) @binding(0) var<storage, read> rows: array<Row>;
        @group(0) @binding(3) var<storage, read_write> sums: array<vec2f>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let a = rows[id.x].position;
            let row = rows[id.x];
            let s = a + row.position * 2.0;
            let d = dot(s, a);
            let c = cross(s, a);
            let m = min(d, 1.0);
            sums[id.x] = vec2f(sqrt(m), clamp(c.x, 0.0, m));
        }",
    );
    assert_eq!(counted.loops.len(), 1);
    // 3 products, 3 sums, 3 for the dot product, 6 for the cross product, min, sqrt, 2 for clamp.
    let expected = InstructionMix {
        compute: 3 + 3 + 3 + 6 + 1 + 1 + 2,
        // 12 bytes, and a row of 48.
        loads: 1 + 3,
        load_bytes: 12 + 48,
        stores: 1,
        store_bytes: 8,
        ..InstructionMix::default()
    };
    assert_eq!(counted.total(), expected);
    let buffers = &counted.loops[0].buffers;
    assert_eq!((buffers[&place(0)].loads, buffers[&place(0)].load_bytes), (4, 60));
    assert_eq!((buffers[&place(3)].loads, buffers[&place(3)].stores), (0, 1));
}

#[test]
fn loops_are_told_apart() {
    let counted = counted(
        "@group(0) @binding(0) var<storage, read> a: array<f32>;
        @group(0) @binding(1) var<storage, read> b: array<vec4f>;
        @group(0) @binding(2) var<storage, read_write> sum: array<f32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            var s = 0.0;
            for (var i = 0u; i < 100u; i++) {
                s += a[i];
                for (var j = 0u; j < 10u; j++) {
                    let v = b[j];
                    s += v.x * v.y;
                }
            }
            loop {
                s = s * 0.5;
                if s < 1.0 {
                    // Once, not each turn: two products.
                    s = s * s * 3.0;
                    break;
                }
            }
            sum[id.x] = s;
        }",
    );
    let [outside, outer, inner, last] = &counted.loops[..] else { panic!("{counted:?}") };
    assert_eq!(outside.parent, None);
    assert_eq!((outer.parent, inner.parent, last.parent), (Some(0), Some(1), Some(0)));
    // A comparison and its branch, a sum, an increment.
    let one = InstructionMix { loads: 1, load_bytes: 4, compute: 4, ..InstructionMix::default() };
    assert_eq!(outer.own, one);
    let one = InstructionMix { loads: 1, load_bytes: 16, compute: 5, ..InstructionMix::default() };
    assert_eq!(inner.own, one);
    // A product, a comparison and its branch.
    assert_eq!(last.own, InstructionMix { compute: 3, ..InstructionMix::default() });
    assert_eq!((outside.own.compute, outside.own.stores, outside.own.loads), (2, 1, 0));
}

#[test]
fn callees_are_charged_at_each_call() {
    let counted = counted(
        "@group(0) @binding(0) var<storage, read> a: array<f32>;
        @group(0) @binding(1) var<storage, read_write> sum: array<f32>;
        fn square(x: f32) -> f32 { return x * x; }
        fn row(i: u32) -> f32 {
            var s = 0.0;
            for (var k = 0u; k < 4u; k++) { s += square(a[i + k]); }
            return s;
        }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            sum[id.x] = row(id.x) + row(id.y) + square(2.0);
        }",
    );
    // Outside: two sums and a square. Then the loop of each call.
    assert_eq!(counted.loops.len(), 3);
    assert_eq!(counted.loops[0].own.compute, 3);
    for one in &counted.loops[1..] {
        assert_eq!(one.parent, Some(0));
        // Comparison, branch, i + k, product, sum, increment.
        assert_eq!((one.own.compute, one.own.loads), (6, 1));
    }
}

#[test]
fn what_constants_switch_off_does_not_count() {
    let text = "override FULL: bool = false;
        override N: u32 = 0;
        @group(0) @binding(0) var<storage, read> a: array<f32>;
        @group(0) @binding(1) var<storage, read_write> sum: array<f32>;
        fn extra(x: f32) -> f32 {
            if !FULL { return x; }
            return x * x + a[0];
        }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            var s = 1.0;
            if FULL && id.x > 3u { s = a[id.x] * 2.0; }
            if N != 0u && FULL { s += a[1]; }
            if N == 2u || s > 1.0 { s += 1.0; }
            sum[id.x] = extra(s);
        }";
    let with = |full: f64, n: f64| {
        let shader = compile_with(text, &[("FULL", full), ("N", n)]);
        count(&shader.words, &shader.entry).unwrap().total()
    };
    let off = with(0.0, 0.0);
    // The comparison with 1, a branch, the sum.
    assert_eq!((off.loads, off.compute), (0, 3));
    assert_eq!(with(1.0, 0.0).loads, 2);
    assert_eq!(with(1.0, 1.0).loads, 3);
}

#[test]
fn memory_of_every_kind_by_hand() {
    let counted = counted(
        "struct Sizes { n: u32, m: u32 }
        var<immediate> sizes: Sizes;
        @group(0) @binding(0) var<uniform> scale: vec4f;
        @group(0) @binding(1) var<storage, read_write> total: atomic<u32>;
        @group(0) @binding(2) var<storage, read_write> out: array<f32>;
        var<workgroup> shared_sum: array<f32, 64>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) local: u32) {
            var stack: array<f32, 8>;
            var fixed: array<f32, 2>;
            stack[local % 8u] = scale.x;
            fixed[1] = 2.0;
            shared_sum[local] = stack[sizes.n];
            workgroupBarrier();
            atomicAdd(&total, 1u);
            out[local] = shared_sum[63u - local] + fixed[1];
        }",
    );
    let total = counted.total();
    assert_eq!((total.local, total.workgroup, total.barriers, total.others), (2, 2, 1, 1));
    assert_eq!((total.uniform_loads, total.loads, total.stores), (2, 0, 1));
    // Remainder, difference, sum.
    assert_eq!(total.compute, 3);
}

#[test]
fn matrices_by_hand() {
    let counted = counted(
        "@group(0) @binding(0) var<storage, read> m: mat4x4f;
        @group(0) @binding(1) var<storage, read_write> out: array<vec4f>;
        @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {
            let n = m * m;
            out[id.x] = n * vec4f(1.0);
        }",
    );
    let total = counted.total();
    assert_eq!(total.compute, 64 + 16);
    // The matrix is read where it is named, four columns each time.
    assert_eq!((total.loads, total.load_bytes), (8, 128));
}

#[test]
fn a_small_traversal_by_hand() {
    let shader = compile(
        "@group(0) @binding(0) var<storage, read> nodes: array<vec4u>;
        @group(0) @binding(1) var<storage, read> triangles: array<vec4f>;
        @group(0) @binding(2) var<storage, read_write> hits: array<f32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            var index = 0u;
            var t = 1e9;
            loop {
                let node = nodes[index];
                if node.w > 0u {
                    for (var i = node.x; i < node.y; i++) {
                        let row = triangles[i];
                        t = min(t, row.x * row.y);
                    }
                }
                index = node.z;
                if index == 0u { break; }
            }
            hits[id.x] = t;
        }",
    );
    let counts = KernelCounts::of_shader(&shader).unwrap();
    assert_eq!(
        counts,
        KernelCounts {
            // Two comparisons with their branches.
            compute_per_traversal: 4.0,
            // Comparison, branch, product, minimum, increment.
            compute_per_intersection: 5.0,
            compute_constant: 0.0,
            memory_per_traversal: 1.0,
            memory_per_intersection: 1.0,
            memory_constant: 1.0,
            bytes_per_memory_instruction: 12.0,
        }
    );
}

/// The kernels of trace-vulkan, without what their constants switch off.
fn traversal(module: &str, entry: &str, constants: &[(&str, f64)]) -> KernelCounts {
    let options = Options { constants, ..Options::default() };
    KernelCounts::of_shader(&niwaki_shaders::compile(module, entry, &options).unwrap()).unwrap()
}

#[test]
fn the_kernels_that_trace_rays() {
    let binary = traversal("trace_binary", "main", &[]);
    // Two children of two rows, and the two words of a node that was waiting.
    assert_eq!(binary.memory_per_traversal, 6.0);
    // Three rows of a triangle.
    assert_eq!(binary.memory_per_intersection, 3.0);
    // Two rows of the ray, two of the root, and its hit.
    assert_eq!(binary.memory_constant, 5.0);
    assert!(binary.bytes_per_memory_instruction == 16.0);
    // Two slab tests of at least 6 products and 6 sums or 6 fused ones, min and max of each.
    assert!(binary.compute_per_traversal > 40.0 && binary.compute_per_traversal < 250.0);
    let wide = traversal("trace_wide", "main", &[]);
    // A node of six rows.
    assert_eq!(wide.memory_per_traversal, 6.0);
    assert_eq!(wide.memory_per_intersection, 3.0);
    assert!(wide.compute_per_traversal > binary.compute_per_traversal);
    // Exact signs of edge functions, which hardly any ray needs, are most of the text.
    let usual = traversal("trace_binary", "main", &[("RARE", 0.0)]);
    assert!(2.0 * usual.compute_per_intersection < binary.compute_per_intersection);
    assert_eq!(usual.compute_per_traversal, binary.compute_per_traversal);
    assert!(usual.compute_constant < binary.compute_constant);
    // The other schedule does the same work in one more loop.
    let persistent = traversal("trace_binary", "persistent", &[]);
    assert_eq!(persistent.compute_per_traversal, binary.compute_per_traversal);
    assert_eq!(persistent.memory_per_intersection, binary.memory_per_intersection);
    // What is switched on costs.
    let fast = traversal("trace_binary", "main", &[("MODE", 0.0)]);
    assert!(fast.compute_per_intersection < binary.compute_per_intersection);
    let deep = traversal("trace_binary", "main", &[("DEEP", 1.0)]);
    // The way up reads a parent's number, a word of its node, and two children.
    assert_eq!(deep.memory_per_traversal, binary.memory_per_traversal + 6.0);
    let counted = traversal("trace_binary", "main", &[("COUNT", 1.0)]);
    assert_eq!(counted.memory_constant, binary.memory_constant + 1.0);
}

#[test]
fn what_cannot_be_counted_says_why() {
    let shader = compile("@compute @workgroup_size(1) fn main() {}");
    let message = count(&shader.words, "other").unwrap_err().to_string();
    assert!(message.contains("other") && message.contains("main"), "{message}");
    assert_eq!(count(&shader.words, "main").unwrap().total(), InstructionMix::default());
    assert_eq!(
        KernelCounts::of_shader(&shader).unwrap_err(),
        CountError::NoLoop("nodes, with triangles in a loop inside")
    );
    for words in [&[][..], &[1, 2, 3], &shader.words[..8], &shader.words[1..]] {
        assert!(matches!(count(words, "main"), Err(CountError::NotSpirv(_))), "{words:?}");
    }
    let entry = Library::embedded().entry_points("driver/query").unwrap().remove(0);
    let query = niwaki_shaders::compile("driver/query", &entry, &Options::default()).unwrap();
    assert!(matches!(count(&query.words, &query.entry), Err(CountError::Opaque(_))));
}

/// Every kernel of the workspace can be counted.
#[test]
fn all_kernels_have_counts() {
    let library = Library::embedded();
    let mut number = 0;
    for name in niwaki_shaders::names() {
        // Parts that others import are no modules.
        let Ok(entries) = library.entry_points(&name) else { continue };
        for entry in entries {
            let Ok(shader) = library.compile(&name, &entry, &Options::default()) else { continue };
            match count(&shader.words, &shader.entry) {
                Ok(counted) => {
                    let total = counted.total();
                    let is_empty = total.memory() + total.arithmetic() == 0;
                    assert!(!is_empty || shader.stage != Stage::Compute, "{}", shader.label);
                    number += 1;
                }
                Err(CountError::Opaque(_)) => assert!(name.starts_with("driver/"), "{name}"),
                Err(error) => panic!("{}: {error}", shader.label),
            }
        }
    }
    assert!(number > 30, "{number}");
}
