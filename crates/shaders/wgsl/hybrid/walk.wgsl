//!import hybrid/map
// Marching from pixel to pixel, past cells of the pyramid that hold nothing on the way (Uludag 2014,
// "Hi-Z screen-space cone-traced reflections", in perspective space and with thickness).

// Levels from 1 on; see hybrid/pyramid.wgsl.
@group(1) @binding(12) var pyramid: texture_2d_array<f32>;

// Lines start where the pyramid has this level, if it is so high.
const START_LEVEL = 3u;

// What one stretch of a line, within one pixel or cell, and a layer have to do with each other.
struct Stretch {
    s_in: f32,
    s_out: f32,
    // Distances along the face's axis where it begins and ends.
    w_in: f32,
    w_out: f32,
}

// Where in a pixel with a surface at distance `depth` a line first lies between its front and its
// back, `back` with thickness; negative if nowhere.
fn first_within(line: Line, stretch: Stretch, depth: f32, back: f32) -> f32 {
    if max(stretch.w_in, stretch.w_out) < depth
        || less_doubt(min(stretch.w_in, stretch.w_out)) > back {
        return -1.0;
    }
    var w = stretch.w_in;
    if w < depth {
        w = depth;
    } else if less_doubt(w) > back {
        // It comes from behind.
        w = back * (w / less_doubt(w));
    } else {
        return stretch.s_in;
    }
    if stretch.w_in == stretch.w_out {
        return stretch.s_in;
    }
    return clamp((1.0 / w - line.i0) / (line.i1 - line.i0), stretch.s_in, stretch.s_out);
}

// Follows a line pixel by pixel; `result` says how it ends if it meets nothing.
fn walk(line: Line, ray: vec3f, result: MarchResult) -> MarchResult {
    var r = result;
    let size = i32(frame.face_resolution);
    let scale = 0.5 * frame.face_resolution;
    let a = vec2f(line.a.x + 1.0, 1.0 - line.a.y) * scale;
    let d = vec2f(line.b.x - line.a.x, line.a.y - line.b.y) * scale;
    let still = abs(d) < vec2f(1e-20);
    let inverse = 1.0 / select(d, vec2f(1.0), still);
    let forward = d >= vec2f(0.0);
    // The pixel on the way.
    var at = clamp(vec2i(floor(a)), vec2i(0), vec2i(size - 1));
    var stretch = Stretch(0.0, 0.0, line_depth(line, 0.0), 0.0);
    var level = min(START_LEVEL, frame.top_level);
    var last_layer = LAYERS - 1u;
    if THROUGH_ONLY && clear_flags(line.face, pixel_at(line.a)) == 0u {
        last_layer = 0u;
    }
    let start = look(line, 0.0, last_layer);
    r.samples++;
    var cells = 0u;
    // In front of the last layer.
    var in_front = start.gap <= start.pixel_size;
    // Each turn either goes a level down or at least one pixel on along an axis.
    loop {
        let cell = at >> vec2u(level);
        let low = cell << vec2u(level);
        let high = min(low + (1i << level), vec2i(size));
        let edges = select(low, high, forward);
        let ends = select((vec2f(edges) - a) * inverse, vec2f(INFINITE), still);
        stretch.s_out = clamp(min(ends.x, ends.y), stretch.s_in, 1.0);
        stretch.w_out = line_depth(line, stretch.s_out);
        if level > 0u {
            if may_meet(line.face, vec2u(cell), level, stretch, &in_front, r.behind, &cells) {
                level--;
                continue;
            }
        } else {
            var nearest = 2.0;
            var found: Look;
            for (var layer = 0u; layer < LAYERS; layer++) {
                let array_layer = line.face + 6u * layer;
                let pixel = vec2u(at);
                let depth = surface_depth(textureLoad(face_depth, pixel, array_layer, 0));
                r.samples++;
                if max(stretch.w_in, stretch.w_out) < depth {
                    // In front of this layer, and so of those behind it.
                    in_front = true;
                    break;
                }
                var is_last = layer + 1u == LAYERS;
                if layer == 0u {
                    let clear_ = clear_flags(line.face, pixel);
                    if looking_through && (clear_ & SEE_THROUGH) != 0u {
                        continue;
                    }
                    is_last = is_last || (THROUGH_ONLY && clear_ == 0u);
                }
                let back = depth + thickness_of(array_layer, pixel);
                let s = first_within(line, stretch, depth, back);
                var is_hit = false;
                if s >= 0.0 && s < nearest {
                    let w = line_depth(line, s);
                    let here = Look(pixel, max(w - depth, 0.0), w, w * pixel_slope());
                    if !leaves(line.face, layer, here, ray) {
                        is_hit = true;
                        nearest = s;
                        found = here;
                        r.layer = layer;
                    }
                }
                if is_last && !is_hit {
                    if in_front && less_doubt(stretch.w_in) > depth {
                        r.behind = true;
                    }
                    in_front = stretch.w_out * (1.0 - pixel_slope()) <= depth;
                }
                if is_last {
                    break;
                }
            }
            if nearest <= 1.0 {
                r.cells = cells;
                return met(r, line, nearest, found);
            }
            if r.behind && !GO_ON {
                r.outcome = MAP_BEHIND;
                break;
            }
        }
        if stretch.s_out >= 1.0 {
            break;
        }
        // On to the next pixel: across the edge that comes first, elsewhere within the cell and not
        // back, whatever is rounded.
        stretch.s_in = stretch.s_out;
        stretch.w_in = stretch.w_out;
        let there = vec2i(floor(a + stretch.s_in * d));
        let inside = select(
            clamp(there, low, at),
            clamp(there, at, high - 1),
            forward,
        );
        let beyond = select(low - 1, high, forward);
        let before = at;
        if ends.y < ends.x {
            at = vec2i(inside.x, beyond.y);
        } else {
            at = vec2i(beyond.x, inside.y);
        }
        if any(at < vec2i(0)) || any(at >= vec2i(size)) {
            break;
        }
        // Of the cell above nothing new is known until the line has left it.
        if level < frame.top_level && any((at >> vec2u(level + 1u)) != (before >> vec2u(level + 1u))) {
            level++;
        }
    }
    r.cells = cells;
    return r;
}

// Whether a line may meet something in a cell, or come behind something for the first time.
fn may_meet(
    face: u32,
    cell: vec2u,
    level: u32,
    stretch: Stretch,
    in_front: ptr<function, bool>,
    was_behind: bool,
    cells: ptr<function, u32>,
) -> bool {
    let nearest = min(stretch.w_in, stretch.w_out);
    let farthest = max(stretch.w_in, stretch.w_out);
    for (var layer = 0u; layer < LAYERS; layer++) {
        let range = textureLoad(pyramid, cell, face + 6u * layer, level - 1u).xy;
        *cells = *cells + 1u;
        if farthest < range.x {
            // A second layer of what is seen through says nothing of other pixels.
            *in_front = *in_front || layer == 0u || !THROUGH_ONLY;
            return false;
        }
        if less_doubt(nearest) <= range.y {
            return true;
        }
        if (layer + 1u == LAYERS || THROUGH_ONLY) && *in_front && !was_behind {
            return true;
        }
    }
    return false;
}
