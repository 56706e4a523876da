//! Scenes of a few clusters of geometry, and what a camera in them gives to count.

use serde::{Deserialize, Serialize};

/// What a low-resolution sampler counts in a view, by the names of Ganestam and Doggett's Table 5.
/// Rays, nodes and triangles are means over the pixels of the image.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Counters {
    /// Pixels at a render scale of 1.
    pub pixels: f64,
    /// p_t: nodes that a primary ray traverses.
    pub primary_traversals: f64,
    /// p_i: triangles that a primary ray intersects.
    pub primary_intersections: f64,
    /// Nodes that a shadow ray traverses, where there is one for the pixel.
    pub shadow_traversals: f64,
    /// Triangles that a shadow ray intersects.
    pub shadow_intersections: f64,
    /// t_v: share of the pixels that show a surface.
    pub visible: f64,
    /// a_t: nodes that an ambient occlusion ray traverses, over all pixels.
    pub ao_traversals: f64,
    /// a_w: triangles that an ambient occlusion ray intersects, for a pixel that shows a surface.
    pub ao_intersections: f64,
    /// m: share of neighbouring rays that end in the same node, 0 to 1.
    pub coalescing: f64,
    /// Share of the pixels that show a mirror.
    pub mirrors: f64,
    /// The radius that ambient occlusion was counted with.
    pub ao_radius: f64,
}

/// What the device feels and no sampler counts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Hidden {
    /// Bytes of nodes and triangles that the view touches.
    pub working_set: f64,
    /// Standard deviation of the work of a pixel over its mean: how long the slowest lanes of a warp
    /// keep the others waiting.
    pub spread: f64,
    /// Deepest level of the tree that the view reaches.
    pub depth: f64,
}

/// A view: what can be counted and what cannot.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct View {
    /// What a perfect sampler would count.
    pub counters: Counters,
    /// What it would miss.
    pub hidden: Hidden,
}

/// A lump of geometry: a figure, a tree, a hut, a wall.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cluster {
    /// Centre on the ground, in metres.
    pub centre: [f64; 2],
    /// Radius in metres, above 0.
    pub radius: f64,
    /// Height in metres, above 0.
    pub height: f64,
    /// Number of triangles, at least 1.
    pub triangles: f64,
    /// Share of the rays through its middle that it stops, 0 to 1: 1 for a wall, less for leaves.
    pub opacity: f64,
    /// Nodes a ray visits in it for each level of its tree: near 1 for a plain surface, above 2 where
    /// boxes overlap, as in leaves.
    pub clutter: f64,
    /// Share of its surface that mirrors.
    pub mirror: f64,
}

/// Clusters on a ground under a sky.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scene {
    /// The lumps.
    pub clusters: Vec<Cluster>,
    /// Triangles of the ground.
    pub ground_triangles: f64,
    /// Nodes a ray visits in the ground for each level of its tree.
    pub ground_clutter: f64,
    /// Share of what clusters leave free that is ground, the rest being sky.
    pub ground_share: f64,
    /// Diagonal in metres.
    pub size: f64,
}

/// Where the camera is and looks.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Position on the ground, in metres.
    pub position: [f64; 2],
    /// Direction of view in radians, 0 along x.
    pub heading: f64,
}

/// Columns of rays that a view is summed over, and the angle that they span.
const COLUMNS: u32 = 96;
const FIELD_OF_VIEW: f64 = 1.1;
/// Pixels of the image: 1024 × 768.
const PIXELS: f64 = 786_432.0;
/// Bytes of the tree for each triangle: its vertices and two nodes.
const BYTES_A_TRIANGLE: f64 = 100.0;
/// Radius that ambient occlusion is counted with.
const AO_RADIUS: f64 = 0.1;

/// What one column sums up.
#[derive(Clone, Copy, Default)]
struct Sums {
    steps: f64,
    tests: f64,
    shadow_steps: f64,
    shadow_tests: f64,
    visible: f64,
    ao_steps: f64,
    ao_tests: f64,
    coherence: f64,
    mirrors: f64,
    bytes: f64,
}

impl Scene {
    /// Triangles of everything.
    pub fn triangles(&self) -> f64 {
        self.ground_triangles + self.clusters.iter().map(|c| c.triangles).sum::<f64>()
    }

    /// Levels of the tree of the whole scene.
    fn levels(&self) -> f64 {
        self.triangles().max(2.0).log2()
    }

    /// What a camera sees.
    pub fn view(&self, camera: &Camera) -> View {
        let columns: Vec<Sums> = (0..COLUMNS)
            .map(|i| {
                let across = (f64::from(i) + 0.5) / f64::from(COLUMNS) - 0.5;
                self.column(camera, camera.heading + across * FIELD_OF_VIEW)
            })
            .collect();
        let mean =
            |field: fn(&Sums) -> f64| columns.iter().map(field).sum::<f64>() / f64::from(COLUMNS);
        let visible = mean(|c| c.visible);
        let steps = mean(|c| c.steps);
        let variance = mean(|c| c.steps * c.steps) - steps * steps;
        let shown = visible.max(1e-9);
        let deepest = self
            .clusters
            .iter()
            .filter(|cluster| self.covers(camera, cluster))
            .map(|cluster| cluster.triangles.max(2.0).log2() * (1.0 + 0.15 * cluster.clutter))
            .fold(self.levels(), f64::max);
        View {
            counters: Counters {
                pixels: PIXELS,
                primary_traversals: steps,
                primary_intersections: mean(|c| c.tests),
                shadow_traversals: mean(|c| c.shadow_steps),
                shadow_intersections: mean(|c| c.shadow_tests),
                visible,
                ao_traversals: mean(|c| c.ao_steps),
                ao_intersections: mean(|c| c.ao_tests) / shown,
                coalescing: (mean(|c| c.coherence) / shown).clamp(0.0, 1.0),
                mirrors: mean(|c| c.mirrors),
                ao_radius: AO_RADIUS,
            },
            hidden: Hidden {
                working_set: mean(|c| c.bytes),
                spread: variance.max(0.0).sqrt() / steps.max(1e-9),
                depth: deepest,
            },
        }
    }

    /// Distance along a heading and share of the column that a cluster takes, where it takes any.
    fn crossing(camera: &Camera, heading: f64, cluster: &Cluster) -> Option<(f64, f64, f64)> {
        let to = [cluster.centre[0] - camera.position[0], cluster.centre[1] - camera.position[1]];
        let (sin, cos) = heading.sin_cos();
        let along = to[0] * cos + to[1] * sin;
        let beside = (to[1] * cos - to[0] * sin).abs() / cluster.radius;
        let chord = (1.0 - beside * beside).max(0.0).sqrt();
        let exit = along + cluster.radius * chord;
        (chord > 0.0 && exit > 0.0).then(|| {
            let distance = (along - cluster.radius * chord).max(0.3);
            let tall = (cluster.height / (distance * 0.8)).min(1.0);
            (distance, chord, tall)
        })
    }

    fn covers(&self, camera: &Camera, cluster: &Cluster) -> bool {
        [-0.4, -0.2, 0.0, 0.2, 0.4].iter().any(|across| {
            Self::crossing(camera, camera.heading + across * FIELD_OF_VIEW, cluster).is_some()
        })
    }

    /// Follows the rays of one column of pixels front to back.
    fn column(&self, camera: &Camera, heading: f64) -> Sums {
        let mut crossed: Vec<(f64, f64, f64, &Cluster)> = self
            .clusters
            .iter()
            .filter_map(|cluster| {
                Self::crossing(camera, heading, cluster)
                    .map(|(distance, chord, tall)| (distance, chord, tall, cluster))
            })
            .collect();
        crossed.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Every ray visits the top of the tree.
        let mut sums = Sums { steps: 0.35 * self.levels(), ..Sums::default() };
        let mut open = 1.0;
        for (distance, chord, tall, cluster) in crossed {
            let enters = open * tall;
            let stopped = enters * (cluster.opacity * (0.4 + 0.6 * chord)).min(1.0);
            let levels = cluster.triangles.max(2.0).log2();
            let steps = cluster.clutter * levels * (0.5 + 0.5 * chord);
            sums.steps += enters * steps;
            sums.tests += enters * (0.6 + 0.6 * cluster.clutter) * (1.0 + 0.5 * chord);
            // Pixels for each of its triangles: how alike the paths of neighbours are.
            let height = PIXELS.sqrt() * cluster.height / (distance * 0.8);
            let pixels = height * height * cluster.radius / cluster.height;
            let alike = (0.25 + 0.09 * (1.0 + 40.0 * pixels / cluster.triangles).log2()).min(0.95);
            self.shade(
                &mut sums,
                stopped,
                cluster.clutter,
                levels,
                alike / (0.6 + 0.25 * cluster.clutter),
            );
            sums.mirrors += stopped * cluster.mirror;
            sums.bytes += enters * cluster.triangles * BYTES_A_TRIANGLE * 0.6;
            open -= stopped;
        }
        let ground = open * self.ground_share;
        let levels = self.ground_triangles.max(2.0).log2();
        sums.steps += ground * self.ground_clutter * levels;
        sums.tests += ground * (0.9 + 0.6 * self.ground_clutter);
        sums.bytes += ground * self.ground_triangles * BYTES_A_TRIANGLE * 0.3;
        self.shade(&mut sums, ground, self.ground_clutter, levels, 0.8);
        sums
    }

    /// Adds what follows where primary rays end on a surface.
    fn shade(&self, sums: &mut Sums, share: f64, clutter: f64, levels: f64, alike: f64) {
        sums.visible += share;
        sums.coherence += share * alike;
        sums.shadow_steps += share * (0.45 * self.levels() + 0.7 * clutter * levels);
        sums.shadow_tests += share * (0.6 + 0.5 * clutter);
        sums.ao_steps += share * (0.15 * self.levels() + 0.6 * clutter * levels);
        sums.ao_tests += share * (0.3 + 0.5 * clutter);
    }

    /// About the thesis's fairy scene: 174,000 triangles, five figures on a forest floor, mushrooms
    /// and a wall of one side of the clearing, 40 m east.
    pub fn fairy() -> Self {
        let figure = |x: f64, y: f64, triangles: f64| Cluster {
            centre: [x, y],
            radius: 0.9,
            height: 2.2,
            triangles,
            opacity: 0.9,
            clutter: 2.7,
            mirror: 0.05,
        };
        let shrub = |x: f64, y: f64| Cluster {
            centre: [x, y],
            radius: 2.2,
            height: 1.6,
            triangles: 9_000.0,
            opacity: 0.55,
            clutter: 3.2,
            mirror: 0.0,
        };
        Self {
            clusters: vec![
                figure(0.0, 0.0, 34_000.0),
                figure(2.4, 1.1, 26_000.0),
                figure(-1.8, 2.2, 22_000.0),
                figure(-2.9, -1.6, 16_000.0),
                figure(1.2, -2.7, 14_000.0),
                shrub(3.6, -2.9),
                shrub(-3.3, 3.4),
                shrub(-4.2, -3.1),
                wall(40.0, 0.0),
            ],
            ground_triangles: 35_000.0,
            ground_clutter: 2.1,
            ground_share: 0.75,
            size: 40.0,
        }
    }

    /// About the thesis's cabin scene: 422,000 triangles, most of them in one detailed tree beside a
    /// cabin, and the same wall.
    pub fn cabin() -> Self {
        Self {
            clusters: vec![
                Cluster {
                    centre: [0.0, 0.0],
                    radius: 3.6,
                    height: 7.0,
                    triangles: 310_000.0,
                    opacity: 0.75,
                    clutter: 3.6,
                    mirror: 0.0,
                },
                Cluster {
                    centre: [6.5, 3.0],
                    radius: 3.2,
                    height: 3.6,
                    triangles: 42_000.0,
                    opacity: 1.0,
                    clutter: 2.2,
                    mirror: 0.12,
                },
                Cluster {
                    centre: [-5.0, 6.0],
                    radius: 1.8,
                    height: 1.5,
                    triangles: 20_000.0,
                    opacity: 0.6,
                    clutter: 3.0,
                    mirror: 0.0,
                },
                wall(40.0, 0.0),
            ],
            ground_triangles: 50_000.0,
            ground_clutter: 2.2,
            ground_share: 0.8,
            size: 50.0,
        }
    }
}

/// A plain wall: few triangles, nothing behind it seen.
fn wall(x: f64, y: f64) -> Cluster {
    Cluster {
        centre: [x, y],
        radius: 12.0,
        height: 30.0,
        triangles: 64.0,
        opacity: 1.0,
        clutter: 1.0,
        mirror: 0.0,
    }
}
