//! Which instructions a scene is traced with.

use std::fmt;

/// The instruction sets that [`crate::WideScene`] has kernels for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[non_exhaustive]
pub enum Kernel {
    /// Plain Rust: the reference, on every processor.
    Scalar,
    /// x86-64 with SSE4.2 (Nehalem, Bulldozer, Silvermont and later): vectors of 128 bits, without
    /// fused multiply-adds, which are emulated.
    Sse42,
    /// x86-64 with AVX2 and FMA (Haswell, Zen and later): vectors of up to 256 bits.
    Avx2,
    /// x86-64 with AVX-512 F, VL and DQ (Skylake-X, Zen 4 and later): masks, vectors as wide as the tree.
    Avx512,
}

impl Kernel {
    /// All kernels, slowest first.
    pub const ALL: [Self; 4] = [Self::Scalar, Self::Sse42, Self::Avx2, Self::Avx512];

    /// True if this processor can run it.
    #[must_use]
    pub fn is_available(self) -> bool {
        match self {
            Self::Scalar => true,
            #[cfg(target_arch = "x86_64")]
            Self::Sse42 => is_x86_feature_detected!("sse4.2") && is_x86_feature_detected!("popcnt"),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => has_avx2(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => {
                has_avx2()
                    && is_x86_feature_detected!("avx512f")
                    && is_x86_feature_detected!("avx512vl")
                    && is_x86_feature_detected!("avx512dq")
            }
            #[cfg(not(target_arch = "x86_64"))]
            _ => false,
        }
    }

    /// True if there is such a kernel for trees of this width: the scalar one traces all, SSE4.2 a
    /// width of 4, AVX2 widths of 4 and 8, AVX-512 widths of 8 and 16.
    #[must_use]
    pub const fn traces(self, width: usize) -> bool {
        match self {
            Self::Scalar => true,
            Self::Sse42 => width == 4,
            Self::Avx2 => matches!(width, 4 | 8),
            Self::Avx512 => matches!(width, 8 | 16),
        }
    }

    /// The width of tree that it traces fastest: 16 for AVX-512, 8 for AVX2, 4 for SSE4.2, and 8 for the scalar kernel
    /// (whose tests of boxes compilers vectorise; 4 was a fifth slower).
    #[must_use]
    pub const fn best_width(self) -> usize {
        match self {
            Self::Sse42 => 4,
            Self::Scalar | Self::Avx2 => 8,
            Self::Avx512 => 16,
        }
    }

    /// Those that this processor can run, slowest first; never empty.
    #[must_use]
    pub fn available() -> Vec<Self> {
        Self::ALL.into_iter().filter(|kernel| kernel.is_available()).collect()
    }

    /// The fastest that this processor can run.
    #[must_use]
    pub fn best() -> Self {
        Self::ALL.into_iter().rev().find(|kernel| kernel.is_available()).unwrap_or(Self::Scalar)
    }

    /// The name in tables and on the command line.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Sse42 => "sse42",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }
}

/// AVX2, and what every processor with it has had besides.
#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma")
        && is_x86_feature_detected!("bmi1")
        && is_x86_feature_detected!("bmi2")
        && is_x86_feature_detected!("popcnt")
}

impl fmt::Display for Kernel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}
