//! Constants of the surface area heuristic (SAH).

/// Costs of the SAH (thesis section 3.4, equation 3; paper IV, equation 1):
/// `C_I·ΣA(n)/A(root)` over inner nodes + `C_L·ΣA(n)/A(root)` over leaves +
/// `C_T·ΣA(n)·N(n)/A(root)` over leaves.
///
/// Only ratios matter to a builder; a reported cost means nothing without its constants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SahConstants {
    /// C_I: traversing an inner node (testing its two children).
    pub inner: f32,
    /// C_L: entering a leaf; zero in all published settings used here.
    pub leaf: f32,
    /// C_T: intersecting one triangle.
    pub triangle: f32,
}

impl SahConstants {
    /// C_I = 2, C_L = 0, C_T = 1: thesis paper IV, figure 8. The default.
    pub const THESIS_IV: Self = Self { inner: 2.0, leaf: 0.0, triangle: 1.0 };
    /// C_I = 1, C_L = 0, C_T = 1: thesis paper V, table 5.
    pub const THESIS_V: Self = Self { inner: 1.0, leaf: 0.0, triangle: 1.0 };
    /// C_I = 1.2, C_L = 0, C_T = 1: Karras and Aila 2013.
    pub const KARRAS_AILA: Self = Self { inner: 1.2, leaf: 0.0, triangle: 1.0 };
}

impl Default for SahConstants {
    fn default() -> Self {
        Self::THESIS_IV
    }
}
