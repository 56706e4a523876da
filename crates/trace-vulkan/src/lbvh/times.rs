//! How long the stages took.

use crate::Timings;

/// Seconds that the stages of a build took on the device; all 0 where it has no timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LbvhTimes {
    /// References to triangles, if they were computed on the device.
    pub triangles: f64,
    /// Bounds of primitives and centroids, and the check of the input.
    pub bounds: f64,
    /// Morton codes.
    pub codes: f64,
    /// The radix sort, all passes.
    pub sort: f64,
    /// The hierarchy.
    pub hierarchy: f64,
    /// Boxes from the leaves up.
    pub boxes: f64,
    /// Merging leaves by the surface area heuristic.
    pub leaves: f64,
    /// Places of nodes, by prefix sums.
    pub places: f64,
    /// Writing the nodes.
    pub nodes: f64,
}

impl LbvhTimes {
    /// Names and seconds of all stages, in order.
    #[must_use]
    pub const fn stages(&self) -> [(&'static str, f64); 9] {
        [
            ("triangles", self.triangles),
            ("bounds", self.bounds),
            ("codes", self.codes),
            ("sort", self.sort),
            ("hierarchy", self.hierarchy),
            ("boxes", self.boxes),
            ("leaves", self.leaves),
            ("places", self.places),
            ("nodes", self.nodes),
        ]
    }

    /// Seconds of all stages together.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.stages().iter().map(|(_, seconds)| seconds).sum()
    }

    /// Sums the marks of a batch that [`crate::LbvhWorkspace::record`] was recorded in, by stage. Marks
    /// of other commands are left out.
    #[must_use]
    pub fn of(timings: &Timings) -> Self {
        let mut times = Self::default();
        for (label, seconds) in timings.passes() {
            let stage = match label {
                "lbvh triangles" => &mut times.triangles,
                "lbvh bounds" => &mut times.bounds,
                "lbvh codes" => &mut times.codes,
                "lbvh sort" => &mut times.sort,
                "lbvh hierarchy" => &mut times.hierarchy,
                "lbvh boxes" => &mut times.boxes,
                "lbvh leaves" => &mut times.leaves,
                "lbvh places" => &mut times.places,
                "lbvh nodes" => &mut times.nodes,
                _ => continue,
            };
            *stage += seconds;
        }
        times
    }
}
