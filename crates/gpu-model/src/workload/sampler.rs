//! Sampling a view.

use super::{LightSample, View, Workload};
use niwaki_core::{
    Hit, Ray, TriangleMesh,
    glam::{DVec3, Vec2, Vec3},
};
use niwaki_trace::{BinaryScene, Counts, QuantisedScene, Walk, WideScene};

/// A CPU kernel that tells the work of each ray. Use the one whose tree is laid out like the GPU's,
/// as steps of a wide tree are fewer than of a binary one.
pub trait CountingKernel: Send + Sync {
    /// The nearest hit, the work it took, and where the ray ended.
    fn closest(&self, ray: &Ray) -> (Hit, Walk);
    /// Whether anything is hit, and the work it took.
    fn any(&self, ray: &Ray) -> (bool, Counts);
}

macro_rules! counting {
    ($scene:ty, $closest:ident, $any:ident) => {
        impl CountingKernel for $scene {
            fn closest(&self, ray: &Ray) -> (Hit, Walk) {
                self.$closest(ray)
            }
            fn any(&self, ray: &Ray) -> (bool, Counts) {
                self.$any(ray)
            }
        }
    };
}

counting!(BinaryScene, closest_hit_walked, any_hit_counted);
// By the instructions that the processor has.
counting!(WideScene<4>, closest_hit_traced, any_hit_traced);
counting!(WideScene<8>, closest_hit_traced, any_hit_traced);
counting!(WideScene<16>, closest_hit_traced, any_hit_traced);
counting!(QuantisedScene<4>, closest_hit_traced, any_hit_traced);
counting!(QuantisedScene<8>, closest_hit_traced, any_hit_traced);
counting!(QuantisedScene<16>, closest_hit_traced, any_hit_traced);

/// Where in the image the samples are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Pattern {
    /// The middles of the cells of a grid. Patterns in the scene may agree with the grid.
    Regular,
    /// A place at random in each cell.
    Jittered,
    /// The R₂ sequence (Roberts 2018) over the whole image: evenly spread in every part of it, and
    /// in no rows. The default.
    #[default]
    LowDiscrepancy,
    /// Adjacent pixels of a frame of the size that [`Sampling::frame`] says: each region is a block
    /// of them, placed at random in its part of the image. Other patterns spread the rays of a
    /// region over many pixels and so find less coalescing than the threads of a warp have; this
    /// one measures what they have, but sees less of the image. Ours, not the paper's.
    Blocks,
}

/// How a view is sampled.
#[derive(Clone, Debug, PartialEq)]
pub struct Sampling {
    /// Columns of samples. At least 1. Default 32.
    pub width: u32,
    /// Rows of samples. At least 1. Default 18.
    pub height: u32,
    /// Default [`Pattern::LowDiscrepancy`].
    pub pattern: Pattern,
    /// Columns and rows of samples of a region, in which rays that end at the same node count as
    /// coalesced. At least 1; of one there is nothing to coalesce. Default 4.
    pub region: u32,
    /// AO rays of each hit. Default 1: there are hundreds of hits.
    pub ao_rays: u32,
    /// How far they go, in units of the scene; endless rays go through everything. Default ∞.
    pub ao_radius: f32,
    /// Where shadow rays go. Default none.
    pub lights: Vec<LightSample>,
    /// Pixels of the frame, width and height: for [`Pattern::Blocks`]. Default 1280 × 720.
    pub frame: [u32; 2],
    /// Of everything random. The same seed gives the same workload. Default 0.
    pub seed: u64,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            width: 32,
            height: 18,
            pattern: Pattern::default(),
            region: 4,
            ao_rays: 1,
            ao_radius: f32::INFINITY,
            lights: Vec::new(),
            frame: [1280, 720],
            seed: 0,
        }
    }
}

impl Sampling {
    /// Four times the samples of the default.
    #[must_use]
    pub fn fine() -> Self {
        Self { width: 64, height: 36, ..Self::default() }
    }

    /// Samples a view: `None` if `go_on` said no before a row of samples.
    pub fn sample_while<K: CountingKernel + ?Sized>(
        &self,
        kernel: &K,
        mesh: &TriangleMesh,
        view: &View,
        mut go_on: impl FnMut() -> bool,
    ) -> Option<Workload> {
        let (width, height) = (self.width.max(1), self.height.max(1));
        let region = self.region.max(1);
        let regions = [width.div_ceil(region), height.div_ceil(region)];
        let mut sums = Sums::default();
        let mut samples = Vec::with_capacity(width as usize * height as usize);
        for row in 0..height {
            if !go_on() {
                return None;
            }
            for column in 0..width {
                let index = u64::from(row) * u64::from(width) + u64::from(column);
                let (place, cell) = self.place([column, row], index, regions);
                let (hit, walk) = kernel.closest(&view.ray(place.x, place.y));
                sums.primary += walk.counts;
                let before = sums.secondary();
                if hit.is_hit() && (hit.prim_id as usize) < mesh.len() {
                    self.secondary(kernel, mesh, view, (place, index), &hit, &mut sums);
                }
                samples.push(Sample {
                    cell,
                    // A ray that visits nothing ends outside of the scene, like others that do.
                    end: walk.end.unwrap_or(u64::MAX),
                    work: [steps(&walk.counts), sums.secondary() - before],
                });
            }
        }
        samples.sort_unstable_by_key(|sample| (sample.cell, sample.end));
        Some(sums.workload(&samples, self.ao_rays))
    }

    /// Samples a view on the calling thread.
    ///
    /// `mesh` is what the kernel was made of. A view that hits nothing gives a workload that
    /// [is empty](Workload::is_empty).
    ///
    /// ```
    /// # use niwaki_core::{Bvh, BvhNode, TriangleMesh, glam::Vec3};
    /// use niwaki_gpu_model::workload::{Sampling, View};
    /// use niwaki_trace::BinaryScene;
    ///
    /// let mesh = TriangleMesh::new(vec![Vec3::ZERO, Vec3::X, Vec3::Y], vec![[0, 1, 2]])?;
    /// let bvh = Bvh { nodes: vec![BvhNode::leaf(mesh.bounds(), 0, 1)], prim_ids: vec![0] };
    /// let scene = BinaryScene::new(&bvh, &mesh)?;
    /// let view = View::look_at(Vec3::new(0.3, 0.3, 2.0), Vec3::new(0.3, 0.3, 0.0), Vec3::Y, 0.9, 1.0);
    /// let workload = Sampling::default().sample(&scene, &mesh, &view);
    /// assert!(workload.visible_triangles > 0.1 && workload.primary_intersections <= 1.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub fn sample<K: CountingKernel + ?Sized>(
        &self,
        kernel: &K,
        mesh: &TriangleMesh,
        view: &View,
    ) -> Workload {
        self.sample_while(kernel, mesh, view, || true).unwrap_or_default()
    }

    /// Where in the image a sample is, from 0 to 1, and its region.
    fn place(&self, [column, row]: [u32; 2], index: u64, regions: [u32; 2]) -> (Vec2, u64) {
        let size = Vec2::new(self.width.max(1) as f32, self.height.max(1) as f32);
        let region = self.region.max(1);
        let own = [column / region, row / region];
        let id = |[x, y]: [u32; 2]| u64::from(y) * u64::from(regions[0]) + u64::from(x);
        let corner = Vec2::new(column as f32, row as f32);
        match self.pattern {
            Pattern::Regular => ((corner + 0.5) / size, id(own)),
            Pattern::Jittered => ((corner + uniform(self.seed, index)) / size, id(own)),
            Pattern::LowDiscrepancy => {
                let place = (r2(index) + uniform(self.seed, 0)).fract();
                let cell = place * Vec2::new(regions[0] as f32, regions[1] as f32);
                #[expect(
                    clippy::cast_possible_truncation,
                    clippy::cast_sign_loss,
                    reason = "within the regions, as places are from 0 to 1"
                )]
                let cell = [cell.x as u32, cell.y as u32];
                (place, id([cell[0].min(regions[0] - 1), cell[1].min(regions[1] - 1)]))
            }
            Pattern::Blocks => {
                let frame = Vec2::new(self.frame[0].max(1) as f32, self.frame[1].max(1) as f32);
                let cells = Vec2::new(regions[0] as f32, regions[1] as f32);
                let corner = Vec2::new(own[0] as f32, own[1] as f32);
                let place = (corner + uniform(self.seed, id(own))) / cells;
                let inside = Vec2::new((column % region) as f32, (row % region) as f32);
                // Whole pixels, and blocks that end at the image's edge begin before it.
                let last = (frame - Vec2::splat(region as f32)).max(Vec2::ZERO);
                let pixel = (place * frame).floor().min(last) + inside + 0.5;
                ((pixel / frame).min(Vec2::ONE), id(own))
            }
        }
    }

    /// The AO and shadow rays of a hit.
    fn secondary<K: CountingKernel + ?Sized>(
        &self,
        kernel: &K,
        mesh: &TriangleMesh,
        view: &View,
        (place, index): (Vec2, u64),
        hit: &Hit,
        sums: &mut Sums,
    ) {
        sums.hits += 1;
        let triangle = mesh.triangle(hit.prim_id as usize);
        let [a, b, c] = [triangle.v0, triangle.v1, triangle.v2].map(|v| v.as_dvec3());
        let normal = (b - a).cross(c - a).normalize_or_zero().as_vec3();
        let facing = view.ray(place.x, place.y).direction;
        let normal = if normal.dot(facing) > 0.0 { -normal } else { normal };
        let (u, v) = (f64::from(hit.u), f64::from(hit.v));
        let point = a + (b - a) * u + (c - a) * v;
        // Past the rounding of the point and of the next test, in units of the largest numbers that
        // occur: a ray that hit its own triangle would end too early, and its work be missing.
        let reach = [a, b, c].into_iter().fold(point.abs(), |most, v| most.max(v.abs()));
        let clearance = f64::from(f32::EPSILON) * 16.0 * reach.max_element();
        let origin = (point + DVec3::from(normal) * clearance).as_vec3();
        for i in 0..self.ao_rays {
            let stream = index * u64::from(self.ao_rays) + u64::from(i);
            let direction = hemisphere(normal, uniform(self.seed ^ 0x9e37_79b9, stream));
            let ray = Ray::new(origin, direction).with_range(0.0, self.ao_radius);
            sums.ao += kernel.any(&ray).1;
        }
        for light in &self.lights {
            let ray = match *light {
                LightSample::Point(to) => Ray::new(origin, to - origin).with_range(0.0, 1.0),
                LightSample::Directional(along) => Ray::new(origin, -along),
            };
            // Lights behind the surface take no ray.
            if ray.direction.dot(normal) > 0.0 {
                sums.shadow += kernel.any(&ray).1;
                sums.shadow_rays += 1;
            }
        }
    }
}

#[derive(Default)]
struct Sums {
    primary: Counts,
    ao: Counts,
    shadow: Counts,
    hits: u64,
    shadow_rays: u64,
}

/// A primary ray, and what it led to.
struct Sample {
    /// Its region.
    cell: u64,
    end: u64,
    /// Steps and triangles of the ray, and of the others from where it ends.
    work: [u64; 2],
}

const fn steps(counts: &Counts) -> u64 {
    counts.nodes + counts.triangles
}

impl Sums {
    const fn secondary(&self) -> u64 {
        steps(&self.ao) + steps(&self.shadow)
    }

    /// Samples are in the order of regions and ends.
    fn workload(&self, samples: &[Sample], ao_rays: u32) -> Workload {
        // Nothing over nothing is nothing.
        let per = |sum: u64, n: f64| if n > 0.0 { sum as f64 / n } else { 0.0 };
        let pixels = samples.len() as f64;
        let [primary_divergence, secondary_divergence] =
            [0, 1].map(|kind| divergence(samples, kind));
        let rays = f64::from(ao_rays);
        Workload {
            primary_traversals: per(self.primary.nodes, pixels),
            primary_intersections: per(self.primary.triangles, pixels),
            visible_triangles: per(self.hits, pixels),
            ao_traversals: per(self.ao.nodes, pixels * rays),
            ao_intersections: per(self.ao.triangles, self.hits as f64 * rays),
            coalescing: coalescing(samples),
            shadow_traversals: per(self.shadow.nodes, pixels),
            shadow_intersections: per(self.shadow.triangles, pixels),
            shadow_rays: per(self.shadow_rays, pixels),
            primary_divergence,
            secondary_divergence,
            samples: u32::try_from(samples.len()).unwrap_or(u32::MAX),
        }
    }
}

/// Of the rays of all regions but the first of each, those that end where another did before.
fn coalescing(samples: &[Sample]) -> f64 {
    let [mut followers, mut shared] = [0_u64; 2];
    for pair in samples.windows(2) {
        if pair[0].cell == pair[1].cell {
            followers += 1;
            shared += u64::from(pair[0].end == pair[1].end);
        }
    }
    if followers == 0 { 0.0 } else { shared as f64 / followers as f64 }
}

/// How much longer the longest ray of a region takes than the mean one, in all regions together.
fn divergence(samples: &[Sample], kind: usize) -> f64 {
    let [mut longest, mut all] = [0.0; 2];
    for region in samples.chunk_by(|a, b| a.cell == b.cell) {
        let work = || region.iter().map(|sample| sample.work[kind]);
        longest += region.len() as f64 * work().max().unwrap_or_default() as f64;
        all += work().sum::<u64>() as f64;
    }
    if all > 0.0 { longest / all - 1.0 } else { 0.0 }
}

/// A point of the R₂ sequence (Roberts 2018): multiples of the powers of the inverse plastic number.
fn r2(index: u64) -> Vec2 {
    const PLASTIC: f64 = 1.324_717_957_244_746;
    let at = |step: f64| (0.5 + step * index as f64).fract();
    let place = [at(1.0 / PLASTIC), at(1.0 / (PLASTIC * PLASTIC))];
    #[expect(clippy::cast_possible_truncation, reason = "places in an image")]
    let place = place.map(|x| x as f32);
    Vec2::from(place)
}

/// Two numbers from 0 to 1, by a hash of the seed and the index (SplitMix64, Steele et al. 2014).
fn uniform(seed: u64, index: u64) -> Vec2 {
    let mut z = seed.wrapping_add(index.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^= z >> 31;
    let unit = |bits: u64| (bits & 0xff_ffff) as f32 * 2.0_f32.powi(-24);
    Vec2::new(unit(z), unit(z >> 24))
}

/// A direction around a normal, by the cosine.
fn hemisphere(normal: Vec3, random: Vec2) -> Vec3 {
    if normal == Vec3::ZERO {
        return Vec3::Z;
    }
    let (radius, angle) = (random.x.sqrt(), random.y * std::f32::consts::TAU);
    let (x, y) = normal.any_orthonormal_pair();
    let (sin, cos) = angle.sin_cos();
    x * (radius * cos) + y * (radius * sin) + normal * (1.0 - random.x).max(0.0).sqrt()
}
