//! Skins of glTF documents, and on which joints vertices hang.

use super::accessor::Document;
use crate::{
    Dropped, LoadError,
    animation::{Influence, Joint, Skin},
};
use glam::{DAffine3, DMat4};
use gltf::json::{Index, accessor::Accessor, mesh::Primitive, mesh::Semantic, validation::Checked};

/// Sets of four joints a vertex that are looked at; the largest four weights of all count.
const MOST_SETS: u32 = 8;

/// Where a node is: on which node of the rig it hangs, and its place in the coordinates of that
/// one, or in the world.
pub(super) type Place = (Option<u32>, DAffine3);

/// Reads a skin, given where the nodes of the file are; those that the scene does not hold have
/// no place.
pub(super) fn read(
    document: &Document<'_>,
    number: usize,
    places: &[Option<Place>],
) -> Result<Skin, LoadError> {
    let at = format!("skins[{number}]");
    let Some(skin) = document.root.skins.get(number) else {
        let reason = format!("it does not exist, there are {}", document.root.skins.len());
        return Err(document.fail(at, reason, "remove the reference to it"));
    };
    let binds = match skin.inverse_bind_matrices {
        Some(index) => document.matrices(index, &format!("{at}.inverseBindMatrices"))?,
        None => Vec::new(),
    };
    if skin.inverse_bind_matrices.is_some() && binds.len() < skin.joints.len() {
        let reason = format!("{} matrices for {} joints", binds.len(), skin.joints.len());
        let remedy = "give every joint its matrix";
        return Err(document.fail(format!("{at}.inverseBindMatrices"), reason, remedy));
    }
    let mut joints = Vec::with_capacity(skin.joints.len());
    for (j, node) in skin.joints.iter().enumerate() {
        let at = format!("{at}.joints[{j}]");
        let place = places.get(node.value()).copied().ok_or_else(|| {
            let reason =
                format!("nodes[{}] does not exist, there are {}", node.value(), places.len());
            document.fail(at.as_str(), reason, "name a node that exists")
        })?;
        let (node, fixed) = place.ok_or_else(|| {
            let reason = format!("nodes[{}] is not part of the scene", node.value());
            document.fail(at.as_str(), reason, "add it, or one above it, to the scene's nodes")
        })?;
        let bind = match binds.get(j) {
            Some(bind) => DAffine3::from_mat4(DMat4::from_cols_array(&bind.map(f64::from))),
            None => DAffine3::IDENTITY,
        };
        if !bind.is_finite() {
            let at = format!("skins[{number}].inverseBindMatrices");
            let reason = format!("the matrix of joint {j} is not finite");
            return Err(document.fail(at, reason, "correct it, or bind the skin again"));
        }
        joints.push(Joint { node, from_bind: fixed * bind });
    }
    Ok(Skin { joints })
}

/// On which joints the vertices of a primitive hang; empty if on none.
pub(super) fn influences(
    document: &Document<'_>,
    primitive: &Primitive,
    vertices: usize,
    at: &str,
    dropped: &mut Dropped,
) -> Result<Vec<Influence>, LoadError> {
    let get = |semantic: Semantic| primitive.attributes.get(&Checked::Valid(semantic)).copied();
    let mut out: Vec<Influence> = Vec::new();
    for set in 0..MOST_SETS {
        let (joints, weights) = match (get(Semantic::Joints(set)), get(Semantic::Weights(set))) {
            (None, None) => break,
            (Some(joints), Some(weights)) => (joints, weights),
            (joints, _) => {
                let (has, lacks) =
                    if joints.is_some() { ("JOINTS", "WEIGHTS") } else { ("WEIGHTS", "JOINTS") };
                let reason = format!("it has {has}_{set} but no {lacks}_{set}");
                return Err(document.fail(
                    format!("{at}.attributes"),
                    reason,
                    "give it both, or neither",
                ));
            }
        };
        let (joints, weights) = one_set(document, [joints, weights], set, vertices, at)?;
        if set == 0 {
            let influence = |(joints, weights)| Influence { joints, weights };
            out = joints.into_iter().zip(weights).map(influence).collect();
        } else {
            for (influence, (joints, weights)) in
                out.iter_mut().zip(joints.into_iter().zip(weights))
            {
                *influence = strongest(*influence, Influence { joints, weights });
            }
        }
    }
    let mut mended = 0;
    for influence in &mut out {
        let weights = influence.weights;
        let usable = weights.iter().all(|w| w.is_finite() && *w >= 0.0);
        mended += usize::from(!usable || weights.iter().all(|w| *w == 0.0));
        *influence = influence.normalized();
    }
    if mended > 0 {
        dropped.attributes += 1;
        dropped.note(|| format!("{at}: {mended} vertices with weights that are no weights"));
    }
    Ok(out)
}

type Set = (Vec<[u16; 4]>, Vec<[f32; 4]>);

fn one_set(
    document: &Document<'_>,
    [joints, weights]: [Index<Accessor>; 2],
    set: u32,
    vertices: usize,
    at: &str,
) -> Result<Set, LoadError> {
    let joints_at = format!("{at}.attributes.JOINTS_{set}");
    let weights_at = format!("{at}.attributes.WEIGHTS_{set}");
    let joints = document.joints(joints, &joints_at)?;
    let weights = document.vectors::<4>(weights, &weights_at)?;
    for (count, at) in [(joints.len(), joints_at), (weights.len(), weights_at)] {
        if count != vertices {
            let reason = format!("{count} elements for {vertices} vertices");
            return Err(document.fail(at, reason, "give every vertex its joints and weights"));
        }
    }
    Ok((joints, weights))
}

/// The four largest weights of eight.
fn strongest(a: Influence, b: Influence) -> Influence {
    let mut all: Vec<(u16, f32)> =
        [a, b].iter().flat_map(|i| i.joints.into_iter().zip(i.weights)).collect();
    // Stable, so that of equal ones the first stay.
    all.sort_by(|a, b| b.1.max(0.0).total_cmp(&a.1.max(0.0)));
    Influence {
        joints: std::array::from_fn(|k| all[k].0),
        weights: std::array::from_fn(|k| all[k].1),
    }
}
