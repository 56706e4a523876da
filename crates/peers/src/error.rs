//! What can go wrong with a peer.

use niwaki_core::BuildError;

/// Why a peer did not do its part.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PeerError {
    /// No Embree library was found. Remedy: run `ci/setup-embree.sh` and set the variable that it
    /// prints, or install Embree 3 or 4; or leave Embree out of the comparison.
    #[error(
        "Embree was not found; tried {}. Run ci/setup-embree.sh and set EMBREE_LIBRARY as its \
         last line says, or install the package libembree4-4 or libembree3-3",
        searched.join(", ")
    )]
    NotFound {
        /// The names that the system's loader was asked for.
        searched: Vec<String>,
    },
    /// The library that was asked for by path cannot be used. Remedy: correct or unset
    /// `EMBREE_LIBRARY`; `ci/setup-embree.sh` makes a library that works.
    #[error(
        "the Embree library {library} cannot be used: {cause}. Correct or unset EMBREE_LIBRARY, \
         or let ci/setup-embree.sh install one"
    )]
    BadLibrary {
        /// What was opened.
        library: String,
        /// What is wrong with it.
        cause: String,
    },
    /// A function of Embree failed. Remedy: depends on the message, which is Embree's own; for a
    /// device, mostly a wrong word in [`crate::EmbreeSettings::config`].
    #[error("Embree's {operation} failed with {code}: {message}")]
    Embree {
        /// What was attempted.
        operation: &'static str,
        /// Embree's name of the error, such as `RTC_ERROR_OUT_OF_MEMORY`.
        code: String,
        /// Embree's message; may be empty.
        message: String,
    },
    /// The peer panicked on this input, a fault of the peer. Remedy: report it there, or leave
    /// the peer out for this scene.
    #[error("{peer} panicked: {message}")]
    Panicked {
        /// Which peer.
        peer: &'static str,
        /// What it said.
        message: String,
    },
    /// The tree has more levels than obvhs's 8-wide traversal has a stack for, so that it would
    /// lose hits. Remedy: trace with [`crate::ObvhsKernel::Bvh2`], or remove equal triangles.
    #[error(
        "obvhs built an 8-wide tree at least {depth} levels deep, but can traverse only {max}; \
         use its binary kernel or remove equal triangles"
    )]
    TooDeep {
        /// Levels of 8-wide nodes below the root, at least.
        depth: usize,
        /// Levels that it can traverse.
        max: usize,
    },
    /// The input or a setting is not one that a builder accepts.
    #[error(transparent)]
    Input(#[from] BuildError),
    /// A name on a command line is none of the known ones.
    #[error("`{name}` is no {what}; known are {}", known.join(", "))]
    UnknownName {
        /// What was being named.
        what: &'static str,
        /// The name.
        name: String,
        /// All valid names.
        known: &'static [&'static str],
    },
}

/// The message of a caught panic.
pub(crate) fn panic_message(panic: &(dyn std::any::Any + Send)) -> String {
    panic
        .downcast_ref::<String>()
        .cloned()
        .or_else(|| panic.downcast_ref::<&str>().map(|s| (*s).to_owned()))
        .unwrap_or_else(|| "no message".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn absence_tells_what_was_tried_and_what_to_do() {
        let searched = crate::LIBRARY_NAMES.iter().map(|&name| name.to_owned()).collect();
        let text = PeerError::NotFound { searched }.to_string();
        for part in crate::LIBRARY_NAMES.iter().chain(&["ci/setup-embree.sh", "EMBREE_LIBRARY"]) {
            assert!(text.contains(part), "{text}");
        }
    }

    #[test]
    fn panics_of_peers_keep_their_message() {
        let formatted = std::panic::catch_unwind(|| panic!("{} of {}", 3, 2)).unwrap_err();
        assert_eq!(panic_message(&*formatted), "3 of 2");
        assert_eq!(panic_message(&"literal"), "literal");
        assert_eq!(panic_message(&7), "no message");
    }
}
