//!import hybrid/map
// Marching in steps (Ganestam and Doggett 2014, section 3.4).

// Samples as the paper prints it instead of many for grazing rays.
override AS_PRINTED: bool = false;

// What a line finds in a layer between two samples.
struct Meeting {
    // It meets the layer's surface, at this place.
    is_hit: bool,
    at: f32,
    found: Look,
    // It passes behind a surface.
    behind: bool,
    // It is in front of the layer at the second sample.
    in_front: bool,
    samples: u32,
}

// From the sample at s - step, where the line was in front of the layer or not, to the one at s.
fn meet(line: Line, layer: u32, s: f32, step: f32, was_in_front: bool, ray: vec3f) -> Meeting {
    let here = look(line, s, layer);
    var m = Meeting(false, s, here, false, here.gap <= here.pixel_size, 1u);
    if here.gap < 0.0 {
        return m;
    }
    if was_in_front {
        // The line has come behind something since the last sample: find where.
        var low = s - step;
        for (var j = 0u; j < 8u; j++) {
            let middle = 0.5 * (low + m.at);
            let between = look(line, middle, layer);
            m.samples++;
            if between.gap >= 0.0 {
                m.at = middle;
                m.found = between;
            } else {
                low = middle;
            }
        }
    }
    // What one pixel and the last interval leave open.
    let interval = abs(m.found.w - line_depth(line, m.at - step / 256.0));
    let doubt = 4.0 * m.found.pixel_size + 2.0 * interval;
    let thickness = thickness_of(line.face + 6u * layer, m.found.pixel);
    m.is_hit = m.found.gap <= thickness + doubt && !leaves(line.face, layer, m.found, ray);
    m.behind = was_in_front && m.found.gap > doubt;
    return m;
}

// Takes samples of a line; `result` says how it ends if it meets nothing.
fn march_linear(line: Line, delta: vec3f, ray: vec3f, result: MarchResult) -> MarchResult {
    var r = result;
    let pixels = 0.5 * frame.face_resolution * max(abs(delta.x), abs(delta.y));
    var along = abs(delta.z) / max(length(delta), 1e-30);
    if !AS_PRINTED {
        along = 1.0 - along;
    }
    let wanted = frame.n_min + along * (frame.n_max - frame.n_min);
    let n = u32(max(min(wanted, ceil(pixels) + 1.0), 1.0));
    let step = 1.0 / f32(n);
    var in_front = vec2<bool>(true);
    for (var layer = 0u; layer < LAYERS; layer++) {
        let before = look(line, 0.0, layer);
        in_front[layer] = before.gap <= before.pixel_size;
        if layer == 0u && looking_through
            && (clear_flags(line.face, before.pixel) & SEE_THROUGH) != 0u {
            in_front[layer] = true;
        }
    }
    for (var k = 1u; k <= n; k++) {
        var nearest = Meeting();
        for (var layer = 0u; layer < LAYERS; layer++) {
            var m = meet(line, layer, f32(k) * step, step, in_front[layer], ray);
            r.samples += m.samples;
            var is_last = layer + 1u == LAYERS;
            if layer == 0u {
                let clear_ = clear_flags(line.face, m.found.pixel);
                if looking_through && (clear_ & SEE_THROUGH) != 0u {
                    m.is_hit = false;
                    m.behind = false;
                    m.in_front = true;
                }
                is_last = is_last || (THROUGH_ONLY && clear_ == 0u);
            }
            if m.is_hit && (!nearest.is_hit || m.at < nearest.at) {
                nearest = m;
                r.layer = layer;
            }
            if is_last && !m.is_hit && m.behind {
                // The last layer hides what is here.
                nearest.behind = true;
            }
            in_front[layer] = m.in_front;
        }
        if nearest.is_hit {
            return met(r, line, nearest.at, nearest.found);
        }
        if nearest.behind {
            r.behind = true;
            if !GO_ON {
                r.outcome = MAP_BEHIND;
                return r;
            }
        }
    }
    return r;
}
