//!import normals
// A scene's surfaces and textures, and how they are packed: for all renderers that draw it.
// The Rust twins of the structures are in crates/gpu-frame/src/layout.rs.

struct Vertex {
    position: vec3f,
    u: f32,
    normal: vec3f,
    v: f32,
}

struct Material {
    base_color: vec3f,
    metallic: f32,
    emission: vec3f,
    roughness: f32,
    absorption: vec3f,
    transmission: f32,
    ior: f32,
    alpha: f32,
    // ALPHA_* and the cutoff of a mask.
    alpha_mode: u32,
    cutoff: f32,
    // Numbers of textures, -1 for none.
    base_texture: i32,
    surface_texture: i32,
    emission_texture: i32,
    // Length behind the front that still belongs to the surface in the cube map.
    thickness: f32,
    // What rays may do here: RAYS_* and POLISHED.
    flags: u32,
    mean_fresnel: f32,
    // How long rays are inside of what light passes, in the mean.
    body: f32,
    pad: u32,
}

const ALPHA_MASK = 1u;
const ALPHA_BLEND = 2u;
const RAYS_REFLECT = 1u;
const RAYS_REFRACT = 2u;
// The whole material is smooth enough for its coat to be a mirror.
const POLISHED = 4u;
// Light passes it, and rays look through it in the cube map.
const SEE_THROUGH = 8u;
// It has holes, beside which rays see what it hides from the centre of the map.
const CUT_OUT = 16u;
// What light passes are thin walls, not bodies.
const THIN_WALLED = 32u;

struct TextureInfo {
    // Top left corner in its layer.
    x: u32,
    y: u32,
    layer: u32,
    width: u32,
    height: u32,
    // Bit 0: sRGB. Bits 8 and 16 on: how u and v wrap.
    flags: u32,
    pad0: u32,
    pad1: u32,
}

const WRAP_REPEAT = 0u;
const WRAP_MIRROR = 1u;

// Binding 0 is a uniform of each renderer's own.
@group(0) @binding(1) var<storage, read> vertices: array<Vertex>;
@group(0) @binding(2) var<storage, read> indices: array<u32>;
@group(0) @binding(3) var<storage, read> material_ids: array<u32>;
@group(0) @binding(4) var<storage, read> materials: array<Material>;
@group(0) @binding(5) var<storage, read> texture_infos: array<TextureInfo>;
@group(0) @binding(6) var atlas: texture_2d_array<f32>;

// Whether any material looks up a texture.
override TEXTURES: bool = true;

fn srgb_to_linear(c: vec3f) -> vec3f {
    let low = c / 12.92;
    let high = pow((c + 0.055) / 1.055, vec3f(2.4));
    return select(high, low, c <= vec3f(0.04045));
}

fn wrap(i: i32, size: i32, mode: u32) -> i32 {
    if mode == WRAP_REPEAT {
        return ((i % size) + size) % size;
    }
    if mode == WRAP_MIRROR {
        let j = ((i % (2 * size)) + 2 * size) % (2 * size);
        return select(2 * size - 1 - j, j, j < size);
    }
    return clamp(i, 0, size - 1);
}

fn texel(info: TextureInfo, x: i32, y: i32) -> vec4f {
    let u = wrap(x, i32(info.width), (info.flags >> 8u) & 255u);
    let v = wrap(y, i32(info.height), (info.flags >> 16u) & 255u);
    let at = vec2u(info.x + u32(u), info.y + u32(v));
    let c = textureLoad(atlas, at, info.layer, 0);
    if (info.flags & 1u) != 0u {
        return vec4f(srgb_to_linear(c.xyz), c.w);
    }
    return c;
}

// Twin of niwaki_scene::Texture::sample: bilinear, without levels. Ones without a texture.
fn sample_texture(index: i32, uv: vec2f) -> vec4f {
    if !TEXTURES || index < 0 {
        return vec4f(1.0);
    }
    let info = texture_infos[index];
    let size = vec2f(f32(info.width), f32(info.height));
    // Whole turns carry nothing for a texture that repeats, but digits.
    let place = clamp(uv, vec2f(-1e6), vec2f(1e6)) * size - 0.5;
    let base = floor(place);
    let f = place - base;
    let p = vec2i(base);
    // A loop, as four calls would be four copies of the code.
    var rows = array<vec4f, 4>();
    for (var k = 0; k < 4; k++) {
        rows[k] = texel(info, p.x + (k & 1), p.y + (k >> 1u));
    }
    let top = rows[0] + (rows[1] - rows[0]) * f.x;
    let bottom = rows[2] + (rows[3] - rows[2]) * f.x;
    return top + (bottom - top) * f.y;
}

// The probability that a ray meets the surface.
fn opacity(m: Material, uv: vec2f) -> f32 {
    if m.alpha_mode == ALPHA_MASK {
        return select(0.0, 1.0, m.alpha * sample_texture(m.base_texture, uv).w >= m.cutoff);
    }
    if m.alpha_mode == ALPHA_BLEND {
        return clamp(m.alpha * sample_texture(m.base_texture, uv).w, 0.0, 1.0);
    }
    return 1.0;
}

// Colours from 0 to 1 as square roots, 10 bits a channel, which errs least where eyes see most.
fn pack_color(c: vec3f) -> u32 {
    let q = vec3u(sqrt(c) * 1023.0 + 0.5);
    return q.x | (q.y << 10u) | (q.z << 20u);
}

fn unpack_color(bits: u32) -> vec3f {
    let c = vec3f(vec3u(bits, bits >> 10u, bits >> 20u) & vec3u(1023u)) / 1023.0;
    return c * c;
}

// Radiance in 32 bits with a common exponent, 9 bits a channel.
fn pack_radiance(c: vec3f) -> u32 {
    let v = clamp(c, vec3f(0.0), vec3f(65408.0));
    let largest = max(v.x, max(v.y, v.z));
    if largest < 1e-7 {
        return 0u;
    }
    let exponent = clamp(i32(floor(log2(largest))) + 16, 0, 31);
    var scale = exp2(f32(exponent - 24));
    var e = exponent;
    if floor(largest / scale + 0.5) > 511.0 {
        scale = scale * 2.0;
        e = e + 1;
    }
    let q = vec3u(min(floor(v / scale + 0.5), vec3f(511.0)));
    return q.x | (q.y << 9u) | (q.z << 18u) | (u32(min(e, 31)) << 27u);
}

fn unpack_radiance(bits: u32) -> vec3f {
    let scale = exp2(f32(i32(bits >> 27u) - 24));
    return vec3f(vec3u(bits, bits >> 9u, bits >> 18u) & vec3u(511u)) * scale;
}
