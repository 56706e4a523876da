//! Why a tree was not loaded.

use niwaki_wide::PartsError;
use std::io;

/// Why a tree was not loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The system could not open or read the file, or there is not enough memory.
    #[error(transparent)]
    Io(#[from] io::Error),
    /// The file begins with something else. Remedy: give a file that `TreeFile::save` wrote.
    #[error("not a tree file: it begins with {found:02x?}")]
    NotATree {
        /// Its first bytes.
        found: [u8; 8],
    },
    /// The file is of another version of the format. Remedy: build the tree again, or read it with
    /// the version of this crate that wrote it.
    #[error("the file is of version {found}, this crate reads version {supported}")]
    Version {
        /// Of the file.
        found: u32,
        /// Of this crate.
        supported: u32,
    },
    /// The header was changed after it was written. Remedy: get the file anew.
    #[error("the header is damaged: its checksum is {computed:08x}, not {stored:08x}")]
    DamagedHeader {
        /// What the file says.
        stored: u32,
        /// What its header has.
        computed: u32,
    },
    /// The tree has another number of children a node. Remedy: load it as that type.
    #[error("the file holds a tree of {found} children a node, not of {expected}")]
    Width {
        /// Of the file; 2 is a binary tree.
        found: u32,
        /// Of the type that was asked for.
        expected: u32,
    },
    /// The header's counts are impossible. Remedy: none; the file was not written by this crate.
    #[error("the header claims {nodes} nodes, {references} references and {bytes} bytes of them")]
    BadCounts {
        /// Nodes.
        nodes: u32,
        /// References.
        references: u32,
        /// Bytes.
        bytes: u64,
    },
    /// The file ends too early. Remedy: get the file anew.
    #[error("the file is cut short: it has {found} bytes of {expected}")]
    Truncated {
        /// Bytes that there are.
        found: u64,
        /// Bytes that there should be, of the header alone if that is not whole.
        expected: u64,
    },
    /// The file goes on after the tree; only `TreeFile::load` minds. Remedy: read the tree from a
    /// stream if more is meant to follow.
    #[error("the file has {found} bytes, but the tree ends after {expected}")]
    Trailing {
        /// Bytes that there are.
        found: u64,
        /// Bytes of the tree.
        expected: u64,
    },
    /// Nodes or references were changed after they were written. Remedy: get the file anew.
    #[error("the tree is damaged: its checksum is {computed:08x}, not {stored:08x}")]
    Damaged {
        /// What the header says.
        stored: u32,
        /// What the payload has.
        computed: u32,
    },
    /// The checksums fit, but it is no tree. Remedy: correct the program that wrote it, or distrust
    /// where it came from.
    #[error("not a sound tree: {0}")]
    Malformed(#[from] TreeFault),
    /// As [`ReadError::Malformed`], for a wide tree.
    #[error("not a sound wide tree: {0}")]
    MalformedWide(#[from] PartsError),
}

/// What is wrong with a binary tree. Nodes are named by index.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TreeFault {
    /// A node's box is inverted or not finite.
    #[error("the box of node {node} is inverted or not finite")]
    Box {
        /// The node.
        node: usize,
    },
    /// A node's children do not exist or do not come after it.
    #[error(
        "node {node} has children at {first_child}, which is not between it and the end, {nodes}"
    )]
    Child {
        /// The node.
        node: usize,
        /// Where it has its children.
        first_child: u32,
        /// How many nodes there are.
        nodes: usize,
    },
    /// Two nodes have the same child.
    #[error("node {node} has two parents")]
    TwoParents {
        /// The child.
        node: usize,
    },
    /// A node is not the root and nobody's child.
    #[error("node {node} is not reached from the root")]
    Orphan {
        /// The node.
        node: usize,
    },
    /// A leaf's references do not exist.
    #[error("leaf {node} ends at reference {end} of {references}")]
    Leaf {
        /// The leaf.
        node: usize,
        /// After its last reference.
        end: u64,
        /// How many there are.
        references: usize,
    },
    /// A reference is in two leaves.
    #[error("reference {reference} is in two leaves, one of them node {node}")]
    TwoLeaves {
        /// The reference.
        reference: usize,
        /// The second leaf.
        node: usize,
    },
    /// A reference is in no leaf.
    #[error("reference {reference} is in no leaf")]
    Unused {
        /// The reference.
        reference: usize,
    },
    /// The header's box is not the root's.
    #[error("the bounds in the header are not those of the root")]
    Bounds,
}
