//!import hybrid/primary
//!import hybrid/march
// Following rays from surface to surface, through the tree of the near region and the faces of the
// cube map, until they end at surfaces that send none on, in the sky or at the greatest depth
// (Ganestam and Doggett 2014, section 3.4).

// Reflected and refracted rays are followed.
override REFLECT: bool = true;
override REFRACT: bool = true;
// Pending rays; each depth leaves at most two behind. The renderer puts what its depth takes: on
// every device the array costs, on software drivers the time to compile too.
const RAY_STACK = 35u;

// A ray that waits.
struct Pending {
    origin: vec3f,
    depth: u32,
    direction: vec3f,
    // Length that it came before surfaces that it passed by their alpha.
    passed: f32,
    weight: vec3f,
    // It has passed a surface of the map that light passes.
    is_through: bool,
}

const END_SKY = 0u;
const END_TREE = 1u;
const END_MAP = 2u;
const END_BEHIND = 3u;

// Counts of this thread.
var<private> n_tree: u32;
var<private> n_faces: u32;
var<private> n_samples: u32;
var<private> n_cells: u32;
var<private> n_hops: u32;
var<private> n_returns: u32;
var<private> n_tree_hits: u32;
var<private> n_map_hits: u32;
var<private> n_second: u32;
var<private> n_sky: u32;
var<private> n_behind: u32;
// Array layer of the cube map in which the last march ended.
var<private> end_layer: u32;

// How often a ray may change between faces and the near region: any straight line crosses each
// border once, so only rounding at corners takes more.
const MOST_CROSSINGS = 16u;

// Follows a ray to the first surface; returns how it ended.
fn follow(o: vec3f, d: vec3f, result: ptr<function, Surface>) -> u32 {
    if HOLDS_ALL || !USE_MAP {
        n_tree++;
        var end = INFINITE;
        if !HOLDS_ALL {
            end = cube_span(o, d, frame.traced).y;
        }
        let hit = closest(o, d, 0.0, end);
        if hit.triangle != NO_TRIANGLE {
            *result = tree_surface(hit, d);
            return END_TREE;
        }
        return END_SKY;
    }
    let outer = cube_span(o, d, frame.traced);
    let inner = cube_span(o, d, frame.half_size);
    var t = 0.0;
    var in_tree = in_cube(o, frame.traced);
    var face = cube_layer(o - frame.center);
    var fresh = true;
    var clip_origin = vec4f(0.0);
    var clip_direction = vec4f(0.0);
    var was_behind = false;
    for (var k = 0u; k < MOST_CROSSINGS; k++) {
        if in_tree {
            n_tree++;
            // A triangle beyond the border is left to the map, where something may hide it.
            let hit = closest(o, d, max(min(t, outer.x), 0.0), outer.y);
            if hit.triangle != NO_TRIANGLE {
                *result = tree_surface(hit, d);
                return END_TREE;
            }
            in_tree = false;
            fresh = true;
            // Through the near plane; a ray that starts in the overlap may miss the inner cube.
            if inner.x <= inner.y && inner.y > t {
                t = inner.y;
            }
            face = cube_layer(o + t * d - frame.center);
        }
        if fresh {
            let m = frame.faces[face];
            clip_origin = m * vec4f(o - frame.center, 1.0);
            clip_direction = m * vec4f(d, 0.0);
            fresh = false;
        }
        n_faces++;
        let r = march(face, clip_origin, clip_direction, t, d);
        n_samples += r.samples;
        n_cells += r.cells;
        was_behind = was_behind || r.behind;
        end_layer = 6u * r.layer + face;
        if r.outcome == MAP_HIT {
            n_second += r.layer;
            *result = map_surface(face, r, o, d);
            return END_MAP;
        }
        if r.outcome == MAP_BEHIND {
            return END_BEHIND;
        }
        if r.outcome == MAP_FAR {
            break;
        }
        t = r.t;
        if r.outcome == MAP_NEAR {
            n_returns++;
            in_tree = true;
            continue;
        }
        n_hops++;
        let side = r.outcome - MAP_SIDE;
        let hop = frame.hops[4u * face + side];
        clip_origin = hop * clip_origin;
        clip_direction = hop * clip_direction;
        face = face_neighbour(face, side);
    }
    return select(END_SKY, END_BEHIND, was_behind);
}

fn debug_color(end: u32) -> vec3f {
    if end == END_TREE {
        return vec3f(0.1, 0.2, 1.0);
    }
    if end == END_MAP {
        if end_layer >= 6u {
            return vec3f(0.1, 0.5 + 0.08 * f32(end_layer - 6u), 0.05);
        }
        return vec3f(1.0, 0.05 + 0.1 * f32(end_layer), 0.05);
    }
    if end == END_BEHIND {
        return vec3f(1.0, 0.0, 1.0);
    }
    return vec3f(0.4, 0.8, 1.0);
}

@compute @workgroup_size(64)
fn trace(@builtin(workgroup_id) group: vec3u, @builtin(num_workgroups) groups: vec3u,
    @builtin(local_invocation_index) thread: u32) {
    let index = (group.y * groups.x + group.x) * 64u + thread;
    if index >= atomicLoad(&pixels[0]) {
        return;
    }
    let at = atomicLoad(&pixels[1u + index]);
    let x = at % frame.width;
    let y = at / frame.width;
    var stack: array<Pending, RAY_STACK>;
    var size = 0u;
    var radiance = vec3f(0.0);
    var taken = 1u;
    var n_reflected = 0u;
    var n_refracted = 0u;
    var n_continued = 0u;
    var n_cut = 0u;
    var first_end = 99u;
    var first_layer = 0u;

    // The first surface is the one that the pixel shows; it has been shaded.
    var d = primary_direction(x, y);
    var s = primary_point(x, y, textureLoad(primary_triangle, vec2u(x, y), 0).x - 1u);
    var weight = vec3f(1.0);
    var depth = 0u;
    var passed = 0.0;
    var is_map = false;
    // The first surface has drawn its directions.
    occlusion_pixel = at;
    occlusion_first = frame.occlusion_rays;
    if LOOK_THROUGH && USE_MAP && !HOLDS_ALL {
        // Only the map knows what lies behind.
        is_map = !in_cube(s.point, frame.half_size);
    }
    loop {
        // Here: a surface `s` met along `d` by a ray of this weight.
        if s.opacity < 1.0 {
            let rest = weight * (1.0 - s.opacity);
            if counts(rest) {
                let origin = s.point - s.geometric * s.clearance;
                stack[size] = Pending(origin, depth, d, passed + s.distance, rest, is_map);
                size++;
                n_continued++;
            }
            weight *= s.opacity;
        }
        s.distance += passed;
        weight *= absorbed(s);
        if depth < frame.max_depth {
            let m = point_material(s);
            let to_viewer = -d;
            let cosine = clamp(dot(s.normal, to_viewer), 0.0, 1.0);
            let flags = materials[s.material].flags;
            if REFRACT && (flags & RAYS_REFRACT) != 0u {
                let w = weight * refracted_weight(m, cosine);
                var bent = refract_direction(to_viewer, s.normal, m.eta);
                if !(dot(bent, s.geometric) < 0.0) {
                    bent = refract_direction(to_viewer, s.geometric, m.eta);
                }
                if any(bent != vec3f(0.0)) && counts(w) {
                    var ray = Pending(s.point - s.geometric * s.clearance, depth + 1u, bent, 0.0, w, is_map);
                    if is_map && LOOK_THROUGH {
                        pass_body(&ray, s, d, m.eta);
                    }
                    stack[size] = ray;
                    size++;
                    n_refracted++;
                }
            }
            if REFLECT && (flags & RAYS_REFLECT) != 0u {
                let w = weight * reflected_weight(m, cosine);
                if counts(w) {
                    var mirrored = mirror_direction(to_viewer, s.normal);
                    if dot(mirrored, s.geometric) <= 0.0 {
                        mirrored = mirror_direction(to_viewer, s.geometric);
                    }
                    let origin = s.point + s.geometric * start_clearance(s);
                    stack[size] = Pending(origin, depth + 1u, normalize(mirrored), 0.0, w, false);
                    size++;
                    n_reflected++;
                }
            }
        }
        // The next ray that meets a surface.
        var found = false;
        while size > 0u && !found {
            size--;
            let ray = stack[size];
            if taken >= frame.max_rays {
                n_cut += size + 1u;
                size = 0u;
                break;
            }
            taken++;
            d = ray.direction;
            var end = END_SKY;
            // As the paper has it, what has passed glass in the map goes to the sky.
            if LOOK_THROUGH || !ray.is_through {
                looking_through = ray.is_through;
                end = follow(ray.origin, d, &s);
            }
            if first_end == 99u {
                first_end = end;
                first_layer = end_layer;
            }
            if end == END_TREE || end == END_MAP {
                n_tree_hits += u32(end == END_TREE);
                n_map_hits += u32(end == END_MAP);
                weight = ray.weight;
                depth = ray.depth;
                passed = ray.passed;
                is_map = end == END_MAP;
                found = true;
            } else {
                n_sky += u32(end == END_SKY);
                n_behind += u32(end == END_BEHIND);
                radiance += ray.weight * environment(d);
            }
        }
        if !found {
            break;
        }
        var inside = s;
        inside.distance += passed;
        radiance += weight * absorbed(inside) * s.opacity * shade(s, d);
    }
    var color = image[at].xyz + radiance;
    if DEBUG_VIEW == 1u && first_end != 99u {
        end_layer = first_layer;
        color = debug_color(first_end);
    } else if DEBUG_VIEW == 3u {
        color = vec3f(f32(n_samples + n_cells) / 512.0);
    }
    image[at] = vec4f(color, 1.0);
    count(C_REFLECTED, n_reflected);
    count(C_REFRACTED, n_refracted);
    count(C_CONTINUED, n_continued);
    count(C_SHADOW, shadow_rays);
    count(C_OCCLUSION, occlusion_count);
    count(C_TREE, n_tree);
    count(C_FACES, n_faces);
    count(C_SAMPLES, n_samples);
    count(C_HOPS, n_hops);
    count(C_RETURNS, n_returns);
    count(C_TREE_HITS, n_tree_hits);
    count(C_MAP_HITS, n_map_hits);
    count(C_SKY, n_sky);
    count(C_BEHIND, n_behind);
    count(C_CUT, n_cut);
    count(C_CELLS, n_cells);
    count(C_SECOND, n_second);
}

// What becomes of a ray that goes on along `direction` from a surface of the map that light passes,
// met along `d`. In the map nothing is known of its other side. A body is taken for a ball that has its
// mean chord, four thirds of the radius, and touches the surface: where the ray comes out the normal
// mirrors the one where it went in. Walls do not bend rays in all; of two a ray has in the mean their
// mean chord inside, more at a slant.
fn pass_body(ray: ptr<function, Pending>, s: Surface, d: vec3f, eta: f32) {
    let inside = (*ray).direction;
    (*ray).direction = d;
    let m = materials[s.material];
    let cosine = -dot(inside, s.normal);
    if s.front < 0.5 || m.body <= 0.0 || cosine <= 0.0 {
        return;
    }
    if (m.flags & THIN_WALLED) != 0u {
        (*ray).weight *= exp(-m.absorption * (m.body / max(cosine, 0.1)));
        return;
    }
    let out = refract_direction(-inside, -(s.normal + 2.0 * cosine * inside), 1.0 / eta);
    if all(out == vec3f(0.0)) {
        return;
    }
    let length = 1.5 * m.body * cosine;
    (*ray).direction = out;
    (*ray).origin = s.point + inside * length;
    (*ray).weight *= exp(-m.absorption * length);
}

// True if a ray of this weight is followed.
fn counts(weight: vec3f) -> bool {
    let most = max(weight.x, max(weight.y, weight.z));
    return !(most <= 0.0 || most < frame.cutoff);
}
