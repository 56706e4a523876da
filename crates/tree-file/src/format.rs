//! Nodes and references as words.

use crate::{
    ReadError, TreeFault,
    check::check,
    header::{BYTES, Header, MAGIC},
};
use niwaki_core::{Aabb, Bvh, BvhNode};
use niwaki_wide::{WideBvh, WideNode};
use std::{
    fs::File,
    io::{self, BufWriter, Read, Write},
    path::Path,
};

/// Words that are converted at once.
const CHUNK: usize = 1 << 16;

/// Trees that can be saved and loaded: [`Bvh`], and [`WideBvh`] of each width. The trait cannot be
/// implemented outside this crate.
pub trait TreeFile: Format {
    /// Writes the tree, which takes two passes over it: one for the checksum.
    ///
    /// # Errors
    /// Those of `out`, and [`io::ErrorKind::InvalidInput`] for a tree with more nodes or
    /// references than 32 bits can count.
    fn write_to(&self, mut out: impl Write) -> io::Result<()> {
        let count = |n: usize| {
            u32::try_from(n).map_err(|_| {
                io::Error::new(io::ErrorKind::InvalidInput, "more than 32 bits can count")
            })
        };
        let (nodes, references) = (self.nodes().len(), self.prim_ids().len());
        let mut crc = crc32fast::Hasher::new();
        let mut bytes = 0;
        self.encode(|part| {
            bytes += part.len() as u64;
            crc.update(part);
            Ok(())
        })?;
        let header = Header {
            width: Self::WIDTH,
            nodes: count(nodes)?,
            references: count(references)?,
            bytes,
            bounds: self.bounds(),
            checksum: crc.finalize(),
        };
        out.write_all(&header.to_bytes())?;
        self.encode(|part| out.write_all(part))
    }

    /// Reads a tree; what follows it is left where it is. Reads in large blocks, so `input` need not
    /// be buffered.
    ///
    /// # Errors
    /// [`ReadError`] says what is wrong.
    fn read_from(mut input: impl Read) -> Result<Self, ReadError> {
        let header = read_header(&mut input)?;
        read_payload(input, header)
    }

    /// Writes the tree to a new file, or over an old one.
    ///
    /// # Errors
    /// As [`TreeFile::write_to`].
    fn save(&self, path: impl AsRef<Path>) -> io::Result<()> {
        let mut out = BufWriter::new(File::create(path)?);
        self.write_to(&mut out)?;
        out.flush()
    }

    /// Reads a tree from a file that holds nothing else.
    ///
    /// # Errors
    /// [`ReadError`] says what is wrong.
    fn load(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let mut file = File::open(path)?;
        let header = read_header(&mut file)?;
        let tree = read_payload(&mut file, header)?;
        // Counted to the end rather than asked for, which works with pipes as well.
        let more = io::copy(&mut file, &mut io::sink())?;
        if more > 0 {
            let expected = BYTES as u64 + header.bytes;
            return Err(ReadError::Trailing { found: expected + more, expected });
        }
        Ok(tree)
    }
}

impl<T: Format> TreeFile for T {}

/// How a kind of tree is made of words.
pub trait Format: Sized {
    /// Children of a node.
    const WIDTH: u32;
    /// Words of a node.
    const WORDS: usize;
    /// Its nodes.
    type Node;

    fn nodes(&self) -> &[Self::Node];
    fn prim_ids(&self) -> &[u32];
    fn bounds(&self) -> Aabb;
    fn push_words(node: &Self::Node, words: &mut Vec<u32>);
    /// From exactly [`Format::WORDS`] words.
    fn node(words: &[u32]) -> Self::Node;
    /// Checked.
    fn tree(nodes: Vec<Self::Node>, prim_ids: Vec<u32>, bounds: Aabb) -> Result<Self, ReadError>;

    /// All of the payload, part by part.
    fn encode(&self, mut write: impl FnMut(&[u8]) -> io::Result<()>) -> io::Result<()> {
        let mut words = Vec::with_capacity(CHUNK);
        let mut bytes = Vec::with_capacity(4 * CHUNK);
        let mut flush = |words: &[u32]| {
            bytes.clear();
            bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
            write(&bytes)
        };
        for nodes in self.nodes().chunks(CHUNK / Self::WORDS) {
            words.clear();
            nodes.iter().for_each(|node| Self::push_words(node, &mut words));
            flush(&words)?;
        }
        self.prim_ids().chunks(CHUNK).try_for_each(flush)
    }
}

impl Format for Bvh {
    const WIDTH: u32 = 2;
    const WORDS: usize = size_of::<BvhNode>() / 4;
    type Node = BvhNode;

    fn nodes(&self) -> &[BvhNode] {
        &self.nodes
    }

    fn prim_ids(&self) -> &[u32] {
        &self.prim_ids
    }

    fn bounds(&self) -> Aabb {
        self.bounds()
    }

    fn push_words(node: &BvhNode, words: &mut Vec<u32>) {
        words.extend_from_slice(&bytemuck::cast::<BvhNode, [u32; Self::WORDS]>(*node));
    }

    fn node(words: &[u32]) -> BvhNode {
        let mut array = [0; Self::WORDS];
        array.copy_from_slice(words);
        bytemuck::cast(array)
    }

    fn tree(nodes: Vec<BvhNode>, prim_ids: Vec<u32>, bounds: Aabb) -> Result<Self, ReadError> {
        let bvh = Self { nodes, prim_ids };
        check(&bvh)?;
        // Both are finite or both empty here, so no NaN makes them differ from themselves.
        if bvh.bounds() != bounds {
            return Err(TreeFault::Bounds.into());
        }
        Ok(bvh)
    }
}

impl<const W: usize> Format for WideBvh<W> {
    #[expect(clippy::cast_possible_truncation, reason = "4, 8 or 16")]
    const WIDTH: u32 = W as u32;
    const WORDS: usize = 7 * W + 3;
    type Node = WideNode<W>;

    fn nodes(&self) -> &[WideNode<W>] {
        self.nodes()
    }

    fn prim_ids(&self) -> &[u32] {
        self.prim_ids()
    }

    fn bounds(&self) -> Aabb {
        self.bounds()
    }

    fn push_words(node: &WideNode<W>, words: &mut Vec<u32>) {
        words.extend(node.bounds.as_flattened().iter().map(|plane| plane.to_bits()));
        words.extend_from_slice(&node.children);
        words.extend([node.first_prim, node.prim_count, node.used]);
    }

    fn node(words: &[u32]) -> WideNode<W> {
        let mut bounds = [[0.0; W]; 6];
        for (plane, &word) in bounds.as_flattened_mut().iter_mut().zip(words) {
            *plane = f32::from_bits(word);
        }
        let mut children = [0; W];
        children.copy_from_slice(&words[6 * W..7 * W]);
        let [first_prim, prim_count, used] = [0, 1, 2].map(|i| words[7 * W + i]);
        WideNode { bounds, children, first_prim, prim_count, used }
    }

    fn tree(nodes: Vec<WideNode<W>>, prim_ids: Vec<u32>, bounds: Aabb) -> Result<Self, ReadError> {
        Ok(Self::from_parts(nodes, prim_ids, bounds)?)
    }
}

fn read_header(input: &mut impl Read) -> Result<Header, ReadError> {
    let mut bytes = [0; BYTES];
    let found = fill(input, &mut bytes)?;
    if found < BYTES {
        // What is not even the beginning of a mark is no tree, whatever its length.
        let known = found.min(8);
        if bytes[..known] != MAGIC[..known] {
            let mut found = [0; 8];
            found.copy_from_slice(&bytes[..8]);
            return Err(ReadError::NotATree { found });
        }
        return Err(ReadError::Truncated { found: found as u64, expected: BYTES as u64 });
    }
    Header::from_bytes(&bytes)
}

fn read_payload<T: Format>(mut input: impl Read, header: Header) -> Result<T, ReadError> {
    let Header { width, nodes, references, bytes, bounds, checksum } = header;
    if width != T::WIDTH {
        return Err(ReadError::Width { found: width, expected: T::WIDTH });
    }
    let words = u64::from(nodes) * T::WORDS as u64 + u64::from(references);
    if bytes != 4 * words || (nodes == 0) != (references == 0) {
        return Err(ReadError::BadCounts { nodes, references, bytes });
    }
    let mut reader = Words {
        input: &mut input,
        crc: crc32fast::Hasher::new(),
        read: BYTES as u64,
        expected: BYTES as u64 + bytes,
    };
    let nodes = reader.records(nodes as usize, T::WORDS, T::node)?;
    let prim_ids = reader.records(references as usize, 1, |words| words[0])?;
    let computed = reader.crc.finalize();
    if computed != checksum {
        return Err(ReadError::Damaged { stored: checksum, computed });
    }
    T::tree(nodes, prim_ids, bounds)
}

/// Words from a stream.
struct Words<'a, R> {
    input: &'a mut R,
    crc: crc32fast::Hasher,
    /// Bytes so far.
    read: u64,
    /// Bytes in all.
    expected: u64,
}

impl<R: Read> Words<'_, R> {
    /// So many records of so many words. Room is made as they come: a header may claim anything.
    fn records<T>(
        &mut self,
        count: usize,
        words: usize,
        record: impl Fn(&[u32]) -> T,
    ) -> Result<Vec<T>, ReadError> {
        let mut out: Vec<T> = Vec::new();
        let per_chunk = CHUNK / words;
        let mut bytes = vec![0; 4 * words * per_chunk.min(count)];
        let mut decoded = Vec::with_capacity(bytes.len() / 4);
        while out.len() < count {
            let now = per_chunk.min(count - out.len());
            let bytes = &mut bytes[..4 * words * now];
            let found = fill(self.input, bytes)?;
            self.read += found as u64;
            if found < bytes.len() {
                return Err(ReadError::Truncated { found: self.read, expected: self.expected });
            }
            self.crc.update(bytes);
            decoded.clear();
            decoded.extend(
                bytes
                    .chunks_exact(4)
                    .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]])),
            );
            // At least as much again as there is, so that growing costs little.
            if out.capacity() - out.len() < now {
                let room = out.len().max(now).min(count - out.len());
                out.try_reserve_exact(room)
                    .map_err(|error| io::Error::new(io::ErrorKind::OutOfMemory, error))?;
            }
            out.extend(decoded.chunks_exact(words).map(&record));
        }
        Ok(out)
    }
}

/// Reads until the buffer is full or the input ends; returns how much there was.
fn fill(input: &mut impl Read, buffer: &mut [u8]) -> io::Result<usize> {
    let mut filled = 0;
    while filled < buffer.len() {
        match input.read(&mut buffer[filled..]) {
            Ok(0) => break,
            Ok(n) => filled += n,
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(error) => return Err(error),
        }
    }
    Ok(filled)
}
