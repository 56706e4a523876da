// The renderer's image, tone mapped as niwaki_render::ToneCurve does, on the window.

struct Show {
    // Pixels of the image and of the window.
    image: vec2u,
    window: vec2u,
    // 2 to the exposure, or to what is added to the automatic one.
    factor: f32,
    automatic: u32,
    shoulder: u32,
    // The window's format takes light as it is and encodes by itself.
    linear: u32,
    // How many panels of text stand over the picture.
    panels: u32,
}

// A rectangle of text; see text.rs.
struct Panel {
    corner: vec2i,
    cells: vec2u,
    first: u32,
    zoom: u32,
    margin: u32,
    pad: u32,
}

@group(0) @binding(0) var<uniform> show: Show;
@group(0) @binding(1) var<storage, read> image: array<vec4f>;
@group(0) @binding(2) var<storage, read_write> metered: array<f32>;

const THREADS = 256u;
// Pixels that are looked at, at most: a share of them says how bright an image is.
const LOOKED_AT = 65536u;

var<workgroup> sums: array<f32, THREADS>;
var<workgroup> counts: array<f32, THREADS>;

fn luminance(c: vec3f) -> f32 {
    return dot(c, vec3f(0.2126, 0.7152, 0.0722));
}

// The factor that brings the mean logarithm of luminances to middle grey.
@compute @workgroup_size(256)
fn meter(@builtin(local_invocation_index) thread: u32) {
    let all = show.image.x * show.image.y;
    let stride = max(1u, all / LOOKED_AT);
    var sum = 0.0;
    var count = 0.0;
    for (var i = thread * stride; i < all; i += THREADS * stride) {
        let l = luminance(image[i].xyz);
        if l > 0.0 && l < 1e30 {
            sum += log(l);
            count += 1.0;
        }
    }
    sums[thread] = sum;
    counts[thread] = count;
    for (var half = THREADS / 2u; half > 0u; half /= 2u) {
        workgroupBarrier();
        if thread < half {
            sums[thread] += sums[thread + half];
            counts[thread] += counts[thread + half];
        }
    }
    if thread == 0u {
        var factor = 1.0;
        if counts[0] > 0.0 {
            factor = clamp(0.18 / exp(sums[0] / counts[0]), exp2(-20.0), exp2(20.0));
        }
        metered[0] = factor;
    }
}

@group(0) @binding(3) var<storage, read> exposure: array<f32>;
@group(0) @binding(4) var<storage, read> panels: array<Panel>;
@group(0) @binding(5) var<storage, read> cells: array<u32>;
@group(0) @binding(6) var<storage, read> font: array<u32>;

const GLYPH = vec2i(7, 13);
const BACK = 0.28;
const BAR = vec3f(0.35, 0.59, 0.94);

fn ink(number: u32) -> vec3f {
    switch number {
        case 1u: { return vec3f(0.66); }
        case 2u: { return vec3f(0.98, 0.78, 0.35); }
        default: { return vec3f(0.93); }
    }
}

// The panels over an encoded colour.
fn written(at: vec2i, under: vec3f) -> vec3f {
    var c = under;
    for (var i = 0u; i < show.panels; i++) {
        let panel = panels[i];
        let inside = at - panel.corner;
        let margin = i32(panel.margin);
        let size = vec2i(panel.cells) * GLYPH + 2 * margin;
        if any(inside < vec2i(0)) || any(inside >= size * i32(panel.zoom)) {
            continue;
        }
        c *= BACK;
        let point = inside / i32(panel.zoom) - margin;
        if any(point < vec2i(0)) || any(point >= size - 2 * margin) {
            continue;
        }
        let cell = point / GLYPH;
        let within = point - cell * GLYPH;
        let word = cells[panel.first + u32(cell.y) * panel.cells.x + u32(cell.x)];
        let covered = (word >> 16u) & 0xffu;
        if u32(within.x) * 16u < covered * u32(GLYPH.x) && within.y > 1 && within.y < 11 {
            c = BAR;
        }
        let row = font[((word & 0xffu) - 32u) * u32(GLYPH.y) + u32(within.y)];
        if ((row >> u32(within.x)) & 1u) != 0u {
            c = ink((word >> 8u) & 0xffu);
        }
    }
    return c;
}

@vertex
fn corner(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    // One triangle that covers the window.
    let x = f32(i & 1u) * 4.0 - 1.0;
    let y = f32(i >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 0.0, 1.0);
}

fn pixel(x: i32, y: i32) -> vec3f {
    let at = clamp(vec2i(x, y), vec2i(0), vec2i(show.image) - 1);
    return image[u32(at.y) * show.image.x + u32(at.x)].xyz;
}

fn encoded(x: f32) -> f32 {
    let c = clamp(x, 0.0, 1.0);
    return select(1.055 * pow(c, 1.0 / 2.4) - 0.055, 12.92 * c, c <= 0.0031308);
}

fn decoded(x: f32) -> f32 {
    return select(pow((x + 0.055) / 1.055, 2.4), x / 12.92, x <= 0.04045);
}

@fragment
fn shown(@builtin(position) position: vec4f) -> @location(0) vec4f {
    let at = position.xy / vec2f(show.window) * vec2f(show.image) - 0.5;
    let low = floor(at);
    let t = at - low;
    let x = i32(low.x);
    let y = i32(low.y);
    let above = mix(pixel(x, y), pixel(x + 1, y), t.x);
    let below = mix(pixel(x, y + 1), pixel(x + 1, y + 1), t.x);
    var c = mix(above, below, t.y) * show.factor;
    if show.automatic != 0u {
        c *= exposure[0];
    }
    if show.shoulder != 0u {
        let l = luminance(c);
        c *= (1.0 + l / 16.0) / (1.0 + l);
    }
    c = written(vec2i(position.xy), vec3f(encoded(c.x), encoded(c.y), encoded(c.z)));
    if show.linear != 0u {
        c = vec3f(decoded(c.x), decoded(c.y), decoded(c.z));
    }
    return vec4f(c, 1.0);
}
