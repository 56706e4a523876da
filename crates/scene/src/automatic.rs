//! Cameras, camera paths and light for files that bring none.

mod path;

pub use path::automatic_path;

use crate::{Camera, Environment, Light, LightKind, Scene};
use glam::{DVec3, Vec3};
use niwaki_core::{Aabb, TriangleMesh};
use rayon::prelude::*;

/// Cells along the longest edge of the scene.
const RESOLUTION: f64 = 48.0;
/// Horizontal directions that are looked along.
const DIRECTIONS: usize = 16;

/// A view chosen by [`automatic_camera`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AutomaticView {
    /// Where to look from.
    pub camera: Camera,
    /// True if the camera stands inside the scene.
    pub inside: bool,
    /// A lamp under the ceiling, for rooms that no light from outside reaches.
    pub lamp: Option<Light>,
}

/// Chooses a view of a mesh with Y up, deterministically.
///
/// The triangles are marked in a grid of at most 48³ cells. The scene is an *interior* if its
/// middle is hollow: at least two fifths of the cells in the middle half (and between 15 % and 65 %
/// of the height) are free and look, in most of 16 horizontal directions and downward, at the
/// front sides of triangles. (The inside of a solid object looks at back sides.) The camera then
/// stands in a free cell from which the view is long and nothing is close, and looks along the
/// longest view. Otherwise it stands outside, above and to the front, at a distance that frames
/// the bounding sphere.
#[must_use]
pub fn automatic_camera(mesh: &TriangleMesh) -> AutomaticView {
    let bounds = mesh.bounds();
    if bounds.is_empty() {
        let camera = Camera::look_at(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, Vec3::Y, 0.7);
        return AutomaticView { camera, inside: false, lamp: None };
    }
    if let Some(view) = Grid::new(mesh).and_then(|grid| grid.interior()) {
        return view;
    }
    // One far lamp or a wide empty ground should not make everything else small.
    let most = trimmed(mesh, bounds);
    let size = |b: Aabb| (b.max.as_dvec3() - b.min.as_dvec3()).length();
    let bounds = if size(bounds) > 1.5 * size(most) { most } else { bounds };
    const FOV: f32 = 0.7;
    let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
    let center = (min + max) * 0.5;
    let radius = ((max - min).length() * 0.5).max(center.length() * 1e-6).max(1e-35);
    let away = DVec3::new(0.55, 0.35, 0.76).normalize();
    let eye = center + away * (radius / (f64::from(FOV) * 0.5).sin());
    let limit = DVec3::splat(f64::from(f32::MAX));
    let position = eye.clamp(-limit, limit).as_vec3();
    let camera = Camera::facing(position, -away, Vec3::Y, FOV);
    AutomaticView { camera, inside: false, lamp: None }
}

/// The box that a hundredth of the vertices lies beyond on each side, to 1/1024 of the bounds.
fn trimmed(mesh: &TriangleMesh, bounds: Aabb) -> Aabb {
    const BINS: usize = 1024;
    let mut out = bounds;
    for axis in 0..3 {
        let (low, high) = (f64::from(bounds.min[axis]), f64::from(bounds.max[axis]));
        let width = (high - low) / BINS as f64;
        if width <= 0.0 {
            continue;
        }
        let mut counts = [0_usize; BINS];
        for p in mesh.positions().iter().filter(|p| bounds.contains_point(**p)) {
            #[expect(clippy::cast_possible_truncation, reason = "the point lies within the bounds")]
            let bin = ((f64::from(p[axis]) - low) / width) as usize;
            counts[bin.min(BINS - 1)] += 1;
        }
        let tail = mesh.positions().len() / 100;
        let skip = |bins: &mut dyn Iterator<Item = &usize>| {
            let mut sum = 0;
            bins.take_while(|n| {
                sum += **n;
                sum <= tail
            })
            .count()
        };
        let (from, to) = (skip(&mut counts.iter()), skip(&mut counts.iter().rev()));
        #[expect(clippy::cast_possible_truncation, reason = "within the bounds, which are f32")]
        if from + to < BINS {
            out.min[axis] = (low + from as f64 * width) as f32;
            out.max[axis] = (high - to as f64 * width) as f32;
        }
    }
    out
}

/// Gives a scene a camera if it has none, and light if it has none: a sky, and inside a closed
/// room a lamp as well.
pub(crate) fn complete(scene: &mut Scene, no_environment: bool) {
    let lit = !scene.lights.is_empty() || !scene.emissive_triangles().is_empty();
    if scene.cameras.is_empty() {
        let view = automatic_camera(&scene.mesh);
        scene.cameras.push(view.camera);
        if !lit && no_environment {
            scene.lights.extend(view.lamp);
        }
    }
    if !lit && no_environment {
        scene.environment = Environment::DAYLIGHT;
    }
}

/// What a cell holds: samples, and the sum of their normals in thousandths. Integers, so that
/// the sum does not depend on the order in which threads add.
#[derive(Clone, Copy, Default)]
struct Cell {
    samples: i32,
    normal: [i32; 3],
}

impl Cell {
    const fn add(&mut self, other: Self) {
        self.samples = self.samples.saturating_add(other.samples);
        let mut k = 0;
        while k < 3 {
            self.normal[k] = self.normal[k].saturating_add(other.normal[k]);
            k += 1;
        }
    }
}

struct Grid {
    min: DVec3,
    cell: f64,
    size: [usize; 3],
    cells: Vec<Cell>,
}

/// What is seen from a cell.
struct Survey {
    /// Share of the horizontal and downward directions that end at a triangle.
    closed: f64,
    /// Share of those whose triangles show their front.
    front: f64,
    /// Shortest and longest horizontal view, in cells.
    near: f64,
    far: f64,
    far_direction: DVec3,
    mean: f64,
}

impl Grid {
    fn new(mesh: &TriangleMesh) -> Option<Self> {
        let bounds = mesh.bounds();
        let (min, max) = (bounds.min.as_dvec3(), bounds.max.as_dvec3());
        let extent = max - min;
        let cell = extent.max_element() / RESOLUTION;
        if !(cell.is_finite() && cell > 0.0) {
            return None;
        }
        #[expect(clippy::cast_possible_truncation, reason = "between 0 and the resolution")]
        let size = (extent / cell).to_array().map(|n| n.ceil().clamp(1.0, RESOLUTION) as usize);
        let mut grid = Self { min, cell, size, cells: Vec::new() };
        let count = size.iter().product();
        let empty = || vec![Cell::default(); count];
        grid.cells = (0..mesh.len())
            .into_par_iter()
            .with_min_len(1 << 18)
            .fold(empty, |mut cells, i| {
                grid.mark(mesh.triangle(i).vertices().map(|v| v.as_dvec3()), &mut cells);
                cells
            })
            .reduce(empty, |mut a, b| {
                a.iter_mut().zip(b).for_each(|(a, b)| a.add(b));
                a
            });
        Some(grid)
    }

    /// Marks a triangle by samples no further apart than a cell.
    fn mark(&self, [a, b, c]: [DVec3; 3], cells: &mut [Cell]) {
        let (ab, ac) = (b - a, c - a);
        let longest = ab.length_squared().max(ac.length_squared()).max((c - b).length_squared());
        #[expect(clippy::cast_possible_truncation, reason = "at most 48·√3 cells long, doubled")]
        let n = (longest.sqrt() / (0.6 * self.cell)).ceil().clamp(1.0, 200.0) as u32;
        let normal = ab.cross(ac).try_normalize().unwrap_or(DVec3::ZERO);
        #[expect(clippy::cast_possible_truncation, reason = "between -1000 and 1000")]
        let normal = (normal * 1000.0).to_array().map(|x| x as i32);
        let sample = Cell { samples: 1, normal };
        let mut put = |p: DVec3| {
            if let Some(cell) = self.index(p).and_then(|i| cells.get_mut(i)) {
                cell.add(sample);
            }
        };
        if n == 1 {
            put(a + (ab + ac) / 3.0);
            return;
        }
        let step = 1.0 / f64::from(n);
        for i in 0..=n {
            for j in 0..=n - i {
                put(a + ab * (f64::from(i) * step) + ac * (f64::from(j) * step));
            }
        }
    }

    /// The cell of a point; points outside by less than a cell count as on the border.
    fn index(&self, p: DVec3) -> Option<usize> {
        let q = (p - self.min) / self.cell;
        let mut index = 0;
        for k in [2, 1, 0] {
            let size = self.size[k] as f64;
            if !(q[k] >= -0.01 && q[k] <= size + 0.01) {
                return None;
            }
            #[expect(clippy::cast_possible_truncation, reason = "clamped to the grid")]
            let i = q[k].clamp(0.0, size - 0.5) as usize;
            index = index * self.size[k] + i;
        }
        Some(index)
    }

    fn center(&self, [x, y, z]: [usize; 3]) -> DVec3 {
        self.min + (DVec3::new(x as f64, y as f64, z as f64) + 0.5) * self.cell
    }

    fn at(&self, p: DVec3) -> Option<Cell> {
        self.index(p).map(|i| self.cells[i])
    }

    /// How far (in cells) one sees along a direction, and whether one sees front sides; `None`
    /// if the view leaves the scene.
    fn look(&self, from: DVec3, direction: DVec3) -> Option<(f64, bool)> {
        let mut distance = 0.5;
        while let Some(cell) = self.at(from + direction * (distance * self.cell)) {
            if cell.samples > 0 {
                let normal = DVec3::from(cell.normal.map(f64::from));
                return Some((distance, normal.dot(direction) <= 0.0));
            }
            distance += 0.5;
        }
        None
    }

    fn survey(&self, from: DVec3) -> Survey {
        let mut s = Survey {
            closed: 0.0,
            front: 0.0,
            near: f64::INFINITY,
            far: 0.0,
            far_direction: DVec3::X,
            mean: 0.0,
        };
        let (mut hits, mut fronts) = (0.0_f64, 0.0);
        let down = self.look(from, DVec3::NEG_Y);
        for k in 0..DIRECTIONS {
            let (sin, cos) = (k as f64 * std::f64::consts::TAU / DIRECTIONS as f64).sin_cos();
            let direction = DVec3::new(cos, 0.0, sin);
            if let Some((distance, front)) = self.look(from, direction) {
                hits += 1.0;
                fronts += if front { 1.0 } else { 0.0 };
                s.near = s.near.min(distance);
                s.mean += distance;
                if distance > s.far {
                    (s.far, s.far_direction) = (distance, direction);
                }
            }
        }
        s.mean /= hits.max(1.0);
        if let Some((_, front)) = down {
            hits += 1.0;
            fronts += if front { 1.0 } else { 0.0 };
        }
        s.closed = hits / 17.0;
        s.front = fronts / hits.max(1.0);
        s
    }

    /// The view from inside, if this is an interior.
    fn interior(&self) -> Option<AutomaticView> {
        let [nx, ny, nz] = self.size;
        let free_inside = |cell: [usize; 3]| {
            let p = self.center(cell);
            if self.at(p)?.samples > 0 {
                return None;
            }
            let survey = self.survey(p);
            (survey.closed >= 0.8 && survey.front >= 0.6).then_some((p, survey))
        };
        let band = |y: usize, low: usize, high: usize| 100 * y >= low * ny && 100 * y <= high * ny;
        let middle = |i: usize, n: usize| 4 * i >= n && 4 * i < 3 * n;
        let cells: Vec<[usize; 3]> = (0..nx * ny * nz)
            .map(|i| [i % nx, i / nx % ny, i / (nx * ny)])
            .filter(|&[_, y, _]| band(y, 15, 65))
            .collect();
        let found: Vec<_> = cells.par_iter().map(|&cell| free_inside(cell)).collect();
        let is_middle = |&[x, _, z]: &[usize; 3]| middle(x, nx) && middle(z, nz);
        let all = cells.iter().filter(|c| is_middle(c)).count();
        let hollow = cells.iter().zip(&found).filter(|(c, f)| is_middle(c) && f.is_some()).count();
        if all == 0 || 5 * hollow < 2 * all {
            return None;
        }
        // At about eye level, where the view is long but nothing stands close.
        let mut best: Option<(f64, DVec3, &Survey)> = None;
        for (cell, found) in cells.iter().zip(&found) {
            let Some((p, survey)) = found else { continue };
            if !band(cell[1], 22, 45) {
                continue;
            }
            // A narrow passage is long too, but says little about the scene.
            let score = survey.far * survey.near.min(4.0);
            if best.is_none_or(|(s, _, _)| score > s) {
                best = Some((score, *p, survey));
            }
        }
        let (_, eye, survey) = best?;
        let camera = Camera::facing(eye.as_vec3(), survey.far_direction, Vec3::Y, 1.0);
        Some(AutomaticView { camera, inside: true, lamp: self.lamp(eye, survey) })
    }

    /// A lamp between the eye and the ceiling, if the ceiling is closed; bright enough for an
    /// irradiance of about 2 at the walls.
    fn lamp(&self, eye: DVec3, survey: &Survey) -> Option<Light> {
        let up = |x: f64, z: f64| self.look(eye, DVec3::new(x, 1.0, z).normalize());
        let slanted = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0), (0.5, 0.5), (-0.5, -0.5)];
        let (height, _) = up(0.0, 0.0)?;
        if slanted.iter().filter(|(x, z)| up(*x, *z).is_some()).count() < 5 {
            return None;
        }
        let forward = survey.far_direction * (0.35 * survey.far);
        let position = eye + (forward + DVec3::Y * (0.5 * height)) * self.cell;
        let reach = survey.mean.max(height) * self.cell;
        #[expect(clippy::cast_possible_truncation, reason = "an intensity in f32 is enough")]
        let intensity = Vec3::splat((2.0 * reach * reach).min(1e30) as f32);
        Some(Light {
            kind: LightKind::Point,
            position: position.as_vec3(),
            direction: Vec3::NEG_Y,
            intensity,
        })
    }
}
