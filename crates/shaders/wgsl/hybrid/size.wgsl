// How many workgroups follow the rays of the pixels that were listed.

@group(0) @binding(0) var<storage, read> pixels: array<u32>;
@group(0) @binding(1) var<storage, read_write> args: array<u32>;

@compute @workgroup_size(1)
fn size() {
    let groups = (pixels[0] + 63u) / 64u;
    // 65535 is the least that every device allows along an axis.
    let rows = (groups + 65534u) / 65535u;
    args[0] = (groups + max(rows, 1u) - 1u) / max(rows, 1u);
    args[1] = rows;
    args[2] = select(0u, 1u, groups > 0u);
}
