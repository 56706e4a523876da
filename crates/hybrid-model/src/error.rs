//! What can go wrong.

/// Why there is no model or no sampler.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum HybridModelError {
    /// There is nothing to fit to.
    #[error("no frame was given to fit the model to; draw some with different settings first")]
    NoFrames,
    /// A frame's times are unknown.
    #[error(
        "frame {frame} has no times of the GPU; the device has no timestamps, so its frames cannot be predicted by parts"
    )]
    NoTimes {
        /// Which of those given, from 0.
        frame: usize,
    },
    /// A thread could not be started.
    #[error("cannot start the sampler's thread: {0}; free some memory or threads")]
    Thread(#[from] rayon::ThreadPoolBuildError),
}
