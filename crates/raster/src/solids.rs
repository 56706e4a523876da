//! The closed parts of a mesh, and how often they wind around a point.

use crate::Edges;
use glam::{DVec3, Vec3};
use niwaki_core::{Aabb, TriangleMesh, to_u32};

/// The closed, consistently oriented parts of a mesh: triangles that are joined by edges, each edge
/// used as often in one direction as in the other. Whether they intersect themselves or are wound
/// inside out does not matter.
///
/// The shadow volumes of such a part need be cast from one side of it only, from the triangles that
/// face the light or from those that turn their back. Let a ray from the light to a visible point
/// cross f of the former and b of the latter before it ends. Crossings change the winding number of
/// the part by one up or down, so f − b is its winding number around the point less that around
/// the light. No triangle lies between the point and the eye, so that is the eye's less the light's,
/// d. If d ≥ 0 and the ray crosses anything at all, f > 0; if d ≤ 0, b > 0: casters of one side
/// shadow the same points as those of both, with half the caps and half the walls.
///
/// ```
/// use niwaki_core::{TriangleMesh, glam::Vec3};
/// use niwaki_raster::{Edges, Solids};
///
/// let tetrahedron = TriangleMesh::new(
///     vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z],
///     vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]],
/// )?;
/// let solids = Solids::of(&tetrahedron, &Edges::of(&tetrahedron));
/// assert_eq!(solids.len(), 1);
/// assert_eq!(solids.winding(&tetrahedron, 0, Vec3::splat(0.2)), 1);
/// assert_eq!(solids.winding(&tetrahedron, 0, Vec3::splat(0.8)), 0);
/// # Ok::<(), niwaki_core::MeshError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Solids {
    of_triangle: Vec<u32>,
    /// Triangles by solid, and where each solid's begin; one more entry than there are solids.
    triangles: Vec<u32>,
    first: Vec<u32>,
    bounds: Vec<Aabb>,
}

impl Solids {
    /// Finds them from the mesh's edges, in O(n α(n)).
    #[must_use]
    pub fn of(mesh: &TriangleMesh, edges: &Edges) -> Self {
        let mut parts = Parts::new(mesh.len());
        for edge in &edges.edges {
            for pair in edges.triangles_of(edge).windows(2) {
                parts.join(pair[0] >> 1, pair[1] >> 1);
            }
        }
        // Open until an edge is found, as a triangle that is a point has none.
        let mut open = vec![true; mesh.len()];
        for incidence in &edges.incidences {
            open[parts.root(incidence >> 1) as usize] = false;
        }
        for edge in &edges.edges {
            if edges.net(edge, |_| 1) != 0 {
                let any = edges.triangles_of(edge)[0] >> 1;
                open[parts.root(any) as usize] = true;
            }
        }
        let mut number_of_root = vec![0; mesh.len()];
        let mut found = Self { of_triangle: vec![0; mesh.len()], ..Self::default() };
        let mut counts: Vec<u32> = Vec::new();
        for t in 0..to_u32(mesh.len()) {
            let root = parts.root(t) as usize;
            if open[root] {
                continue;
            }
            if number_of_root[root] == 0 {
                counts.push(0);
                found.bounds.push(Aabb::EMPTY);
                number_of_root[root] = to_u32(counts.len());
            }
            let number = number_of_root[root];
            found.of_triangle[t as usize] = number;
            counts[number as usize - 1] += 1;
            let corners = mesh.indices()[t as usize].map(|i| mesh.positions()[i as usize]);
            let bounds = &mut found.bounds[number as usize - 1];
            *bounds = bounds.union(Aabb::from_points(corners));
        }
        found.first.push(0);
        for count in counts {
            found.first.push(found.first.last().copied().unwrap_or(0) + count);
        }
        let mut next = found.first.clone();
        found.triangles = vec![0; found.first.last().copied().unwrap_or(0) as usize];
        for (t, number) in (0..).zip(&found.of_triangle) {
            if let Some(solid) = number.checked_sub(1) {
                found.triangles[next[solid as usize] as usize] = t;
                next[solid as usize] += 1;
            }
        }
        found
    }

    /// How many there are.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.bounds.len()
    }

    /// Whether there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.bounds.is_empty()
    }

    /// For each triangle of the mesh the number of its solid, counted from 1; 0 if it is of none.
    #[must_use]
    pub fn of_triangles(&self) -> &[u32] {
        &self.of_triangle
    }

    /// How often a solid of `mesh`, the mesh that it was found in, winds around a point: 1 within
    /// one whose triangles are counter-clockwise as seen from outside, −1 if they are clockwise,
    /// more where it encloses the point more than once, 0 outside and for a number that is none.
    ///
    /// Crossings of the ray along x are counted, in double precision: in O(1) outside of the
    /// solid's box, else in O(its triangles). A point on the surface counts to either side.
    #[must_use]
    pub fn winding(&self, mesh: &TriangleMesh, solid: usize, point: Vec3) -> i32 {
        if self.bounds.get(solid).is_none_or(|bounds| !bounds.contains_point(point)) {
            return 0;
        }
        let range = self.first[solid] as usize..self.first[solid + 1] as usize;
        let p = point.as_dvec3();
        let crossings = self.triangles[range].iter().map(|&t| {
            let corners = mesh.indices()[t as usize].map(|i| mesh.positions()[i as usize]);
            crossing(corners.map(|c| c.as_dvec3() - p))
        });
        crossings.sum()
    }

    /// The winding number of each solid around a point.
    pub(crate) fn windings(&self, mesh: &TriangleMesh, point: Vec3) -> Vec<i32> {
        (0..self.len()).map(|solid| self.winding(mesh, solid, point)).collect()
    }
}

/// How the ray from the origin along x crosses a triangle: 1 from inside out, −1 from outside in, 0
/// not at all.
///
/// In the plane of y and z that is the winding number of the triangle around the origin. An edge
/// adds to it the negative of what it adds in the triangle on its other side, bit for bit, so a ray
/// through an edge or a corner crosses a closed surface as often as one right beside it.
fn crossing([a, b, c]: [DVec3; 3]) -> i32 {
    let edge = |p: DVec3, q: DVec3| match (p.z <= 0.0, q.z <= 0.0) {
        (true, false) => i32::from(p.y * q.z - p.z * q.y > 0.0),
        (false, true) => -i32::from(q.y * p.z - q.z * p.y > 0.0),
        _ => 0,
    };
    let around = edge(a, b) + edge(b, c) + edge(c, a);
    if around == 0 {
        return 0;
    }
    let ahead = (b - a).cross(c - a).dot(a) * f64::from(around) > 0.0;
    if ahead { around } else { 0 }
}

/// Disjoint sets with paths halved.
struct Parts(Vec<u32>);

impl Parts {
    fn new(count: usize) -> Self {
        Self((0..to_u32(count)).collect())
    }

    fn root(&mut self, mut item: u32) -> u32 {
        while self.0[item as usize] != item {
            let above = self.0[self.0[item as usize] as usize];
            self.0[item as usize] = above;
            item = above;
        }
        item
    }

    fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        // Under the lower number: trees stay flat where neighbours are joined in order.
        self.0[a.max(b) as usize] = a.min(b);
    }
}
