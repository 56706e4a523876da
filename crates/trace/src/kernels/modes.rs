//! The four kernels of an instruction set and a width: full and quantised nodes, fast and watertight.

/// Defines the modules `fast`, `watertight`, `quantised_fast` and `quantised_watertight` from the
/// features, the width, and the names of both kinds of nodes in `niwaki_wide`.
///
/// Needs, in scope, what `define_traversal` and `define_batches` need, and these two macros with
/// those that define boxes and corners.
macro_rules! define_kernels {
    ($features:literal, $width:literal, $node:ident, $quantised:ident) => {
        /// For scenes in [`crate::Mode::Fast`].
        pub(crate) mod fast {
            use super::*;
            use niwaki_wide::$node as Node;

            define_traversal!($features, $width, define_full_boxes, define_fast_corners);
            define_batches!($features);
        }

        /// For scenes in [`crate::Mode::Watertight`].
        pub(crate) mod watertight {
            use super::*;
            use crate::watertight::{self, CERTAIN, Sheared};
            use niwaki_wide::$node as Node;

            define_traversal!($features, $width, define_full_boxes, define_watertight_corners);
            define_batches!($features);
        }

        /// For quantised scenes in [`crate::Mode::Fast`].
        pub(crate) mod quantised_fast {
            use super::*;
            use niwaki_wide::$quantised as Node;

            define_traversal!($features, $width, define_quantised_boxes, define_fast_corners);
            define_batches!($features);
        }

        /// For quantised scenes in [`crate::Mode::Watertight`].
        pub(crate) mod quantised_watertight {
            use super::*;
            use crate::watertight::{self, CERTAIN, Sheared};
            use niwaki_wide::$quantised as Node;

            define_traversal!($features, $width, define_quantised_boxes, define_watertight_corners);
            define_batches!($features);
        }
    };
}

pub(crate) use define_kernels;
