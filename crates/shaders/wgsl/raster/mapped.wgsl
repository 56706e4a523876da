//!import raster/light
// Shadow maps (Williams 1978), compared pixel by pixel or by percentage-closer filtering (Reeves,
// Salesin and Cook 1987), and variance shadow maps (Donnelly and Lauritzen 2006).

@group(3) @binding(1) var map: texture_depth_2d;
@group(3) @binding(2) var map_sampler: sampler_comparison;
@group(3) @binding(3) var moments: texture_2d<f32>;
@group(3) @binding(4) var moment_sampler: sampler;

// A point as a light's map has it: coordinates from 0 to 1, and the distance along the light's
// axis.
struct Mapped {
    uv: vec2f,
    w: f32,
    inside: bool,
}

fn mapped(light: SpotLight, from_light: vec3f) -> Mapped {
    let clip = light.matrix * vec4f(from_light, 1.0);
    if !(clip.w > 0.0) {
        return Mapped(vec2f(0.5), 1.0, false);
    }
    let uv = clip.xy / clip.w * vec2f(0.5, -0.5) + 0.5;
    return Mapped(uv, clip.w, all(uv >= vec2f(0.0)) && all(uv <= vec2f(1.0)));
}

// The point as it is compared: off its surface by the bias.
fn biased(p: Point, light: SpotLight) -> Mapped {
    let from_light = p.surface.point - light.position;
    let span = light.width / frame.map_side * dot(from_light, light.direction);
    let cosine = clamp(dot(p.surface.normal, p.lit.direction), 0.0, 1.0);
    let sine = sqrt(1.0 - cosine * cosine);
    // At a grazing angle a pixel is as long as ten.
    let tangent = min(sine / max(cosine, 1e-3), 10.0);
    let lifted = from_light + p.surface.normal * (frame.bias_normal * span * sine);
    var m = mapped(light, lifted);
    m.w -= span * (frame.bias_constant + frame.bias_slope * tangent);
    m.inside = m.inside && m.w > 0.0;
    return m;
}

@fragment
fn mapped_main(in: Volume) -> @location(0) vec4f {
    let light = lights[in.light];
    let p = point_of(in.clip, light);
    if !p.reached {
        discard;
    }
    let m = biased(p, light);
    var share = 1.0;
    if m.inside {
        let depth = light.near / m.w;
        if frame.taps == 0u {
            let at = clamp(vec2i(m.uv * frame.map_side), vec2i(0), vec2i(i32(frame.map_side) - 1));
            share = select(0.0, 1.0, depth >= textureLoad(map, at, 0));
        } else {
            share = 0.0;
            let first = 0.5 - 0.5 * f32(frame.taps);
            for (var y = 0u; y < frame.taps; y++) {
                for (var x = 0u; x < frame.taps; x++) {
                    let offset = (vec2f(f32(x), f32(y)) + first) / frame.map_side;
                    share += textureSampleCompareLevel(map, map_sampler, m.uv + offset, depth);
                }
            }
            share /= f32(frame.taps * frame.taps);
        }
    }
    return output(p, share);
}

// Where a pixel's neighbour lies in the map, by the depth of the neighbour on the one side or on
// the other: the nearer one, so that outlines do not blur.
fn step_in_map(light: SpotLight, at: vec4f, here: vec2f, direction: vec2i) -> f32 {
    var least = 1e9;
    for (var side = -1; side <= 1; side += 2) {
        let pixel = vec2i(at.xy) + direction * side;
        if any(pixel < vec2i(0)) || any(pixel >= vec2i(i32(frame.width), i32(frame.height))) {
            continue;
        }
        let depth = textureLoad(depths, pixel, 0);
        if depth <= 0.0 {
            continue;
        }
        let q = frame.eye + seen_from_eye(vec2f(pixel) + 0.5, depth) - light.position;
        let m = mapped(light, q);
        if m.inside {
            least = min(least, length(m.uv - here));
        }
    }
    return select(least, 0.0, least > 1e8);
}

@fragment
fn moments_main(in: Volume) -> @location(0) vec4f {
    let light = lights[in.light];
    let p = point_of(in.clip, light);
    if !p.reached {
        discard;
    }
    let m = biased(p, light);
    var share = 1.0;
    if m.inside {
        let exact = mapped(light, p.surface.point - light.position);
        let x = step_in_map(light, in.clip, exact.uv, vec2i(1, 0));
        let y = step_in_map(light, in.clip, exact.uv, vec2i(0, 1));
        let covered = min(max(x, y) * frame.map_side, frame.most_filter);
        let filter_width = max(covered, frame.least_filter);
        let level = log2(max(filter_width, 1.0));
        let mean = textureSampleLevel(moments, moment_sampler, m.uv, level).xy;
        let depth = m.w / light.range;
        if depth > mean.x {
            let deviation = frame.least_deviation * light.width / frame.map_side * depth;
            // Chebyshev's bound on the share of the filter that lies at least as deep.
            let variance = max(mean.y - mean.x * mean.x, max(deviation * deviation, 1e-9));
            let d = depth - mean.x;
            let bound = variance / (variance + d * d);
            share = clamp((bound - frame.bleeding) / (1.0 - frame.bleeding), 0.0, 1.0);
        }
    }
    return output(p, share);
}
