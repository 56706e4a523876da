//! The first 64 bytes.

use crate::ReadError;
use niwaki_core::{Aabb, glam::Vec3};

pub(crate) const MAGIC: [u8; 8] = *b"\x89NIWAKI\n";
pub(crate) const VERSION: u32 = 1;
pub(crate) const BYTES: usize = 64;

/// What the header says beside the mark and the version.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Header {
    pub(crate) width: u32,
    pub(crate) nodes: u32,
    pub(crate) references: u32,
    /// Of nodes and references.
    pub(crate) bytes: u64,
    pub(crate) bounds: Aabb,
    pub(crate) checksum: u32,
}

impl Header {
    pub(crate) fn to_bytes(self) -> [u8; BYTES] {
        let mut out = [0; BYTES];
        let mut at = 0;
        let mut put = |bytes: &[u8]| {
            out[at..at + bytes.len()].copy_from_slice(bytes);
            at += bytes.len();
        };
        put(&MAGIC);
        for word in [VERSION, self.width, self.nodes, self.references] {
            put(&word.to_le_bytes());
        }
        put(&self.bytes.to_le_bytes());
        for corner in [self.bounds.min, self.bounds.max] {
            for coordinate in corner.to_array() {
                put(&coordinate.to_le_bytes());
            }
        }
        put(&self.checksum.to_le_bytes());
        let own = crc32fast::hash(&out[..BYTES - 4]);
        out[BYTES - 4..].copy_from_slice(&own.to_le_bytes());
        out
    }

    /// The mark first, then the version, on which all else depends, then the checksum.
    pub(crate) fn from_bytes(bytes: &[u8; BYTES]) -> Result<Self, ReadError> {
        let array = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        let word = |at: usize| u32::from_le_bytes(array(at));
        let vector = |at: usize| Vec3::from_array([0, 4, 8].map(|i| f32::from_bits(word(at + i))));
        let mut found = [0; 8];
        found.copy_from_slice(&bytes[..8]);
        if found != MAGIC {
            return Err(ReadError::NotATree { found });
        }
        if word(8) != VERSION {
            return Err(ReadError::Version { found: word(8), supported: VERSION });
        }
        let (stored, computed) = (word(60), crc32fast::hash(&bytes[..BYTES - 4]));
        if stored != computed {
            return Err(ReadError::DamagedHeader { stored, computed });
        }
        Ok(Self {
            width: word(12),
            nodes: word(16),
            references: word(20),
            bytes: u64::from(word(24)) | u64::from(word(28)) << 32,
            bounds: Aabb::new(vector(32), vector(44)),
            checksum: word(56),
        })
    }
}
