//! Queries beyond the closest hit and any hit.

mod batch;
mod custom;
pub(crate) mod hits;
mod masks;
mod mesh;
mod nearest;
mod overlap;
pub(crate) mod visitor;

pub use batch::{Batches, LengthMismatch};
pub use custom::{CustomScene, Primitives};
pub use hits::HitQueries;
pub use masks::MaskedScene;
pub use mesh::MeshQueries;
pub use nearest::{NearestPoint, nearest_on_triangle};
pub use overlap::triangle_overlaps_box;
