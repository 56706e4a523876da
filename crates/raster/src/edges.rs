//! The edges of a mesh with the triangles that meet at each.

use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use niwaki_core::{TriangleMesh, to_u32};

/// An edge and where its triangles are listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Edge {
    /// The lower of its two vertices.
    pub a: u32,
    /// The higher.
    pub b: u32,
    /// First of its entries in [`Edges::incidences`].
    pub first: u32,
    /// Number of them: 1 at a border, 2 inside a surface, any number elsewhere.
    pub count: u32,
}

/// The edges of a mesh, whether it is closed or not. Vertices at exactly one place count as one
/// (the first of them stands for all), so that seams of normals or texture coordinates are no
/// borders. Edges without length have no triangles.
///
/// ```
/// use niwaki_core::{TriangleMesh, glam::Vec3};
/// use niwaki_raster::Edges;
///
/// let square = vec![Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
/// let edges = Edges::of(&TriangleMesh::new(square, vec![[0, 1, 2], [0, 2, 3]])?);
/// assert_eq!(edges.edges.len(), 5);
/// assert_eq!(edges.edges.iter().filter(|e| e.count == 1).count(), 4); // the border
/// # Ok::<(), niwaki_core::MeshError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Edges {
    /// Ordered by their vertices.
    pub edges: Vec<Edge>,
    /// Triangles of each edge: 2 t if triangle t has it from `a` to `b`, 2 t + 1 if from `b` to
    /// `a`. Triangles are ordered.
    pub incidences: Vec<u32>,
}

impl Edges {
    /// Finds the edges of a mesh of fewer than 2³¹ triangles, in O(n log n).
    #[must_use]
    pub fn of(mesh: &TriangleMesh) -> Self {
        let weld = weld(mesh.positions());
        let mut halves = Vec::with_capacity(3 * mesh.len());
        for (t, corners) in (0_u32..).zip(mesh.indices()) {
            let v = corners.map(|i| weld[i as usize]);
            for k in 0..3 {
                let (from, to) = (v[k], v[(k + 1) % 3]);
                if from != to {
                    let key = u64::from(from.min(to)) << 32 | u64::from(from.max(to));
                    halves.push((key, 2 * t + u32::from(from > to)));
                }
            }
        }
        halves.sort_unstable();
        let mut edges = Vec::with_capacity(halves.len() / 2);
        let mut first = 0;
        for run in halves.chunk_by(|x, y| x.0 == y.0) {
            let count = to_u32(run.len());
            let low = |x: u64| u32::try_from(x & u64::from(u32::MAX)).unwrap_or(0);
            edges.push(Edge { a: low(run[0].0 >> 32), b: low(run[0].0), first, count });
            first += count;
        }
        Self { edges, incidences: halves.into_iter().map(|(_, incidence)| incidence).collect() }
    }

    /// What is left of an edge when each of its triangles counts as `facing` says (1 towards the
    /// light, −1 with its back, 0 not at all): so many walls from `a` to `b`, or from `b` to `a` if
    /// negative. The CPU twin of the kernel.
    #[must_use]
    pub fn net(&self, edge: &Edge, facing: impl Fn(u32) -> i32) -> i32 {
        let all = self.triangles_of(edge).iter();
        all.map(|i| if i & 1 == 0 { facing(i >> 1) } else { -facing(i >> 1) }).sum()
    }

    /// The part of [`Edges::incidences`] that is an edge's; none for an edge of another mesh.
    #[must_use]
    pub fn triangles_of(&self, edge: &Edge) -> &[u32] {
        let range = edge.first as usize..(edge.first + edge.count) as usize;
        self.incidences.get(range).unwrap_or(&[])
    }
}

/// For each vertex the first at its place.
fn weld(positions: &[Vec3]) -> Vec<u32> {
    // Adding zero makes one number of the two zeros.
    let place = |i: u32| positions[i as usize].to_array().map(|x| (x + 0.0).to_bits());
    let mut order: Vec<u32> = (0..to_u32(positions.len())).collect();
    order.sort_unstable_by_key(|&i| (place(i), i));
    let mut weld = vec![0; positions.len()];
    for run in order.chunk_by(|&a, &b| place(a) == place(b)) {
        run.iter().for_each(|&i| weld[i as usize] = run[0]);
    }
    weld
}
