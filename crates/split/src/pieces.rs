//! Pieces of primitives that are split one by one, within a bound on their number.

use niwaki_core::{Aabb, Clip, PrimRef, to_u32};
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Primitives of one task.
const CHUNK: usize = 1024;

/// Steps of the threshold for each factor of two.
const STEPS: u32 = 4;

/// Takes pieces as they are made; answers false when there are too many.
pub(crate) type Emit<'a> = &'a mut dyn FnMut(PrimRef) -> bool;

/// The pieces of `count` primitives at the smallest threshold that leaves no more than `most`: the
/// one asked for, or that times 2^(k/4) with the least k up to `doublings`·4.
///
/// `visit` makes the pieces of one primitive at one threshold, more for smaller ones, and stops
/// when it is told to.
pub(crate) fn within(
    count: usize,
    most: usize,
    threshold: f64,
    doublings: u32,
    visit: impl Fn(usize, f64, Emit<'_>) + Sync,
) -> Vec<PrimRef> {
    let at = |step: u32| threshold * (f64::from(step) / f64::from(STEPS)).exp2();
    let counted = |step: u32| number(count, most, |i, emit| visit(i, at(step), emit));
    // Smaller steps have too many pieces, larger ones have not.
    let (mut low, mut high) = (0, doublings * STEPS);
    let mut best = counted(0);
    if best.is_none() {
        while low + 1 < high {
            let middle = (low + high) / 2;
            match counted(middle) {
                Some(numbers) => (high, best) = (middle, Some(numbers)),
                None => low = middle,
            }
        }
        if best.is_none() {
            best = counted(high);
        }
    } else {
        high = 0;
    }
    // Without a threshold that fits, nothing is split.
    let (step, numbers) = match best {
        Some(numbers) => (at(high), numbers),
        None => (
            f64::INFINITY,
            number(count, usize::MAX, |i, emit| {
                visit(i, f64::INFINITY, emit);
            })
            .unwrap_or_default(),
        ),
    };
    write(&numbers, |i, emit| visit(i, step, emit))
}

/// How many pieces each chunk of primitives has; `None` if all together have more than `most`.
pub(crate) fn number(
    count: usize,
    most: usize,
    visit: impl Fn(usize, Emit<'_>) + Sync,
) -> Option<Vec<Vec<u32>>> {
    let total = AtomicUsize::new(0);
    let numbers: Vec<Vec<u32>> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .map(|chunk| {
            (chunk * CHUNK..count.min((chunk + 1) * CHUNK))
                .map(|i| {
                    let mut pieces = 0_usize;
                    visit(i, &mut |_| {
                        pieces += 1;
                        total.fetch_add(1, Relaxed) < most
                    });
                    to_u32(pieces)
                })
                .collect()
        })
        .collect();
    (total.into_inner() <= most).then_some(numbers)
}

/// The pieces of all primitives in order, given their numbers.
pub(crate) fn write(numbers: &[Vec<u32>], visit: impl Fn(usize, Emit<'_>) + Sync) -> Vec<PrimRef> {
    let sum = |numbers: &[u32]| numbers.iter().map(|&n| n as usize).sum::<usize>();
    let mut pieces = bytemuck::zeroed_vec(numbers.iter().map(|chunk| sum(chunk)).sum());
    let mut rest = &mut pieces[..];
    let mut tasks = Vec::with_capacity(numbers.len());
    for (chunk, numbers) in numbers.iter().enumerate() {
        let here;
        (here, rest) = rest.split_at_mut(sum(numbers));
        tasks.push((chunk * CHUNK, numbers.len(), here));
    }
    tasks.into_par_iter().for_each(|(first, len, pieces)| {
        let mut places = pieces.iter_mut();
        for i in first..first + len {
            visit(i, &mut |piece| {
                if let Some(place) = places.next() {
                    *place = piece;
                }
                true
            });
        }
    });
    pieces
}

/// Halves a reference at the middle of its longest edge until `measure` is nowhere above the
/// threshold.
pub(crate) fn halve<C: Clip + ?Sized>(
    prim: PrimRef,
    clip: &C,
    threshold: f64,
    measure: impl Fn(&Aabb) -> f64,
    emit: Emit<'_>,
) {
    let mut stack = vec![prim];
    while let Some(prim) = stack.pop() {
        let aabb = prim.aabb();
        let axis = aabb.longest_axis();
        let middle = aabb.center()[axis];
        // Boxes as thin as a rounding error have no middle.
        if measure(&aabb) > threshold && aabb.min[axis] < middle && middle < aabb.max[axis] {
            let parts = clip.clip(&prim, axis, middle);
            let before = stack.len();
            for part in parts.iter().rev().filter(|part| !part.is_empty()) {
                stack.push(PrimRef { min: part.min, max: part.max, ..prim });
            }
            if stack.len() > before {
                continue;
            }
        }
        if !emit(prim) {
            return;
        }
    }
}

/// Bytes that splitting `count` primitives into at most `most` pieces allocates at once: the list
/// of references, the numbers of two thresholds, and the result.
pub(crate) fn memory_bound(count: usize, most: usize) -> usize {
    size_of::<PrimRef>() * (count + most) + 16 * count + 65536
}
