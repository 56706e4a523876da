//! A sitting animal with long ears, from blended ellipsoids: one closed, smooth surface for glass.

use super::math::{circle, sin_cos_turns};
use glam::DVec3;

/// Centre and half axes of what is blended, facing +X, the ground at 0, about 1.25 tall. Those
/// with a Z are there on both sides.
const BLOBS: [[f64; 6]; 8] = [
    [-0.04, 0.34, 0.0, 0.36, 0.33, 0.27],
    [0.12, 0.42, 0.0, 0.22, 0.28, 0.20],
    [0.24, 0.72, 0.0, 0.20, 0.175, 0.165],
    [-0.10, 0.20, 0.17, 0.22, 0.20, 0.14],
    [0.02, 0.05, 0.24, 0.20, 0.06, 0.07],
    [0.26, 0.10, 0.10, 0.13, 0.09, 0.065],
    [0.15, 1.02, 0.10, 0.075, 0.24, 0.045],
    [-0.40, 0.24, 0.0, 0.09, 0.09, 0.09],
];

/// From here every point of the surface is in view.
const HEART: DVec3 = DVec3::new(0.12, 0.52, 0.0);

/// Below zero inside; smooth, and near the surface about the distance.
fn field(p: DVec3) -> f64 {
    // Quadratic blending (Quilez) over this distance.
    const BLEND: f64 = 0.075;
    let mut out = f64::INFINITY;
    for [x, y, z, a, b, c] in BLOBS {
        // Ears lean backward and apart; |z| stands for both sides.
        let side = if z == 0.0 { p.z } else { p.z.abs() - z };
        let mut q = DVec3::new(p.x - x, p.y - y, side);
        if y > 0.9 {
            q.z -= 0.16 * q.y;
            q.x += 0.18 * q.y;
        }
        let scaled = q / DVec3::new(a, b, c);
        let gradient = scaled / DVec3::new(a, b, c);
        let k = scaled.length();
        let d = k * (k - 1.0) / gradient.length().max(1e-9);
        if out.is_infinite() {
            out = d;
        } else {
            let h = (BLEND - (out - d).abs()).max(0.0) / BLEND;
            out = out.min(d) - h * h * BLEND * 0.25;
        }
    }
    // It sits flat on the ground.
    out.max(-p.y)
}

/// The surface: around the axis, and from below to between the ears.
pub(super) fn surface(u: f64, v: f64) -> DVec3 {
    // More rows for the ears.
    let v = v * (1.0 + 0.35 * (1.0 - v) * v);
    let (sin, cos) = sin_cos_turns(0.5 * v.min(1.0));
    let direction = circle(-u) * sin.max(0.0) - DVec3::Y * cos;
    // The last way out; halving then finds it to a tenth of a micrometre.
    const STEPS: u32 = 48;
    let reach = 0.95;
    let at = |t: f64| HEART + direction * t;
    let outside = (1..=STEPS)
        .rev()
        .map(|i| reach * f64::from(i) / f64::from(STEPS))
        .find(|&t| field(at(t - reach / f64::from(STEPS))) < 0.0)
        .unwrap_or(0.0);
    let (mut low, mut high) = (outside - reach / f64::from(STEPS), outside);
    for _ in 0..20 {
        let middle = 0.5 * (low + high);
        if field(at(middle)) < 0.0 { low = middle } else { high = middle }
    }
    at(0.5 * (low + high))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_surface_lies_on_the_field() {
        for i in 0..40 {
            for j in 0..40 {
                let p = surface(f64::from(i) / 40.0, f64::from(j) / 40.0);
                assert!(field(p).abs() < 1e-4, "{p}");
                assert!(p.y >= -1e-6 && p.y < 1.4);
            }
        }
        assert!(field(HEART) < -0.05);
    }
}
