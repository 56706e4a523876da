//! The figures: turned on a lathe, and the knight's head, which is swept.

use super::super::{
    lathe::{Point, Profile, ball, turned},
    math::{circle, sin_cos_turns, smoothstep},
    piece::{EDGES, Patch, Plan, ROUND, capped, capped_len, caps},
};
use glam::{DMat3, DVec2, DVec3};

/// What stands on a board. Squares are 1 wide.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Figure {
    Pawn,
    Rook,
    Knight,
    Bishop,
    Queen,
    King,
}

/// Where a figure stands: on a point, turned around its axis.
#[derive(Clone, Copy)]
pub(super) struct Stand {
    pub(super) foot: DVec3,
    /// In turns.
    pub(super) facing: f64,
}

impl Stand {
    fn place(&self, p: DVec3) -> DVec3 {
        let (sin, cos) = sin_cos_turns(self.facing);
        self.foot + DVec3::new(p.x * cos + p.z * sin, p.y, p.z * cos - p.x * sin)
    }
}

impl Figure {
    /// Triangles in proportion to those of the others.
    pub(super) const fn weight(self) -> f64 {
        match self {
            Self::Pawn => 1.0,
            Self::Rook => 1.3,
            Self::Knight => 1.6,
            Self::Bishop => 1.4,
            Self::Queen | Self::King => 1.7,
        }
    }

    /// Foot and shaft up to where the figures differ: base radius, height of the collar, radius
    /// of the shaft below it.
    fn shaft(radius: f64, collar: f64, waist: f64) -> Vec<Point> {
        let r = radius;
        vec![
            (0.0, 0.0, 0.0),
            (r, 0.0, 0.015),
            (r, 0.09, 0.02),
            (0.94 * r, 0.12, 0.012),
            (0.94 * r, 0.15, 0.02),
            (0.78 * r, 0.17, 0.012),
            (0.80 * r, 0.23, 0.0),
            (0.66 * r, 0.29, 0.0),
            (1.25 * waist, 0.34 + 0.1 * collar, 0.0),
            (waist, 0.72 * collar, 0.0),
            (waist, collar - 0.05, 0.0),
            (waist, collar, 0.02),
            (waist + 0.085, collar + 0.015, 0.015),
            (waist + 0.085, collar + 0.05, 0.015),
            (waist + 0.01, collar + 0.07, 0.015),
        ]
    }

    fn profile(self) -> Profile {
        let mut points;
        match self {
            Self::Pawn => {
                points = Self::shaft(0.33, 0.58, 0.11);
                points.extend(ball(0.80, 0.185, 0.12));
            }
            Self::Rook => {
                points = Self::shaft(0.36, 0.70, 0.17);
                points.extend([
                    (0.20, 0.82, 0.0),
                    (0.285, 0.86, 0.015),
                    (0.285, 1.15, 0.012),
                    (0.20, 1.15, 0.012),
                    (0.20, 1.0, 0.015),
                    (0.0, 1.0, 0.0),
                ]);
            }
            Self::Knight => {
                points = Self::shaft(0.36, 0.0, 0.0);
                points.truncate(6);
                points.extend([
                    (0.30, 0.20, 0.0),
                    (0.29, 0.28, 0.02),
                    (0.22, 0.30, 0.02),
                    (0.0, 0.30, 0.0),
                ]);
            }
            Self::Bishop => {
                points = Self::shaft(0.36, 0.82, 0.12);
                points.extend([
                    (0.11, 0.92, 0.0),
                    (0.21, 0.97, 0.0),
                    (0.245, 1.10, 0.0),
                    (0.17, 1.25, 0.0),
                    (0.04, 1.345, 0.0),
                ]);
                points.extend(ball(1.41, 0.07, 0.12));
            }
            Self::Queen => {
                points = Self::shaft(0.39, 1.05, 0.125);
                points.extend([
                    (0.13, 1.16, 0.0),
                    (0.15, 1.24, 0.0),
                    (0.20, 1.34, 0.0),
                    (0.275, 1.46, 0.012),
                    (0.24, 1.475, 0.012),
                    (0.19, 1.42, 0.0),
                    (0.13, 1.49, 0.0),
                    (0.07, 1.54, 0.02),
                ]);
                points.extend(ball(1.60, 0.08, 0.12));
            }
            Self::King => {
                points = Self::shaft(0.40, 1.12, 0.135);
                points.extend([
                    (0.14, 1.24, 0.0),
                    (0.16, 1.32, 0.0),
                    (0.21, 1.42, 0.0),
                    (0.265, 1.51, 0.02),
                    (0.23, 1.545, 0.015),
                    (0.15, 1.60, 0.0),
                    (0.07, 1.63, 0.0),
                    (0.06, 1.68, 0.015),
                    (0.0, 1.68, 0.0),
                ]);
            }
        }
        Profile::new(&points)
    }

    /// Adds a figure of about `share` triangles; returns how many it has.
    pub(super) fn build(self, plan: &mut Plan, share: usize, material: u32, stand: Stand) -> usize {
        plan.crease = Some(ROUND);
        match self {
            Self::Knight => {
                let ear = caps(share / 20, 1.0, [5, 4]);
                let base = caps(share * 3 / 10, 1.0, LEAST);
                let taken = capped_len(base) + 2 * capped_len(ear);
                let head = caps(share.saturating_sub(taken), 0.7, LEAST);
                let profile = self.profile();
                plan.piece(material, move || {
                    profile.lathe(base, &|p, u| stand.place(turned(p, u)))
                });
                plan.piece(material, move || capped(head, &|u, v| stand.place(knight_head(u, v))));
                for side in [-1.0, 1.0] {
                    plan.piece(material, move || {
                        capped(ear, &|u, v| stand.place(knight_ear(side, u, v)))
                    });
                }
                taken + capped_len(head)
            }
            Self::King => {
                let [nu, nv] = caps(share.saturating_sub(CROSS), 0.75, LEAST);
                let profile = self.profile();
                plan.piece(material, move || {
                    profile.lathe([nu, nv], &|p, u| stand.place(turned(p, u)))
                });
                plan.crease = Some(EDGES);
                plan.piece(material, move || cross(stand));
                capped_len([nu, nv]) + CROSS
            }
            _ => {
                if self != Self::Pawn {
                    // What is carved has edges; rounded off, reflections there would lead inside.
                    plan.crease = Some(EDGES);
                }
                let size = caps(share, 0.75, LEAST);
                let profile = self.profile();
                plan.piece(material, move || {
                    profile.lathe(size, &|p, u| stand.place(self.carve(p, u)))
                });
                capped_len(size)
            }
        }
    }

    /// A turned point with what is cut by hand: battlements, a mitre's slit, a coronet.
    fn carve(self, p: DVec2, u: f64) -> DVec3 {
        match self {
            Self::Rook => {
                let (_, wave) = sin_cos_turns(6.0 * u);
                let cut = smoothstep(-0.25, 0.25, wave);
                let low = 1.03;
                let y = if p.y > low { low + (p.y - low) * (0.04 + 0.96 * cut) } else { p.y };
                turned(DVec2::new(p.x, y), u)
            }
            Self::Bishop => {
                let q = turned(p, u);
                // Into the side of +X, falling inward.
                let across = (q.x * 0.6 + (1.24 - q.y) * 0.8).abs();
                let cut = smoothstep(0.042, 0.018, across)
                    * smoothstep(-0.02, 0.06, q.x)
                    * smoothstep(0.98, 1.02, q.y);
                q - DVec3::new(q.x, 0.0, q.z) * (0.55 * cut)
            }
            Self::Queen => {
                let (_, wave) = sin_cos_turns(9.0 * u);
                let rim = smoothstep(1.38, 1.46, p.y) * smoothstep(0.2, 0.24, p.x);
                turned(DVec2::new(p.x + 0.012 * wave * rim, p.y + 0.035 * wave * rim), u)
            }
            _ => turned(p, u),
        }
    }
}

/// The fewest sides and steps of a figure.
const LEAST: [usize; 2] = [6, 10];
/// Triangles for a figure at least, over the figures of a board; a knight of four parts takes
/// more, a pawn fewer.
pub(super) const FEWEST: usize = 200;
/// Triangles of the king's cross.
const CROSS: usize = 44;

/// A cross with arms that widen, from an outline of twelve corners.
fn cross(stand: Stand) -> Patch {
    const OUTLINE: [[f64; 2]; 12] = [
        [-0.045, 0.0],
        [0.045, 0.0],
        [0.025, 0.105],
        [0.10, 0.085],
        [0.10, 0.175],
        [0.025, 0.155],
        [0.04, 0.27],
        [-0.04, 0.27],
        [-0.025, 0.155],
        [-0.10, 0.175],
        [-0.10, 0.085],
        [-0.025, 0.105],
    ];
    // Five quadrilaterals: the four arms and the middle.
    const QUADS: [[u32; 4]; 5] =
        [[0, 1, 2, 11], [2, 3, 4, 5], [5, 6, 7, 8], [8, 9, 10, 11], [2, 5, 8, 11]];
    let mut patch = Patch::default();
    for z in [0.03, -0.03] {
        patch
            .positions
            .extend(OUTLINE.map(|[x, y]| stand.place(DVec3::new(x, y + 1.67, z)).as_vec3()));
    }
    for [a, b, c, d] in QUADS {
        patch.indices.extend([[a, b, c], [a, c, d]]);
        let [a, b, c, d] = [a, b, c, d].map(|i| i + 12);
        patch.indices.extend([[a, c, b], [a, d, c]]);
    }
    for i in 0..12 {
        let next = (i + 1) % 12;
        patch.indices.extend([[i, i + 12, next + 12], [i, next + 12, next]]);
    }
    patch
}

/// Sections of the knight's head from the chest to the muzzle, facing +X: a point of the mane or
/// the forehead, one of the chest or the jaw (x and y each), and half the width between them.
const SECTIONS: [[f64; 5]; 12] = [
    [-0.22, 0.26, 0.22, 0.26, 0.20],
    [-0.27, 0.36, 0.25, 0.36, 0.205],
    [-0.30, 0.52, 0.20, 0.54, 0.185],
    [-0.29, 0.74, 0.10, 0.68, 0.155],
    [-0.24, 0.96, 0.06, 0.79, 0.135],
    [-0.14, 1.13, 0.10, 0.80, 0.135],
    [0.0, 1.21, 0.19, 0.77, 0.14],
    [0.12, 1.17, 0.27, 0.76, 0.13],
    [0.23, 1.06, 0.33, 0.76, 0.105],
    [0.33, 0.95, 0.38, 0.745, 0.09],
    [0.41, 0.87, 0.42, 0.73, 0.085],
    [0.455, 0.82, 0.445, 0.745, 0.06],
];

/// A point of the head and neck: around the section, and along the sections.
fn knight_head(u: f64, v: f64) -> DVec3 {
    let spans = (SECTIONS.len() - 1) as f64;
    let along = (v * (spans + 0.5) - 0.25).clamp(0.0, spans);
    let mut section = [0.0; 5];
    for (k, x) in section.iter_mut().enumerate() {
        *x = spline(along, |i| SECTIONS[i][k]);
    }
    // The ends close over a quarter of a span like a cushion.
    let beyond = (v * (spans + 0.5) - 0.25 - along).abs() * 4.0;
    let closing = (1.0 - beyond * beyond).max(0.0).sqrt();
    let [bx, by, fx, fy, width] = section;
    let (back, front) = (DVec3::new(bx, by, 0.0), DVec3::new(fx, fy, 0.0));
    let c = circle(-u);
    // Sharp at the mane, full at the chest; the cheeks are flat.
    let neck = smoothstep(0.5, 1.5, along) * (1.0 - smoothstep(6.0, 7.5, along));
    let narrow = 1.0 - 0.55 * neck * smoothstep(-0.1, -1.0, c.x);
    let (lock, _) = sin_cos_turns(1.6 * along);
    let mane = 1.0 + 0.10 * neck * lock * smoothstep(-0.75, -1.0, c.x);
    // Eyes lie in hollows under the forehead.
    let cheek = (along - 7.3) * (along - 7.3) * 1.4 + (c.x + 0.35) * (c.x + 0.35) * 9.0;
    let eye = 1.0 - 0.22 * smoothstep(1.0, 0.2, cheek) + 0.16 * smoothstep(0.22, 0.05, cheek);
    // The mouth is a groove along the muzzle.
    let lips = (c.x - 0.35) * (c.x - 0.35) * 60.0;
    let mouth = 1.0 - 0.25 * smoothstep(8.6, 9.4, along) * smoothstep(1.0, 0.1, lips);
    let half = (front - back) * 0.5;
    let bulge = c.x.abs().powi(2);
    let side = c.z * (1.0 + 0.15 * bulge) * narrow * eye * mouth;
    let end = if v < 0.5 { DVec3::new(0.0, -0.01, 0.0) } else { DVec3::new(0.02, -0.008, 0.0) };
    (back + front) * 0.5
        + half * (c.x * mane * closing)
        + DVec3::Z * (side * width * closing)
        + end * beyond.min(1.0)
}

/// A pointed ear behind the forehead.
fn knight_ear(side: f64, u: f64, v: f64) -> DVec3 {
    let root = DVec3::new(-0.04, 1.12, 0.075 * side);
    let tip = DVec3::new(-0.06, 1.36, 0.10 * side);
    let c = circle(-u);
    let (sin, _) = sin_cos_turns(0.5 * v.sqrt());
    let around = DVec3::new(c.x * 0.055, 0.0, c.z * 0.04) * (1.5 * sin.max(0.0)).min(1.0);
    root.lerp(tip, v) + around * (1.0 - 0.6 * v)
}

/// The Catmull–Rom spline through values at whole numbers.
fn spline(t: f64, value: impl Fn(usize) -> f64) -> f64 {
    let last = SECTIONS.len() - 1;
    let i = super::super::math::whole(t).min(last - 1);
    let t = t - i as f64;
    let (b, c) = (value(i), value(i + 1));
    let a = if i == 0 { 2.0 * b - c } else { value(i - 1) };
    let d = if i + 2 > last { 2.0 * c - b } else { value(i + 2) };
    let (m, n) = (0.5 * (c - a), 0.5 * (d - b));
    b + t * (m + t * (3.0 * (c - b) - 2.0 * m - n + t * (2.0 * (b - c) + m + n)))
}

/// The axes of a board that is turned by `turns`.
pub(super) fn upright(turns: f64) -> DMat3 {
    let (sin, cos) = sin_cos_turns(turns);
    DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts of figures: closed by their indices, and outside out.
    #[test]
    fn figures_are_closed_and_face_outward() {
        let stand = Stand { foot: DVec3::ZERO, facing: 0.3 };
        let mut parts: Vec<Patch> = [
            Figure::Pawn,
            Figure::Rook,
            Figure::Knight,
            Figure::Bishop,
            Figure::Queen,
            Figure::King,
        ]
        .map(|f| f.profile().lathe([24, 60], &|p, u| stand.place(f.carve(p, u))))
        .into();
        parts.push(capped([30, 40], &|u, v| stand.place(knight_head(u, v))));
        parts.extend([-1.0, 1.0].map(|s| capped([8, 8], &move |u, v| knight_ear(s, u, v))));
        parts.push(cross(stand));
        for (i, patch) in parts.iter().enumerate() {
            let mut edges = std::collections::HashMap::new();
            for t in &patch.indices {
                for k in 0..3 {
                    *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
                }
            }
            let closed = edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1));
            assert!(closed, "part {i}");
            let corner = |i: u32| patch.positions[i as usize];
            let volume: f32 = patch
                .indices
                .iter()
                .map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2]))) / 6.0)
                .sum();
            assert!(volume > 1e-5, "part {i}: {volume}");
        }
    }

    #[test]
    fn figures_keep_to_their_size() {
        for figure in [
            Figure::Pawn,
            Figure::Rook,
            Figure::Knight,
            Figure::Bishop,
            Figure::Queen,
            Figure::King,
        ] {
            let materials = vec![crate::Material::default()];
            let camera =
                crate::Camera::look_at(glam::Vec3::ZERO, glam::Vec3::X, glam::Vec3::Y, 1.0);
            let mut plan = Plan::new(materials, camera, crate::Environment::DAYLIGHT);
            let stand = Stand { foot: DVec3::ZERO, facing: 0.0 };
            let made = figure.build(&mut plan, 4000, 0, stand);
            let scene = plan.into_scene("figure");
            assert_eq!(scene.mesh.len(), made);
            let bounds = scene.mesh.bounds();
            let (height, radius) = match figure {
                Figure::Pawn => (1.0, 0.33),
                Figure::Rook => (1.15, 0.36),
                Figure::Knight => (1.36, 0.48),
                Figure::Bishop => (1.48, 0.36),
                Figure::Queen => (1.68, 0.39),
                Figure::King => (1.95, 0.40),
            };
            assert!(bounds.min.y.abs() < 1e-6, "{figure:?}");
            let tall = f64::from(bounds.max.y) / height;
            assert!((0.93..=1.001).contains(&tall), "{figure:?} {tall}");
            for p in scene.mesh.positions() {
                assert!(f64::from(p.x.hypot(p.z)) <= radius + 1e-3, "{figure:?} {p}");
            }
        }
    }
}
