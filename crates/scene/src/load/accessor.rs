//! Typed arrays of a glTF document, every range checked before a byte is read.

use crate::LoadError;
use gltf::json::{
    Index, Root,
    accessor::{Accessor, ComponentType, Type},
    buffer::View,
    validation::Checked,
};
use std::{
    borrow::Cow,
    path::Path,
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering::Relaxed},
    },
};

/// Elements that accessors without any bytes may claim together: such elements are all zero, so
/// more of them serve nobody, and 20 bytes of JSON, or 20 thousand, must not ask for gigabytes.
const MOST_ELEMENTS_FROM_NOTHING: u64 = 1 << 22;

const VALIDATOR: &str = "export the file again, or see what the Khronos glTF validator says";

/// A document and its bytes.
pub(super) struct Document<'a> {
    pub(super) path: &'a Path,
    pub(super) root: &'a Root,
    pub(super) buffers: &'a [Arc<Cow<'a, [u8]>>],
    /// Elements from nothing that have been asked for.
    pub(super) from_nothing: AtomicU64,
}

/// Bytes of one array and how its elements lie in them.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
    count: usize,
}

impl<'a> Elements<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> + use<'a> {
        let size = self.size;
        self.bytes.chunks(self.stride.max(1)).take(self.count).map(move |c| &c[..size])
    }
}

const fn component_size(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

impl<'a> Document<'a> {
    /// An error at a place of this document.
    pub(super) fn fail(
        &self,
        at: impl Into<String>,
        reason: impl Into<String>,
        remedy: &'static str,
    ) -> LoadError {
        LoadError::Gltf { path: self.path.into(), at: at.into(), reason: reason.into(), remedy }
    }

    /// The bytes of a buffer view and its stride, if it has one.
    pub(super) fn view(
        &self,
        index: Index<View>,
        at: &str,
    ) -> Result<(&'a [u8], Option<usize>), LoadError> {
        let i = index.value();
        let view = self.root.buffer_views.get(i).ok_or_else(|| {
            let count = self.root.buffer_views.len();
            self.fail(at, format!("bufferViews[{i}] does not exist, there are {count}"), VALIDATOR)
        })?;
        let buffer = self.buffers.get(view.buffer.value()).ok_or_else(|| {
            let reason = format!("buffers[{}] does not exist", view.buffer.value());
            self.fail(format!("bufferViews[{i}]"), reason, VALIDATOR)
        })?;
        let offset = view.byte_offset.map_or(0, |o| o.0);
        let bytes = offset
            .checked_add(view.byte_length.0)
            .and_then(|end| buffer.get(to_usize(offset)?..to_usize(end)?))
            .ok_or_else(|| {
                let reason = format!(
                    "{} bytes from byte {offset} go past the {} bytes of buffers[{}]",
                    view.byte_length.0,
                    buffer.len(),
                    view.buffer.value()
                );
                self.fail(format!("bufferViews[{i}]"), reason, VALIDATOR)
            })?;
        Ok((bytes, view.byte_stride.map(|s| s.0)))
    }

    /// `count` elements of `size` bytes from `offset` in a buffer view.
    fn elements(
        &self,
        view: Index<View>,
        offset: u64,
        count: u64,
        size: usize,
        at: &str,
    ) -> Result<Elements<'a>, LoadError> {
        let (bytes, stride) = self.view(view, at)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            let reason =
                format!("a stride of {stride} bytes is less than its {size}-byte elements");
            return Err(self.fail(at, reason, VALIDATOR));
        }
        let end = count
            .checked_sub(1)
            .map_or(Some(0), |last| last.checked_mul(stride as u64)?.checked_add(size as u64))
            .and_then(|length| length.checked_add(offset));
        let bytes =
            end.and_then(|end| bytes.get(to_usize(offset)?..to_usize(end)?)).ok_or_else(|| {
                let reason = format!(
                    "{count} elements of {size} bytes, {stride} apart, from byte {offset} go past \
                     the {} bytes of bufferViews[{}]",
                    bytes.len(),
                    view.value()
                );
                self.fail(at, reason, VALIDATOR)
            })?;
        Ok(Elements { bytes, stride, size, count: to_usize(count).unwrap_or(0) })
    }

    /// The accessor and the types of its components and elements.
    fn accessor(
        &self,
        index: Index<Accessor>,
        at: &str,
    ) -> Result<(&'a Accessor, ComponentType, Type), LoadError> {
        let i = index.value();
        let accessor = self.root.accessors.get(i).ok_or_else(|| {
            let count = self.root.accessors.len();
            self.fail(at, format!("accessors[{i}] does not exist, there are {count}"), VALIDATOR)
        })?;
        let (Checked::Valid(component), Checked::Valid(element)) =
            (accessor.component_type, accessor.type_)
        else {
            let reason = format!("accessors[{i}] has an unknown type or componentType");
            return Err(self.fail(at, reason, VALIDATOR));
        };
        Ok((accessor, component.0, element))
    }

    /// Every element of an accessor through `decode`, which gets its bytes and its number; sparse
    /// elements come last.
    fn each(
        &self,
        index: Index<Accessor>,
        components: usize,
        at: &str,
        mut store: impl FnMut(usize, &[u8]),
    ) -> Result<(), LoadError> {
        let (accessor, component, _) = self.accessor(index, at)?;
        let size = component_size(component) * components;
        let count = accessor.count.0;
        let offset = accessor.byte_offset.map_or(0, |o| o.0);
        if let Some(view) = accessor.buffer_view {
            for (i, raw) in self.elements(view, offset, count, size, at)?.iter().enumerate() {
                store(i, raw);
            }
        }
        let Some(sparse) = &accessor.sparse else { return Ok(()) };
        let Checked::Valid(width) = sparse.indices.component_type else {
            return Err(self.fail(at, "sparse.indices has an unknown componentType", VALIDATOR));
        };
        let width = component_size(width.0);
        let n = sparse.count.0;
        let places =
            self.elements(sparse.indices.buffer_view, sparse.indices.byte_offset.0, n, width, at)?;
        let values =
            self.elements(sparse.values.buffer_view, sparse.values.byte_offset.0, n, size, at)?;
        for (place, value) in places.iter().zip(values.iter()) {
            let place = little_endian(place);
            if u64::from(place) >= count {
                let reason = format!("sparse index {place} is not below the count {count}");
                return Err(self.fail(at, reason, VALIDATOR));
            }
            store(place as usize, value);
        }
        Ok(())
    }

    /// How many elements an accessor has. Bounded by the bytes behind them, so it is safe to
    /// allocate for.
    pub(super) fn count(&self, index: Index<Accessor>, at: &str) -> Result<usize, LoadError> {
        let (accessor, component, _) = self.accessor(index, at)?;
        let count = accessor.count.0;
        let most = match accessor.buffer_view {
            None => MOST_ELEMENTS_FROM_NOTHING - self.from_nothing.load(Relaxed),
            Some(view) => (self.view(view, at)?.0.len() / component_size(component)) as u64,
        };
        if count > most {
            let reason = format!(
                "accessors[{}] claims {count} elements, its data has at most {most}",
                index.value()
            );
            return Err(self.fail(at, reason, VALIDATOR));
        }
        if accessor.buffer_view.is_none() {
            self.from_nothing.fetch_add(count, Relaxed);
        }
        // Without a buffer view the elements are zero, or hidden in a compression we lack.
        Ok(to_usize(count).unwrap_or(0))
    }

    /// An array of vectors of floats or of integers, normalised where the accessor says so.
    pub(super) fn vectors<const N: usize>(
        &self,
        index: Index<Accessor>,
        at: &str,
    ) -> Result<Vec<[f32; N]>, LoadError> {
        let mut out = vec![[0.0; N]; self.count(index, at)?];
        self.decoded(index, at, |i, vector| out[i] = vector)?;
        Ok(out)
    }

    /// The vectors that [`Document::vectors`] would list, each with its number, without those that
    /// no bytes stand for and that are therefore zero. Sparse elements come last, and replace what
    /// came before. There must be `count` of them; no memory is taken.
    pub(super) fn scattered<const N: usize>(
        &self,
        index: Index<Accessor>,
        count: usize,
        at: &str,
        store: impl FnMut(usize, [f32; N]),
    ) -> Result<(), LoadError> {
        let found = self.accessor(index, at)?.0.count.0;
        if found != count as u64 {
            let reason = format!("{found} elements for {count} vertices");
            return Err(self.fail(at, reason, "give every vertex its element"));
        }
        self.decoded(index, at, store)
    }

    /// How many elements of an accessor bytes stand for.
    pub(super) fn stored(&self, index: Index<Accessor>, at: &str) -> Result<u64, LoadError> {
        let accessor = self.accessor(index, at)?.0;
        let plain = accessor.buffer_view.map_or(0, |_| accessor.count.0);
        let sparse = accessor.sparse.as_ref().map_or(0, |sparse| sparse.count.0);
        Ok(plain.saturating_add(sparse))
    }

    fn decoded<const N: usize>(
        &self,
        index: Index<Accessor>,
        at: &str,
        mut store: impl FnMut(usize, [f32; N]),
    ) -> Result<(), LoadError> {
        let (accessor, component, element) = self.accessor(index, at)?;
        let wanted = [Type::Scalar, Type::Vec2, Type::Vec3, Type::Vec4].get(N - 1).copied();
        if Some(element) != wanted {
            let reason = format!("its elements are {element:?}, not vectors of {N}");
            return Err(self.fail(at, reason, VALIDATOR));
        }
        let width = component_size(component);
        let normalized = accessor.normalized;
        self.each(index, N, at, |i, raw| {
            let mut vector = [0.0; N];
            for (value, raw) in vector.iter_mut().zip(raw.chunks_exact(width)) {
                *value = decode(component, normalized, raw);
            }
            store(i, vector);
        })
    }

    /// An array of 4 × 4 matrices of floats, column by column.
    pub(super) fn matrices(
        &self,
        index: Index<Accessor>,
        at: &str,
    ) -> Result<Vec<[f32; 16]>, LoadError> {
        let (_, component, element) = self.accessor(index, at)?;
        // Floats need no padding between columns.
        if element != Type::Mat4 || component != ComponentType::F32 {
            let reason = format!("its elements are {element:?} of {component:?}, not Mat4 of F32");
            return Err(self.fail(at, reason, VALIDATOR));
        }
        let mut out = vec![[0.0; 16]; self.count(index, at)?];
        self.each(index, 16, at, |i, raw| {
            for (value, raw) in out[i].iter_mut().zip(raw.chunks_exact(4)) {
                *value = decode(component, false, raw);
            }
        })?;
        Ok(out)
    }

    /// An array of four joint numbers each.
    pub(super) fn joints(
        &self,
        index: Index<Accessor>,
        at: &str,
    ) -> Result<Vec<[u16; 4]>, LoadError> {
        let (_, component, element) = self.accessor(index, at)?;
        let width = match component {
            ComponentType::U8 => 1,
            ComponentType::U16 => 2,
            _ => 0,
        };
        if element != Type::Vec4 || width == 0 {
            let reason =
                format!("its elements are {element:?} of {component:?}, not Vec4 of U8 or U16");
            return Err(self.fail(at, reason, VALIDATOR));
        }
        let mut out = vec![[0; 4]; self.count(index, at)?];
        self.each(index, 4, at, |i, raw| {
            for (value, raw) in out[i].iter_mut().zip(raw.chunks_exact(width)) {
                *value = u16::try_from(little_endian(raw)).unwrap_or(u16::MAX);
            }
        })?;
        Ok(out)
    }

    /// An array of vertex indices.
    pub(super) fn indices(&self, index: Index<Accessor>, at: &str) -> Result<Vec<u32>, LoadError> {
        let (_, component, element) = self.accessor(index, at)?;
        let unsigned =
            matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if element != Type::Scalar || !unsigned {
            let reason = format!("its elements are {element:?} of {component:?}, not unsigned");
            return Err(self.fail(at, reason, VALIDATOR));
        }
        let mut out = vec![0; self.count(index, at)?];
        self.each(index, 1, at, |i, raw| out[i] = little_endian(raw))?;
        Ok(out)
    }
}

fn to_usize(n: u64) -> Option<usize> {
    usize::try_from(n).ok()
}

/// At most four bytes as an unsigned number.
fn little_endian(raw: &[u8]) -> u32 {
    raw.iter().rev().fold(0, |n, &b| n << 8 | u32::from(b))
}

/// One component as a float (glTF 2.0 §3.6.2.2 for normalised integers).
fn decode(component: ComponentType, normalized: bool, raw: &[u8]) -> f32 {
    let bits = little_endian(raw);
    #[expect(clippy::cast_possible_truncation, reason = "the upper bytes are zero")]
    let (byte, short) = (bits as u8, bits as u16);
    let (value, most) = match component {
        ComponentType::F32 => return f32::from_bits(bits),
        ComponentType::U32 => (bits as f32, u32::MAX as f32),
        ComponentType::U8 => (f32::from(byte), 255.0),
        ComponentType::I8 => (f32::from(byte.cast_signed()), 127.0),
        ComponentType::U16 => (f32::from(short), 65535.0),
        ComponentType::I16 => (f32::from(short.cast_signed()), 32767.0),
    };
    if normalized { (value / most).max(-1.0) } else { value }
}
