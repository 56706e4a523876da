//!import hybrid/light
//!import hybrid/counters
// Shading of what the camera sees, and the list of pixels whose surfaces send rays on (Ganestam and
// Doggett 2014, section 3, step 4).

@group(1) @binding(7) var primary_surface: texture_2d<u32>;
@group(1) @binding(8) var primary_triangle: texture_2d<u32>;
@group(1) @binding(9) var<storage, read_write> image: array<vec4f>;
// Word 0: how many; then pixels.
@group(1) @binding(10) var<storage, read_write> pixels: array<atomic<u32>>;

// Rays are followed beyond the primary view.
override FOLLOW: bool = true;
// 1: where rays end, 2: normals, 3: march steps, 4: ambient occlusion.
override DEBUG_VIEW: u32 = 0u;

// The surface that a pixel of the primary view shows. The G-buffer has what it is made of; its
// place comes from the triangle, exactly where the ray through the pixel's centre meets it.
fn primary_point(x: u32, y: u32, triangle: u32) -> Surface {
    let d = primary_direction(x, y);
    let shear = shear_of(d);
    let a = corner(triangle, 0u) - frame.eye;
    let b = corner(triangle, 1u) - frame.eye;
    let c = corner(triangle, 2u) - frame.eye;
    // As meet_triangle, but a pixel that rasterisation gave to a triangle belongs to it even if its
    // centre lies a rounding outside.
    let a2 = vec2f(a[shear.kx], a[shear.ky]) - shear.s.xy * a[shear.kz];
    let b2 = vec2f(b[shear.kx], b[shear.ky]) - shear.s.xy * b[shear.kz];
    let c2 = vec2f(c[shear.kx], c[shear.ky]) - shear.s.xy * c[shear.kz];
    let v = a2.x * c2.y - a2.y * c2.x;
    let w = b2.x * a2.y - b2.y * a2.x;
    let det = c2.x * b2.y - c2.y * b2.x + v + w;
    var uv = vec2f(1.0 / 3.0);
    if det != 0.0 {
        uv = clamp(vec2f(v, w) / det, vec2f(0.0), vec2f(1.0));
    }
    var s = locate(triangle, uv.x, uv.y, d);
    let pixel = textureLoad(primary_surface, vec2u(x, y), 0);
    read_pixel(&s, pixel);
    let n = unpack_normal(pixel.x);
    // The stored normal faces outwards; `locate` has turned its own to the viewer.
    let shading = n * select(-1.0, 1.0, s.front > 0.5);
    s.normal = select(s.geometric, shading, -dot(shading, d) > 1e-4);
    s.opacity = 1.0;
    if ALPHA {
        s.opacity = opacity_at(triangle, uv.x, uv.y);
    }
    s.distance = distance(s.point, frame.eye);
    return s;
}

// True if rays go on from a surface seen along `d`.
fn sends_rays(s: Surface, d: vec3f) -> bool {
    if s.opacity < 1.0 {
        return true;
    }
    if frame.max_depth == 0u || (materials[s.material].flags & (RAYS_REFLECT | RAYS_REFRACT)) == 0u {
        return false;
    }
    let m = point_material(s);
    let cosine = clamp(dot(s.normal, -d), 0.0, 1.0);
    return any(reflected_weight(m, cosine) + refracted_weight(m, cosine) > vec3f(0.0));
}

// Beer's law for a segment that ends on the inside.
fn absorbed(s: Surface) -> vec3f {
    let m = materials[s.material];
    if s.front > 0.5 || m.transmission <= 0.0 {
        return vec3f(1.0);
    }
    return exp(-m.absorption * s.distance);
}

@compute @workgroup_size(8, 8)
fn primary(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= frame.width || id.y >= frame.height {
        return;
    }
    let at = id.y * frame.width + id.x;
    let triangle = textureLoad(primary_triangle, id.xy, 0).x;
    let d = primary_direction(id.x, id.y);
    if triangle == 0u {
        image[at] = vec4f(environment(d), 0.0);
        if DEBUG_VIEW == 4u {
            image[at] = vec4f(1.0);
        } else if DEBUG_VIEW != 0u {
            image[at] = vec4f(0.0);
        }
        return;
    }
    let s = primary_point(id.x, id.y, triangle - 1u);
    occlusion_pixel = at;
    if DEBUG_VIEW == 4u {
        image[at] = vec4f(vec3f(1.0), 1.0);
        if OCCLUSION {
            image[at] = vec4f(vec3f(open_surroundings(s)), 1.0);
        }
        count(C_PRIMARY, 1u);
        count(C_OCCLUSION, occlusion_count);
        return;
    }
    image[at] = vec4f(absorbed(s) * s.opacity * shade(s, d), 1.0);
    if DEBUG_VIEW == 1u {
        image[at] = vec4f(vec3f(0.25), 1.0);
    } else if DEBUG_VIEW == 2u {
        image[at] = vec4f(0.5 * s.normal + 0.5, 1.0);
    } else if DEBUG_VIEW == 3u {
        image[at] = vec4f(0.0, 0.0, 0.0, 1.0);
    }
    count(C_PRIMARY, 1u);
    count(C_SHADOW, shadow_rays);
    count(C_OCCLUSION, occlusion_count);
    if FOLLOW && DEBUG_VIEW != 2u && sends_rays(s, d) {
        count(C_SPAWNING, 1u);
        pixels[1u + atomicAdd(&pixels[0], 1u)] = at;
    }
}
