//! Tree files of any bytes.

use super::bytes::Bytes;
use niwaki_core::{Bvh, Ray, TriangleMesh, glam::Vec3};
use niwaki_hard_cases::{counting::peak, median_tree, soup_mesh};
use niwaki_trace::{BinaryScene, HitQueries, WideScene};
use niwaki_tree_file::{ReadError, TreeFile};
use niwaki_wide::{CollapseSettings, WideBvh};

/// Bytes of a header.
const HEADER: usize = 64;

/// Triangles that files may refer to; one that refers to others is not traced.
const TRIANGLES: usize = 64;

/// Bytes that reading may take at once, where they are counted (in `fuzz/`).
const fn most_bytes(len: usize) -> usize {
    (4 << 20) + 64 * len
}

/// The bytes as they are.
pub(crate) fn plain(data: &[u8]) {
    binary(data);
    wide::<4>(data);
    wide::<8>(data);
    wide::<16>(data);
}

/// The bytes as nodes and references, and what a forger has to say about them: a width, a number
/// of nodes, and whether the box of the header is the root's.
pub(crate) fn forged(data: &[u8]) {
    let mut bytes = Bytes::new(data);
    let choice = bytes.byte();
    let nodes = usize::from(bytes.byte());
    let payload = data.get(2..).unwrap_or_default();
    let width = [2, 4, 8, 16][usize::from(choice & 3)];
    let words = if width == 2 { 8 } else { 7 * width + 3 };
    let payload = &payload[..payload.len() / 4 * 4];
    let nodes = nodes.min(payload.len() / 4 / words);
    let references = payload.len() / 4 - nodes * words;
    let bounds: [u8; 24] = if choice & 4 != 0 { [0; 24] } else { root_bounds(payload, width) };
    let file = seal(width, nodes, references, &bounds, payload);
    // So sealed, what is refused is refused for what it says.
    let error = match width {
        2 => binary(&file),
        4 => wide::<4>(&file),
        8 => wide::<8>(&file),
        _ => wide::<16>(&file),
    };
    use ReadError::{BadCounts, Malformed, MalformedWide};
    let expected = matches!(error, None | Some(BadCounts { .. } | Malformed(_) | MalformedWide(_)));
    assert!(expected, "{error:?}");
}

/// A file with both checksums.
fn seal(width: usize, nodes: usize, references: usize, bounds: &[u8], payload: &[u8]) -> Vec<u8> {
    let word = |n: usize| niwaki_core::to_u32(n).to_le_bytes();
    let mut file = b"\x89NIWAKI\n".to_vec();
    file.extend([word(1), word(width), word(nodes), word(references)].as_flattened());
    file.extend((payload.len() as u64).to_le_bytes());
    file.extend(bounds);
    file.extend(crc32fast::hash(payload).to_le_bytes());
    file.extend(crc32fast::hash(&file).to_le_bytes());
    assert_eq!(file.len(), HEADER);
    file.extend(payload);
    file
}

/// The box of the first node; nothing where that is wide, as its slots' boxes are united.
fn root_bounds(payload: &[u8], width: usize) -> [u8; 24] {
    let float = |word: usize| {
        let bytes = payload.get(4 * word..4 * word + 4).and_then(|b| b.try_into().ok());
        f32::from_le_bytes(bytes.unwrap_or([0; 4]))
    };
    let corners: [f32; 6] = if width == 2 {
        [0, 1, 2, 4, 5, 6].map(float)
    } else {
        let row = |row: usize| (0..width).map(move |slot| float(row * width + slot));
        let min = |r| row(r).fold(f32::INFINITY, f32::min);
        let max = |r| row(r).fold(f32::NEG_INFINITY, f32::max);
        [min(0), min(2), min(4), max(1), max(3), max(5)]
    };
    let mut out = [0; 24];
    for (out, corner) in out.chunks_exact_mut(4).zip(corners) {
        out.copy_from_slice(&corner.to_le_bytes());
    }
    out
}

/// Reads, and does with what was read all that its guarantee covers.
fn read<T: TreeFile>(data: &[u8]) -> Result<T, ReadError> {
    let mut rest = data;
    let (tree, bytes) = peak(|| T::read_from(&mut rest));
    assert!(bytes <= most_bytes(data.len()), "{bytes} bytes at once for {}", data.len());
    let tree = tree?;
    let mut written = Vec::new();
    tree.write_to(&mut written).expect("memory can be written");
    let read = data.len() - rest.len();
    assert_eq!(written, data[..read], "it is not what was read");
    Ok(tree)
}

fn binary(data: &[u8]) -> Option<ReadError> {
    let bvh = match read::<Bvh>(data) {
        Ok(bvh) => bvh,
        Err(error) => return Some(error),
    };
    if let Some(mesh) = mesh_of(&bvh.prim_ids) {
        trace(&BinaryScene::new(&bvh, &mesh).expect("what is loaded is sound"), &mesh);
        let scene = WideScene::new(&bvh, &mesh).expect("what is loaded is sound");
        trace(&scene, &mesh);
    }
    None
}

fn wide<const W: usize>(data: &[u8]) -> Option<ReadError>
where
    WideBvh<W>: TreeFile,
    WideScene<W>: HitQueries,
{
    let bvh = match read::<WideBvh<W>>(data) {
        Ok(bvh) => bvh,
        Err(error) => return Some(error),
    };
    if let Some(mesh) = mesh_of(bvh.prim_ids()) {
        let scene = WideScene::build_from(bvh, &mesh).expect("what is loaded is sound");
        for kernel in WideScene::<W>::kernels() {
            trace(&scene.clone().with_kernel(kernel).expect("it is available"), &mesh);
        }
    }
    None
}

/// A mesh that has all the triangles, if those are few.
fn mesh_of(prim_ids: &[u32]) -> Option<TriangleMesh> {
    let fits = prim_ids.iter().all(|&id| (id as usize) < TRIANGLES);
    fits.then(|| soup_mesh(TRIANGLES, 0.5, 1))
}

/// No panic, no end that does not come, and no triangle that does not exist.
fn trace(scene: &impl HitQueries, mesh: &TriangleMesh) {
    let directions = [Vec3::Z, Vec3::new(-1.0, 0.5, 0.25), Vec3::new(0.0, -1.0, -0.0)];
    for direction in directions {
        let ray = Ray::new(direction * -4.0, direction);
        let hit = scene.closest_hit(&ray);
        assert!(!hit.is_hit() || (hit.prim_id as usize) < mesh.len());
        assert_eq!(scene.any_hit(&ray), hit.is_hit());
    }
}

/// Good files of each kind, whole and empty.
pub(crate) fn plain_seeds() -> Vec<Vec<u8>> {
    fn file(tree: &impl TreeFile) -> Vec<u8> {
        let mut file = Vec::new();
        tree.write_to(&mut file).expect("memory can be written");
        file
    }
    fn collapsed<const W: usize>(bvh: &Bvh) -> Vec<u8>
    where
        WideBvh<W>: TreeFile,
    {
        file(&WideBvh::<W>::collapse(bvh, &CollapseSettings::default()).expect("it is sound"))
    }
    let mut seeds = Vec::new();
    for (triangles, leaf) in [(0, 1), (1, 1), (5, 1), (9, 3), (20, 2)] {
        let bvh = median_tree(&soup_mesh(triangles, 0.5, 1), leaf);
        seeds.push(file(&bvh));
        seeds.push(collapsed::<4>(&bvh));
        seeds.push(collapsed::<8>(&bvh));
        seeds.push(collapsed::<16>(&bvh));
    }
    seeds
}

/// The same without their headers.
pub(crate) fn forged_seeds() -> Vec<Vec<u8>> {
    let forge = |file: Vec<u8>| {
        let width = match file[12] {
            2 => 0,
            4 => 1,
            8 => 2,
            _ => 3,
        };
        // Fewer than 256 nodes.
        [&[width, file[16]], &file[HEADER..]].concat()
    };
    plain_seeds().into_iter().map(forge).collect()
}
