//! Wide BVH layouts collapsed from binary trees.
//!
//! ```
//! use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3};
//! use niwaki_wide::{Bvh8, Child, CollapseSettings};
//!
//! // Two triangles far apart, each in a leaf of its own.
//! let unit = |x: f32| Aabb::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 0.0));
//! let bvh = Bvh {
//!     nodes: vec![
//!         BvhNode::inner(unit(0.0).union(unit(9.0)), 1),
//!         BvhNode::leaf(unit(0.0), 0, 1),
//!         BvhNode::leaf(unit(9.0), 1, 1),
//!     ],
//!     prim_ids: vec![7, 3],
//! };
//! let wide = Bvh8::collapse(&bvh, &CollapseSettings::default())?;
//! assert_eq!(wide.nodes().len(), 1);
//! assert_eq!(wide.nodes()[0].child(0), Some(Child::Leaf { first: 0, count: 1 }));
//! assert_eq!(wide.prim_ids(), [7, 3]);
//! # Ok::<(), niwaki_wide::CollapseError>(())
//! ```
//!
//! A wide node holds the boxes of 4, 8 or 16 children as structure of arrays, so that one SIMD
//! instruction tests all of them against a ray (Wald, Benthin and Boulos 2008; thesis section 3.10
//! and paper V, section 4.2). [`WideBvh::collapse`] makes such nodes from any binary tree; which
//! nodes of it become children of a wide one, a [`CollapseMethod`] says:
//!
//! | method | how | source |
//! |---|---|---|
//! | [`CollapseMethod::Greedy`] | opens the child with the largest surface area until the node is full | thesis section 3.10; Wald, Benthin and Boulos 2008 |
//! | [`CollapseMethod::Optimal`] | least expected cost of the whole tree ([`WideBvh::cost`]) by dynamic programming; the default | Ylitie, Karras and Laine 2017, section 3.1 |
//!
//! Small subtrees become one leaf of up to as many references as the tree is wide, because a
//! vector unit tests them at about the price of one. [`WideCosts`] says what a node, a leaf and a
//! reference cost.
//!
//! [`QuantisedNode`] is a node of half the size, whose boxes are rounded outward to a grid of 256
//! steps an axis.
//!
//! The result does not depend on the number of threads, and no input can make it recurse: nodes
//! are laid out breadth first, one level of the wide tree after the other.
//!
//! There are no feature flags.

mod bottom_up;
mod collapse;
mod cost;
mod error;
mod greedy;
mod node;
mod optimal;
mod parts;
mod quantised;
mod settings;

pub use error::CollapseError;
pub use node::{Bvh4, Bvh8, Bvh16, Child, Node4, Node8, Node16, WideBvh, WideNode};
pub use parts::PartsError;
pub use quantised::{QuantisedNode, QuantisedNode4, QuantisedNode8, QuantisedNode16};
pub use settings::{CollapseMethod, CollapseSettings, WideCosts};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
