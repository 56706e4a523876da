//! Exact shadows by rays in double precision, and how far a frame's are from them.

use crate::{Shares, SpotLight};
use glam::DVec3;
use niwaki_core::{Builder, TriangleMesh};
use niwaki_scene::Camera;
use niwaki_trace::{DoubleRay, DoubleScene, DoubleSceneError};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// What rays say of a light at a pixel's point.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Exact {
    /// The pixel shows nothing, or a point beyond the light's cone or range.
    Unreached,
    /// The triangle's visible side faces the light and nothing stands between.
    Lit,
    /// It faces the light, and something stands between.
    Shadowed,
    /// It faces away: the triangle itself stands between, and no light is reflected whatever a
    /// shadow algorithm says.
    Averted,
}

/// What rays say of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Judged {
    /// At its centre.
    pub exact: Exact,
    /// The answer is another nearby: a silhouette pixel.
    pub silhouette: bool,
}

/// The triangles of a scene for shadow rays in double precision.
#[derive(Debug)]
pub struct ExactShadows {
    scene: DoubleScene,
    positions: Vec<DVec3>,
    indices: Vec<[u32; 3]>,
}

/// Shares of a shadow ray's length at which it begins and ends: what lies on the point or on the
/// light is not between them.
const CLEARANCE: f64 = 1e-9;
/// Sine of the angle between light and surface below which rounding decides whether one sees the
/// other.
const GRAZING: f64 = 1e-5;

impl ExactShadows {
    /// Builds a tree over a mesh.
    ///
    /// # Errors
    /// What the tree reports.
    pub fn new(builder: &dyn Builder, mesh: &TriangleMesh) -> Result<Self, DoubleSceneError> {
        let positions: Vec<DVec3> = mesh.positions().iter().map(|p| p.as_dvec3()).collect();
        let scene = DoubleScene::new(builder, &positions, mesh.indices())?;
        Ok(Self { scene, positions, indices: mesh.indices().to_vec() })
    }

    /// True if nothing stands between two points, other than on them.
    #[must_use]
    pub fn sees(&self, from: DVec3, to: DVec3) -> bool {
        let ray = DoubleRay {
            t_min: CLEARANCE,
            t_max: 1.0 - CLEARANCE,
            ..DoubleRay::new(from, to - from)
        };
        !self.scene.any_hit(&ray)
    }

    /// What rays say of a light at every pixel of a frame: at the point where the ray through the
    /// pixel's centre meets the plane of the triangle that the frame shows there.
    ///
    /// A *silhouette pixel* is one where the answer is another at one of eight points in that plane
    /// that are seen `radius` pixels around the centre, where the light lies in the plane to within
    /// rounding, or where the ray misses the triangle: rasterisers snap corners to parts of a
    /// pixel, and then show it at a centre that lies just outside of it.
    #[must_use]
    pub fn judge(
        &self,
        camera: &Camera,
        frame: &Shares,
        light: &SpotLight,
        radius: f64,
    ) -> Vec<Judged> {
        let view = Rays::new(camera, frame.width, frame.height);
        let none = Judged { exact: Exact::Unreached, silhouette: false };
        (0..frame.triangle.len())
            .into_par_iter()
            .map(|i| {
                let (x, y) = (i % frame.width.max(1) as usize, i / frame.width.max(1) as usize);
                let (x, y) = (x as f64 + 0.5, y as f64 + 0.5);
                let Some(plane) = self.plane(frame.triangle[i], &view) else { return none };
                let depth = f64::from(frame.near) / f64::from(frame.depth[i]);
                let at = |x: f64, y: f64| plane.meet(&view, x, y, depth);
                let ask = |p: DVec3| self.ask(&plane, p, light);
                let exact = ask(at(x, y));
                if exact == Exact::Unreached {
                    return none;
                }
                let off = !plane.holds(at(x, y));
                let grazing = plane.sine(light.position.as_dvec3(), at(x, y)).abs() < GRAZING;
                let silhouette = off
                    || grazing
                    || (0..8_u8).any(|k| {
                        let (sin, cos) = (std::f64::consts::FRAC_PI_4 * f64::from(k)).sin_cos();
                        let there = ask(at(x + radius * cos, y + radius * sin));
                        there != exact && there != Exact::Unreached
                    });
                Judged { exact, silhouette }
            })
            .collect()
    }

    fn plane(&self, number: u32, view: &Rays) -> Option<Plane> {
        let triangle = self.indices.get(number.checked_sub(1)? as usize)?;
        let [a, b, c] = triangle.map(|i| self.positions[i as usize]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        let side = if normal.dot(view.eye - a) < 0.0 { -1.0 } else { 1.0 };
        Some(Plane { corners: [a, b, c], normal: normal * side, side })
    }

    fn ask(&self, plane: &Plane, point: DVec3, light: &SpotLight) -> Exact {
        if light.illuminate(point.as_vec3()).is_none() {
            return Exact::Unreached;
        }
        let at = light.position.as_dvec3();
        match plane.sine(at, point) > 0.0 {
            false => Exact::Averted,
            true if self.sees(point, at) => Exact::Lit,
            true => Exact::Shadowed,
        }
    }
}

/// A triangle's plane, its normal on the viewer's side.
struct Plane {
    corners: [DVec3; 3],
    normal: DVec3,
    /// 1 if the normal is that of the winding, else -1.
    side: f64,
}

impl Plane {
    /// Where a pixel's ray meets the plane; where it does so far from `depth` (planes that are
    /// seen edge-on), the point at that depth.
    fn meet(&self, view: &Rays, x: f64, y: f64, depth: f64) -> DVec3 {
        let d = view.through(x, y);
        let t = self.normal.dot(self.corners[0] - view.eye) / self.normal.dot(d);
        let t = if (t - depth).abs() <= 0.05 * depth { t } else { depth };
        view.eye + d * t
    }

    /// True if a point of the plane lies in the triangle.
    fn holds(&self, point: DVec3) -> bool {
        let [a, b, c] = self.corners;
        let winding = self.normal * self.side;
        [(a, b), (b, c), (c, a)]
            .iter()
            .all(|(from, to)| (*to - *from).cross(point - *from).dot(winding) >= 0.0)
    }

    /// Sine of the angle at which light from `from` falls on the visible side.
    fn sine(&self, from: DVec3, point: DVec3) -> f64 {
        self.normal.dot((from - point).normalize_or_zero())
    }
}

/// Rays through pixels, of depth 1, in double precision.
struct Rays {
    eye: DVec3,
    corner: DVec3,
    step_x: DVec3,
    step_y: DVec3,
}

impl Rays {
    fn new(camera: &Camera, width: u32, height: u32) -> Self {
        let (width, height) = (f64::from(width.max(1)), f64::from(height.max(1)));
        let half_height = (0.5 * f64::from(camera.vertical_fov)).tan();
        let half_width = half_height * width / height;
        let (forward, up) = (camera.forward.as_dvec3(), camera.up.as_dvec3());
        let right = forward.cross(up);
        Self {
            eye: camera.position.as_dvec3(),
            corner: forward - right * half_width + up * half_height,
            step_x: right * (2.0 * half_width / width),
            step_y: up * (-2.0 * half_height / height),
        }
    }

    fn through(&self, x: f64, y: f64) -> DVec3 {
        self.corner + self.step_x * x + self.step_y * y
    }
}

/// How far a frame's shadows of a light are from exact ones.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ShadowError {
    /// Pixels within the light's cone and range.
    pub reached: usize,
    /// Of those, silhouette pixels.
    pub silhouettes: usize,
    /// Of those, pixels whose triangle faces away from the light.
    pub averted: usize,
    /// Silhouette pixels whose share is off by half or more.
    pub wrong_at_silhouettes: usize,
    /// Pixels that face away whose share is off by half or more, silhouettes aside.
    pub wrong_averted: usize,
    /// Other pixels whose share is off by half or more.
    pub wrong_elsewhere: usize,
    /// Sum of shares at pixels in shadow: light that leaks or bleeds. Pixels that face away do not
    /// count, here and below: they reflect nothing anyway.
    pub leaked: f64,
    /// Sum of 1 − share at lit pixels: darkness that should not be, acne for one.
    pub lost: f64,
}

impl ShadowError {
    /// Compares a frame with what rays say of it.
    #[must_use]
    pub fn of(frame: &Shares, judged: &[Judged]) -> Self {
        let mut all = Self::default();
        for (share, judged) in frame.share.iter().zip(judged) {
            let share = f64::from(*share);
            let off = match judged.exact {
                Exact::Unreached => continue,
                Exact::Lit => 1.0 - share,
                Exact::Shadowed | Exact::Averted => share,
            };
            let averted = judged.exact == Exact::Averted;
            all.reached += 1;
            all.silhouettes += usize::from(judged.silhouette);
            all.averted += usize::from(averted);
            match judged.exact {
                Exact::Lit => all.lost += off,
                Exact::Shadowed => all.leaked += off,
                _ => {}
            }
            // A share that is no number is wrong.
            if off >= 0.5 || off.is_nan() {
                match (judged.silhouette, averted) {
                    (true, _) => all.wrong_at_silhouettes += 1,
                    (false, true) => all.wrong_averted += 1,
                    (false, false) => all.wrong_elsewhere += 1,
                }
            }
        }
        all
    }

    /// Adds those of another frame or light.
    #[must_use]
    pub fn plus(self, other: Self) -> Self {
        Self {
            reached: self.reached + other.reached,
            silhouettes: self.silhouettes + other.silhouettes,
            averted: self.averted + other.averted,
            wrong_at_silhouettes: self.wrong_at_silhouettes + other.wrong_at_silhouettes,
            wrong_averted: self.wrong_averted + other.wrong_averted,
            wrong_elsewhere: self.wrong_elsewhere + other.wrong_elsewhere,
            leaked: self.leaked + other.leaked,
            lost: self.lost + other.lost,
        }
    }

    /// Pixels that are reached and face the light.
    #[must_use]
    pub const fn facing(&self) -> usize {
        self.reached - self.averted
    }

    /// Mean |share − exact| over the pixels that face the light; 0 without any.
    #[must_use]
    pub fn mean(&self) -> f64 {
        (self.leaked + self.lost) / self.facing().max(1) as f64
    }

    /// Mean share at pixels in shadow and mean loss at lit ones, each over all pixels that face
    /// the light.
    #[must_use]
    pub fn leaked_and_lost(&self) -> [f64; 2] {
        [self.leaked, self.lost].map(|sum| sum / self.facing().max(1) as f64)
    }
}
