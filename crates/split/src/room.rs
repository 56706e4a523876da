//! Zeroed room for references that is not touched until it is used.

use niwaki_core::PrimRef;

/// Words of which a reference has two.
type Word = u128;

/// Zeros for many references, most of which may never be written.
///
/// Zeroed memory with an alignment of more than 16 bytes, which a list of references has, is written
/// when it is allocated; with less, the system hands it out as it is touched.
#[derive(Debug)]
pub(crate) struct Room {
    words: Vec<Word>,
}

impl Room {
    pub(crate) fn new(len: usize) -> Self {
        // One word more than references have, for the alignment.
        Self { words: bytemuck::zeroed_vec(2 * len + 1) }
    }

    pub(crate) fn prims(&self) -> &[PrimRef] {
        bytemuck::pod_align_to(&self.words).1
    }

    pub(crate) fn prims_mut(&mut self) -> &mut [PrimRef] {
        bytemuck::pod_align_to_mut(&mut self.words).1
    }
}

// Not derived: references do not stand at the same word in memory of another alignment.
impl Clone for Room {
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.prims().len());
        copy.prims_mut().copy_from_slice(self.prims());
        copy
    }
}

impl PartialEq for Room {
    fn eq(&self, other: &Self) -> bool {
        self.prims() == other.prims()
    }
}
