// Arithmetic: a chain of dependent operations, and independent chains.

override WORKGROUP: u32 = 64;

struct Params {
    /// Turns of the loop.
    turns: u32,
    /// Operands that no compiler can know.
    a: u32,
    b: u32,
    x: f32,
    y: f32,
}
var<immediate> params: Params;
@group(0) @binding(0) var<storage, read_write> results: array<u32>;

/// 16 integer operations a turn, each of which needs the one before. Sums and exclusive ors in turn
/// have no closed form.
@compute @workgroup_size(1)
fn chain() {
    var p = params.x;
    var v = bitcast<u32>(p);
    for (var i = 0u; i < params.turns; i++) {
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
        v = (v + params.a) ^ params.b;
    }
    results[0] = v;
}

/// 32 fused multiply-adds a turn, in eight chains that need nothing of each other.
@compute @workgroup_size(WORKGROUP)
fn issue(@builtin(global_invocation_id) id: vec3u) {
    let s = f32(id.x);
    var a = vec4f(s, s + 1.0, s + 2.0, s + 3.0);
    var b = vec4f(s + 4.0, s + 5.0, s + 6.0, s + 7.0);
    let x = vec4f(params.x);
    let y = vec4f(params.y);
    for (var i = 0u; i < params.turns; i++) {
        a = fma(a, x, y);
        b = fma(b, x, y);
        a = fma(a, x, y);
        b = fma(b, x, y);
        a = fma(a, x, y);
        b = fma(b, x, y);
        a = fma(a, x, y);
        b = fma(b, x, y);
    }
    let sum = a + b;
    // Never so, which no compiler can know.
    if sum.x + sum.y + sum.z + sum.w == -1.0 {
        results[0] = id.x;
    }
}
