//! What a triangle test promises.

use std::fmt;

/// What a scene promises about rays that pass exactly through edges and corners. Chosen when a
/// scene is made, as the modes keep different words of the triangles and have kernels of their own.
///
/// In all modes, a triangle whose corners lie on one line, exactly, is hit only where it closes a
/// seam: where each of its edges is an edge of another triangle with another third corner.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Mode {
    /// Each triangle is tested by itself (Möller and Trumbore 1997), so a ray aimed exactly at an
    /// edge may pass between the two triangles that share it.
    ///
    /// Products of three lengths that are denormal lose their precision: triangles of edges that are
    /// 2³² times shorter than a scene of over 2³⁰ units is long, or shorter than 2⁻³² in others, and
    /// even thinner ones, may be missed or hit elsewhere. Nor is the edge opposite to a triangle's
    /// first corner sharp where it is much shorter than the other two: it moves by some units in the
    /// last place of their product over its length. Distances are those of that corner: the error of
    /// the normal counts with how far it is, divided by the sine of its angle, and where that angle or
    /// that of the ray to the plane is below 2⁻¹⁶, the distance of a hit may be any.
    Fast,
    /// No ray from inside a closed surface leaves it, whatever rounding does (Woop, Benthin and
    /// Wald 2013, with exact signs), provided that the origin is further inside than the rounding of
    /// the corners seen from there, some 2⁻²¹ of their distance.
    ///
    /// Closed means that every edge is shared by triangles with corners at equal positions. Some of
    /// them may be triangles without area, which close seams where a long edge meets shorter ones.
    ///
    /// The default, because it costs less than a tenth of the time.
    #[default]
    Watertight,
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 2] = [Self::Fast, Self::Watertight];

    /// The name in tables and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Fast => "fast",
            Self::Watertight => "watertight",
        }
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}
