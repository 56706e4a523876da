//! Exact ray-triangle decisions: the oracle that settles disagreements between kernels.
//!
//! ```
//! use niwaki_core::{Ray, Triangle, glam::Vec3};
//! use niwaki_exact::{Contact, contact, t};
//!
//! let triangle = Triangle::new(Vec3::ZERO, Vec3::X, Vec3::Y);
//! let down = |x, y| Ray::new(Vec3::new(x, y, 3.0), Vec3::new(0.0, 0.0, -2.0));
//!
//! assert_eq!(contact(&down(0.25, 0.25), &triangle), Contact::Interior);
//! assert_eq!(contact(&down(0.5, 0.5), &triangle), Contact::Border); // on the long edge
//! assert_eq!(contact(&down(0.5, 0.5_f32.next_up()), &triangle), Contact::Miss); // one ulp off
//! assert_eq!(t(&down(0.25, 0.25), &triangle), Some(1.5));
//! ```
//!
//! Inputs are `f32`, taken at their word: a ray is the set of points `origin + t·direction` with
//! real `t`, a triangle is the set of all convex combinations of its corners. What the functions
//! here decide about them is true, whatever the scale: every decision is a sign of a polynomial
//! in the inputs, computed in `f64` with a running error bound and, where that leaves doubt, in
//! integers of any size (no overflow, no underflow, denormals included).
//!
//! What counts as a hit:
//!
//! - the triangle is closed (edges and corners belong to it), and so is the range
//!   `t_min ≤ t ≤ t_max`, where `t_max` may be infinite and a negative `t_min` counts as 0;
//! - a ray in the plane of the triangle, or parallel to it, misses, as in all determinant tests;
//! - a triangle without area is never hit (kernels may report one that closes a seam, where rounding
//!   opens it: [`settle_with`]);
//! - a ray or triangle with NaN, with an infinite coordinate, and a ray with zero direction or
//!   `t_max < t_min`, hit nothing.
//!
//! | function | decides |
//! |---|---|
//! | [`contact`], [`t`], [`compare_t`] | one ray, one or two triangles |
//! | [`closest`], [`closest_in_mesh`] | the closest hit, with all ties |
//! | [`border_distance_ulps`], [`t_error_bound`] | how hard the case is for `f32` |
//! | [`settle`], [`settle_any`] | which of two kernels is right |
//!
//! There are no feature flags.

mod closest;
mod contact;
mod difficulty;
mod number;
mod settle;

pub use closest::{Closest, closest, closest_in_mesh};
pub use contact::{Contact, compare_t, contact, t};
pub use difficulty::{Anchor, border_distance_ulps, t_error_bound};
pub use settle::{
    AnySettlement, Claim, SettleOptions, Settlement, Side, Verdict, settle, settle_any,
    settle_any_among, settle_any_with, settle_with,
};

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
