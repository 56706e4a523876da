//! Our kernels held against reference answers, with exact arithmetic as the arbiter: what `verify`
//! and `stability` share.

mod compare;
mod kernels;
mod tally;

pub(crate) use compare::{Reference, any, closest};
pub(crate) use kernels::{each_kernel, each_kernel_of_other_widths, kernel_names};
pub(crate) use tally::Tally;
