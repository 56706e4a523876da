//! Builders on triangles and boxes of any bits.

use super::{bytes::Bytes, pool, world};
use crate::{builders, same_bytes, same_wide};
use niwaki_core::{Aabb, BuildError, Builder, Bvh, PrimRef, Triangle, TriangleMesh, to_u32};
use niwaki_metrics::validate;
use niwaki_wide::{Bvh8, CollapseSettings};

/// The most boxes of an input.
const BOXES: usize = 48;

/// Bytes as triangles or, with an odd first one, as boxes that no triangle stands behind.
pub(crate) fn check(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    if bytes.byte() & 1 == 0 {
        let mesh = world::mesh(&mut bytes);
        for builder in builders() {
            let bvh = twice(&*builder, |builder| builder.build_mesh(&mesh))
                .unwrap_or_else(|error| panic!("{}: {error}", builder.name()));
            sound(&*builder, &bvh, &mesh);
        }
        return;
    }
    let mut boxes = Vec::new();
    while boxes.len() < BOXES && !bytes.is_empty() {
        let ordered = bytes.byte() & 7 != 0;
        let (a, b) = (world::vector(&mut bytes), world::vector(&mut bytes));
        boxes.push(if ordered { Aabb::new(a.min(b), a.max(b)) } else { Aabb::new(a, b) });
    }
    let prims: Vec<PrimRef> =
        boxes.iter().zip(0..).map(|(bounds, id)| PrimRef::new(*bounds, id)).collect();
    let is_bad = |b: &Aabb| !(b.min.is_finite() && b.max.is_finite() && b.min.cmple(b.max).all());
    let bad = boxes.iter().position(is_bad);
    // A triangle that fills its box, to hold the tree against. It has no area, so where a box
    // was split, only the structure is looked at.
    let fills = |b: &Aabb| Triangle::new(b.min, b.max, b.min);
    for builder in builders() {
        match twice(&*builder, |builder| builder.build(&prims)) {
            Ok(bvh) => {
                assert_eq!(bad, None, "{} takes a bad box", builder.name());
                let triangles: Vec<_> = boxes.iter().map(fills).collect();
                let mesh = TriangleMesh::from_triangles(&triangles).expect("the boxes are finite");
                sound(&*builder, &bvh, &mesh);
            }
            Err(BuildError::NonFiniteBounds { index, prim_id, .. }) => {
                assert_eq!((Some(index), prim_id), (bad, to_u32(index)), "{}", builder.name());
            }
            Err(error) => panic!("{}: {error}", builder.name()),
        }
    }
}

/// Builds on one thread and on three, which has to give the same bytes; the same errors too.
fn twice(
    builder: &dyn Builder,
    build: impl Fn(&dyn Builder) -> Result<Bvh, BuildError> + Sync,
) -> Result<Bvh, BuildError> {
    let both = [1, 3].map(|threads| {
        pool(threads).install(|| -> Result<_, BuildError> {
            let bvh = build(builder)?;
            let wide = Bvh8::collapse(&bvh, &CollapseSettings::default())
                .unwrap_or_else(|error| panic!("{}: {error}", builder.name()));
            Ok((bvh, wide))
        })
    });
    match both {
        [Ok((bvh, wide)), Ok((other, other_wide))] => {
            let same = same_bytes(&bvh, &other) && same_wide(&wide, &other_wide);
            assert!(same, "{}: another tree on three threads", builder.name());
            Ok(bvh)
        }
        [Err(error), Err(other)] => {
            // Compared as text, since bounds may be NaN.
            assert_eq!(error.to_string(), other.to_string(), "{}", builder.name());
            Err(error)
        }
        _ => panic!("{}: an error on one number of threads only", builder.name()),
    }
}

fn sound(builder: &dyn Builder, bvh: &Bvh, mesh: &TriangleMesh) {
    if let Err(violations) = validate(bvh, mesh) {
        panic!("{}: {}, of {mesh:?} in {bvh:?}", builder.name(), violations[0]);
    }
}

/// Equal triangles, a fan, numbers of every size, and boxes, good and bad.
pub(crate) fn seeds() -> Vec<Vec<u8>> {
    let mut seeds: Vec<Vec<u8>> = super::kernels::seeds();
    for seed in &mut seeds {
        // Without the tree that the first byte chooses there.
        seed[0] = 0;
    }
    // Integers as floats: tag 0 and the value.
    let integers = |values: &[i8]| {
        values.iter().flat_map(|value| [0, value.cast_unsigned()]).collect::<Vec<u8>>()
    };
    let boxes = [[0, 0, 0, 1, 1, 1], [1, 0, 0, 3, 1, 1], [-9, 2, 5, 4, 2, 5]];
    let ordered: Vec<u8> = boxes.iter().flat_map(|b| [&[1][..], &integers(b)].concat()).collect();
    seeds.push([&[1], &*ordered].concat());
    // The last box inside out.
    seeds.push([&[1], &*ordered, &[0], &*integers(&[1, 0, 0, 0, 0, 0])].concat());
    // One box 40 times.
    seeds.push([&[1], &*ordered[..13].repeat(40)].concat());
    seeds
}
