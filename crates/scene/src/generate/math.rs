//! Functions that give the same bits on every platform, unlike those of the system's library.

use glam::DVec3;

/// Sine and cosine of `turns` full turns (1 is 2π), within 1e-15.
///
/// The angle is reduced exactly to an eighth of a turn, where a Taylor series of seven terms
/// leaves less than 1e-16.
pub(crate) fn sin_cos_turns(turns: f64) -> (f64, f64) {
    let t = turns - turns.floor();
    let quarter = (t * 4.0 + 0.5).floor();
    let x = (t - quarter * 0.25) * std::f64::consts::TAU;
    let x2 = x * x;
    let mut sin = 0.0;
    let mut cos = 0.0;
    // Horner from the highest term: sin x = x (1 − x²/(2·3) (1 − x²/(4·5) (…))).
    for k in (1..=8).rev() {
        let k = f64::from(2 * k);
        sin = (1.0 + sin) * -x2 / (k * (k + 1.0));
        cos = (1.0 + cos) * -x2 / (k * (k - 1.0));
    }
    let (sin, cos) = (x * (1.0 + sin), 1.0 + cos);
    match quarter {
        1.0 => (cos, -sin),
        2.0 => (-sin, -cos),
        3.0 => (-cos, sin),
        _ => (sin, cos),
    }
}

/// A point of the unit circle in the XZ plane.
pub(super) fn circle(turns: f64) -> DVec3 {
    let (sin, cos) = sin_cos_turns(turns);
    DVec3::new(cos, 0.0, sin)
}

/// The whole part of a number, 0 for negative ones.
pub(super) fn whole(x: f64) -> usize {
    #[expect(
        clippy::cast_possible_truncation,
        reason = "the conversion saturates, and truncating is what is asked for"
    )]
    let whole = x as usize;
    whole
}

/// 0 up to `a`, 1 from `b` on, smooth between (3t² − 2t³).
pub(super) fn smoothstep(a: f64, b: f64, x: f64) -> f64 {
    let t = ((x - a) / (b - a)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Value noise with smooth interpolation on the integer lattice, −1 to 1.
pub(super) fn noise(p: DVec3, seed: u64) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let f = f * f * (3.0 - 2.0 * f);
    #[expect(clippy::cast_possible_truncation, reason = "generators stay within a few thousand")]
    let [x, y, z] = cell.to_array().map(|c| c as i64);
    let corner = |dx: i64, dy: i64, dz: i64| {
        let mut h = seed;
        for c in [x + dx, y + dy, z + dz] {
            h = super::random::mix(h ^ c.cast_unsigned());
        }
        let unit = (h >> 11) as f64 * (1.0 / (1_u64 << 53) as f64);
        2.0 * unit - 1.0
    };
    let lerp = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy, dz| lerp(corner(0, dy, dz), corner(1, dy, dz), f.x);
    let face = |dz| lerp(row(0, dz), row(1, dz), f.y);
    lerp(face(0), face(1), f.z)
}

/// Three octaves of [`noise`], −1 to 1.
pub(super) fn turbulence(p: DVec3, seed: u64) -> f64 {
    (noise(p, seed) * 4.0 + noise(p * 2.03, seed ^ 1) * 2.0 + noise(p * 4.01, seed ^ 2)) / 7.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_agree_with_the_library() {
        for i in -2000..2000 {
            let turns = f64::from(i) * 0.001_37;
            let (sin, cos) = sin_cos_turns(turns);
            let (s, c) = (turns * std::f64::consts::TAU).sin_cos();
            assert!((sin - s).abs() < 1e-13 && (cos - c).abs() < 1e-13, "{turns}: {sin} {s}");
        }
        assert_eq!(sin_cos_turns(0.25), (1.0, 0.0));
        assert_eq!(sin_cos_turns(-0.5), (0.0, -1.0));
    }

    #[test]
    fn noise_is_continuous_and_bounded() {
        for i in 0..4000 {
            let p = DVec3::new(f64::from(i) * 0.013, 0.7, f64::from(i) * -0.029);
            let here = noise(p, 5);
            assert!(here.abs() <= 1.0);
            assert!((here - noise(p + DVec3::splat(1e-7), 5)).abs() < 1e-5);
        }
    }
}
