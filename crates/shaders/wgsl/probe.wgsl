// What the arithmetic of a device does with cases that Vulkan leaves open.

@group(0) @binding(0) var<storage, read> operands: array<vec4f>;
@group(0) @binding(1) var<storage, read_write> results: array<vec4f>;

/// Operands are a, b, c; results a·b + c fused, unfused, a / b and a·b, for the CPU to look at.
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= arrayLength(&operands) {
        return;
    }
    let x = operands[id.x];
    results[id.x] = vec4f(fma(x.x, x.y, x.z), x.x * x.y + x.z, x.x / x.y, x.x * x.y);
}
