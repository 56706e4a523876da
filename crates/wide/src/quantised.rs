//! Nodes with boxes of 8 bits a plane.

use crate::{Child, WideNode};
use niwaki_core::{Aabb, glam::Vec3};

/// The bits of the first scale that hold the number of used slots.
const USED: u32 = 31;

/// The last step of a grid.
const LAST: u8 = u8::MAX;

/// A node like [`WideNode`] whose planes are steps of a grid, one byte each: 64, 128 and 192 bytes
/// for 4, 8 and 16 children instead of 128, 256 and 512 (Ylitie, Karras and Laine 2017, section
/// 3.2; Benthin, Wald, Woop and Áfra 2018).
///
/// The grid of an axis has 256 planes: `origin[axis] + q·scale[axis]`, taken exactly, for
/// q = 0 to 255. It begins at the children's smallest coordinate and ends at the largest or just
/// behind, or the other way round with a negative scale. Boxes are rounded outward to it, so each
/// contains that of the [`WideNode`], whatever its size and place; it is larger by less than two
/// steps in all. What lies on the first plane of the grid stays where it is; so it begins on that
/// side on which there are more flat boxes: rays that leave a wall should not meet its box.
///
/// The scale is not restricted to powers of two, as the sources do to save three bytes and a
/// multiplication: that would waste a quarter of the steps on average, and a node that fills its
/// cache lines has no use for the bytes.
///
/// An unused slot has an inverted box (the last step to the first) and a child word that names a
/// leaf that exists. A ray grazing a box smaller than its own rounding errors may still seem to
/// meet it, so kernels have to mask slots from [`QuantisedNode::used`] on.
///
/// ```
/// use niwaki_core::{Aabb, Bvh, BvhNode, glam::Vec3};
/// use niwaki_wide::{Bvh8, CollapseSettings, QuantisedNode};
///
/// let unit = |x: f32| Aabb::new(Vec3::new(x, 0.0, 0.0), Vec3::new(x + 1.0, 1.0, 0.0));
/// let bvh = Bvh {
///     nodes: vec![
///         BvhNode::inner(unit(0.0).union(unit(9.0)), 1),
///         BvhNode::leaf(unit(0.0), 0, 1),
///         BvhNode::leaf(unit(9.0), 1, 1),
///     ],
///     prim_ids: vec![7, 3],
/// };
/// let wide = Bvh8::collapse(&bvh, &CollapseSettings::default())?;
/// let node = QuantisedNode::from(&wide.nodes()[0]);
/// assert_eq!((size_of_val(&node), node.used()), (128, 2));
/// assert!(node.aabb(1).contains(&unit(9.0)) && !node.aabb(1).contains(&unit(8.9)));
/// # Ok::<(), niwaki_wide::CollapseError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C, align(64))]
pub struct QuantisedNode<const W: usize> {
    /// The children ([`Child::to_word`]).
    pub children: [u32; W],
    /// The first plane of each axis.
    pub origin: [f32; 3],
    /// The distance of two planes of each axis, negative where the grid begins at the largest
    /// coordinate: finite and not denormal. The lowest five bits of the first are the number of used slots, which makes it larger by at most 2⁻¹⁸ of
    /// itself; as a scale it is used with them.
    pub scale: [f32; 3],
    /// Rows of steps: `planes[2·axis]` the smallest, `planes[2·axis + 1]` the largest coordinates.
    pub planes: [[u8; W]; 6],
}

/// A quantised node with up to four children: 64 bytes.
pub type QuantisedNode4 = QuantisedNode<4>;
/// A quantised node with up to eight children: 128 bytes.
pub type QuantisedNode8 = QuantisedNode<8>;
/// A quantised node with up to sixteen children: 192 bytes.
pub type QuantisedNode16 = QuantisedNode<16>;

const _: () = assert!(
    size_of::<QuantisedNode4>() == 64
        && size_of::<QuantisedNode8>() == 128
        && size_of::<QuantisedNode16>() == 192
);

impl<const W: usize> QuantisedNode<W> {
    /// How many slots are used: 1 to `W`.
    #[must_use]
    #[inline(always)]
    pub const fn used(&self) -> u32 {
        self.scale[0].to_bits() & USED
    }

    /// The child in a slot; `None` for an unused one.
    #[must_use]
    #[inline]
    pub fn child(&self, slot: usize) -> Option<Child> {
        (slot < self.used() as usize).then(|| Child::from_word::<W>(self.children[slot]))
    }

    /// A box around that of a slot, rounded outward to `f32`; [`Aabb::EMPTY`] for an unused slot.
    #[must_use]
    pub fn aabb(&self, slot: usize) -> Aabb {
        if slot >= self.used() as usize {
            return Aabb::EMPTY;
        }
        // The product is exact; one unit in the last place covers the sum, which is not always.
        let plane = |axis: usize, row: usize| {
            let step = f64::from(self.planes[2 * axis + row][slot]);
            step.mul_add(f64::from(self.scale[axis]), f64::from(self.origin[axis]))
        };
        let min = [0, 1, 2].map(|axis| round_down(plane(axis, 0).next_down()));
        let max = [0, 1, 2].map(|axis| round_up(plane(axis, 1).next_up()));
        Aabb::new(Vec3::from(min), Vec3::from(max))
    }
}

impl<const W: usize> From<&WideNode<W>> for QuantisedNode<W> {
    /// Rounds the boxes outward. Boxes that are not finite, which no builder makes, become the
    /// largest finite ones; inverted ones stay inverted.
    fn from(node: &WideNode<W>) -> Self {
        let used = (node.used as usize).min(W);
        let (mut origin, mut scale) = ([0.0; 3], [0.0; 3]);
        let mut planes = [[0; W]; 6];
        for axis in 0..3 {
            let mut grid = Grid::of(node, axis, used);
            if axis == 0 {
                grid.step = with_used(grid.step, node.used);
            }
            // Inverted.
            let unused = if grid.is_reverse { [0, LAST] } else { [LAST, 0] };
            let ends: [[u8; 2]; W] = std::array::from_fn(|slot| {
                let is_box = slot < used && is_box(node, slot);
                if is_box { grid.ends(side(node, axis, slot)) } else { unused }
            });
            planes[2 * axis] = ends.map(|[min, _]| min);
            planes[2 * axis + 1] = ends.map(|[_, max]| max);
            origin[axis] = grid.origin;
            scale[axis] = if grid.is_reverse { -grid.step } else { grid.step };
        }
        Self { children: node.children, origin, scale, planes }
    }
}

/// True unless the box of a slot is inverted.
fn is_box<const W: usize>(node: &WideNode<W>, slot: usize) -> bool {
    !(0..3).any(|axis| node.bounds[2 * axis][slot] > node.bounds[2 * axis + 1][slot])
}

/// The smallest and the largest coordinate of a slot's box, made finite.
fn side<const W: usize>(node: &WideNode<W>, axis: usize, slot: usize) -> [f32; 2] {
    let finite = |x: f32, nan: f32| if x.is_nan() { nan } else { x.clamp(-f32::MAX, f32::MAX) };
    let [min, max] = [0, 1].map(|row| node.bounds[2 * axis + row][slot]);
    [finite(min, -f32::MAX), finite(max, f32::MAX)]
}

/// The planes of an axis.
struct Grid {
    /// The first.
    origin: f32,
    /// Their distance; positive.
    step: f32,
    /// They count down from the largest coordinate.
    is_reverse: bool,
}

impl Grid {
    fn of<const W: usize>(node: &WideNode<W>, axis: usize, used: usize) -> Self {
        let sides = || {
            (0..used).filter(|&slot| is_box(node, slot)).map(|slot| (slot, side(node, axis, slot)))
        };
        let first = sides().map(|(_, [min, _])| min).fold(f32::INFINITY, f32::min);
        let last = sides().map(|(_, [_, max])| max).fold(f32::NEG_INFINITY, f32::max);
        if first > last {
            // No box at all.
            return Self { origin: 0.0, step: 1.0, is_reverse: false };
        }
        // The faces of flat boxes at a coordinate.
        let flat_at = |x: f32| {
            let faces = sides().filter(|(_, side)| *side == [x; 2]).map(|(slot, _)| {
                let extent = |axis| side(node, axis, slot).map(f64::from);
                let [a, b] = [(axis + 1) % 3, (axis + 2) % 3].map(extent);
                (a[1] - a[0]) * (b[1] - b[0])
            });
            faces.sum::<f64>()
        };
        let is_reverse = flat_at(last) > flat_at(first);
        let origin = if is_reverse { last } else { first };
        Self { origin, step: step(above(last, first)), is_reverse }
    }

    /// The planes of a child's sides, rounded outward.
    fn ends(&self, [min, max]: [f32; 2]) -> [u8; 2] {
        if self.is_reverse {
            let distances = [above(self.origin, min), below(self.origin, max)];
            [ceil(distances[0], self.step), floor(distances[1], self.step)]
        } else {
            let distances = [below(min, self.origin), above(max, self.origin)];
            [floor(distances[0], self.step), ceil(distances[1], self.step)]
        }
    }
}

/// A step of which 255 are at least as long as `extent`; 1 for no extent.
fn step(extent: f64) -> f32 {
    if extent == 0.0 {
        return 1.0;
    }
    let last = f64::from(LAST);
    // The quotient is rounded, the product of 8 and 24 bits is exact.
    let mut step = round_up(extent / last).max(f32::MIN_POSITIVE);
    while f64::from(step) * last < extent {
        step = step.next_up();
    }
    step
}

/// The next larger scale whose lowest bits are `used`.
fn with_used(scale: f32, used: u32) -> f32 {
    let bits = scale.to_bits();
    let round_up = if bits & USED > used { USED + 1 } else { 0 };
    f32::from_bits((bits & !USED) + round_up + (used & USED))
}

/// The last step that is not behind `distance`, which is not negative.
fn floor(distance: f64, scale: f32) -> u8 {
    let scale = f64::from(scale);
    // The quotient is rounded, the product is exact. The cast saturates.
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "rounds down")]
    let step = (distance / scale) as u8;
    if f64::from(step) * scale > distance { step - 1 } else { step }
}

/// The first step that is not before `distance`, for which there is one.
fn ceil(distance: f64, scale: f32) -> u8 {
    let step = floor(distance, scale);
    if f64::from(step) * f64::from(scale) < distance { step.saturating_add(1) } else { step }
}

/// `a − b`, or the next larger number if that is not exact.
fn above(a: f32, b: f32) -> f64 {
    let (difference, error) = difference(a, b);
    if error > 0.0 { difference.next_up() } else { difference }
}

/// `a − b`, or the next smaller number if that is not exact.
fn below(a: f32, b: f32) -> f64 {
    let (difference, error) = difference(a, b);
    if error < 0.0 { difference.next_down() } else { difference }
}

/// `a − b` rounded, and what rounding took off: `a − b` exactly is the sum of both (Knuth 1969,
/// theorem 4.2.2B).
fn difference(a: f32, b: f32) -> (f64, f64) {
    let (a, b) = (f64::from(a), f64::from(b));
    let difference = a - b;
    let b_part = a - difference;
    let a_part = difference + b_part;
    (difference, (a - a_part) + (b_part - b))
}

/// The smallest `f32` that is not smaller.
#[expect(clippy::cast_possible_truncation, reason = "rounding is the purpose")]
fn round_up(x: f64) -> f32 {
    let rounded = x as f32;
    if f64::from(rounded) < x { rounded.next_up() } else { rounded }
}

/// The largest `f32` that is not larger.
fn round_down(x: f64) -> f32 {
    -round_up(-x)
}
