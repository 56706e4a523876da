//! Saves and loads BVHs, binary and wide, and refuses damaged or hostile files.
//!
//! ```
//! use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3};
//! use niwaki_tree_file::{ReadError, TreeFile};
//!
//! let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
//! let bvh = Bvh { nodes: vec![BvhNode::leaf(unit, 0, 2)], prim_ids: vec![1, 0] };
//! let mut file = Vec::new(); // or `bvh.save("tree.bvh")`
//! bvh.write_to(&mut file)?;
//! assert_eq!(Bvh::read_from(&file[..])?, bvh);
//!
//! file[70] ^= 1;
//! assert!(matches!(Bvh::read_from(&file[..]), Err(ReadError::Damaged { .. })));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Format
//! All numbers are little-endian, on every machine. A header of 64 bytes:
//!
//! | bytes | hold |
//! |---|---|
//! | 0..8 | `89 4E 49 57 41 4B 49 0A`: `\x89NIWAKI\n` |
//! | 8..12 | version: 1 |
//! | 12..16 | children a node: 2 for [`Bvh`](niwaki_core::Bvh), 4, 8 or 16 for [`WideBvh`](niwaki_wide::WideBvh) |
//! | 16..20 | number of nodes |
//! | 20..24 | number of primitive references |
//! | 24..32 | bytes of the payload |
//! | 32..56 | the box around everything: smallest x, y, z, largest x, y, z as `f32` |
//! | 56..60 | CRC-32 (IEEE 802.3) of the payload |
//! | 60..64 | CRC-32 of bytes 0..60 |
//!
//! The payload is the nodes, then the primitive ids, all of it 32-bit words. A binary node is the
//! eight words of [`BvhNode`](niwaki_core::BvhNode) in order; a wide one the rows of its boxes, its
//! child words, its first reference, its number of references and its number of used slots
//! ([`WideNode`](niwaki_wide::WideNode)), without padding.
//!
//! # What loading guarantees
//! A file that was changed in one place, cut short or lengthened is an error that says which. One
//! that was made up with matching checksums is checked as if it came from an enemy: links without
//! cycles, each node with one parent, ranges that are disjoint and complete, finite boxes. So
//! whatever loads can be traversed; whether its ids fit a mesh, scenes check when they are made.
//! Whether boxes enclose what is below them is not checked, and a tree where they do not loses
//! hits (`niwaki_metrics::validate` checks all, with the mesh). Memory grows with what was read, not
//! with what a header claims. Nothing here recurses or panics.
//!
//! There are no feature flags.

mod check;
mod error;
mod format;
mod header;

pub use error::{ReadError, TreeFault};
pub use format::TreeFile;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
