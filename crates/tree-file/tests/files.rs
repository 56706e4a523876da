//! What is saved is loaded again; what was damaged or forged is refused with a reason.

use niwaki_core::{Aabb, Bvh, BvhNode, Intersector, Ray, glam::Vec3};
use niwaki_hard_cases::{self as hard, median_tree, soup_mesh};
use niwaki_trace::{BinaryScene, HitQueries, MeshQueries, WideScene};
use niwaki_tree_file::{ReadError, TreeFault, TreeFile};
use niwaki_wide::{Bvh4, Bvh8, Bvh16, CollapseSettings, PartsError, WideBvh};
use proptest::prelude::*;
use std::path::PathBuf;

fn bytes_of(tree: &impl TreeFile) -> Vec<u8> {
    let mut file = Vec::new();
    tree.write_to(&mut file).unwrap();
    file
}

fn collapse<const W: usize>(bvh: &Bvh) -> WideBvh<W> {
    WideBvh::collapse(bvh, &CollapseSettings::default()).unwrap()
}

/// Corrects both checksums, as a forger would.
fn seal(file: &mut [u8]) {
    let payload = crc32fast::hash(&file[64..]);
    file[56..60].copy_from_slice(&payload.to_le_bytes());
    let header = crc32fast::hash(&file[..60]);
    file[60..64].copy_from_slice(&header.to_le_bytes());
}

fn word(file: &mut [u8], at: usize, value: u32) {
    file[at..at + 4].copy_from_slice(&value.to_le_bytes());
}

fn round_trip<T: TreeFile + PartialEq + std::fmt::Debug>(tree: &T) {
    let file = bytes_of(tree);
    assert_eq!(&T::read_from(&file[..]).unwrap(), tree);
    // The same bytes again, so nothing that is written was lost.
    assert_eq!(bytes_of(&T::read_from(&file[..]).unwrap()), file);
}

#[test]
fn every_tree_comes_back_as_it_was() {
    for case in hard::meshes() {
        let bvh = median_tree(&case.mesh, 3);
        round_trip(&bvh);
        round_trip(&collapse::<4>(&bvh));
        round_trip(&collapse::<8>(&bvh));
        round_trip(&collapse::<16>(&bvh));
    }
    round_trip(&Bvh::default());
    round_trip(&Bvh8::default());
    // A leaf larger than a wide tree's, so that slots share boxes; and more than one chunk.
    let large = Bvh {
        nodes: vec![BvhNode::leaf(Aabb::new(Vec3::ZERO, Vec3::ONE), 0, 300)],
        prim_ids: (0..300).collect(),
    };
    round_trip(&large);
    round_trip(&collapse::<4>(&large));
    round_trip(&median_tree(&soup_mesh(30_000, 0.02, 1), 1));
}

#[test]
fn chains_of_a_million_nodes_are_loaded() {
    let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
    let count = 1_000_000_u32;
    // Of each pair of children the second goes on with the pair behind it.
    let mut nodes = vec![BvhNode::inner(unit, 1)];
    for i in 0..count - 2 {
        nodes.extend([BvhNode::leaf(unit, i, 1), BvhNode::inner(unit, 2 * i + 3)]);
    }
    nodes.extend([count - 2, count - 1].map(|i| BvhNode::leaf(unit, i, 1)));
    round_trip(&Bvh { nodes, prim_ids: (0..count).collect() });
}

#[test]
fn files_on_disk_must_end_with_the_tree() {
    let path: PathBuf =
        std::env::temp_dir().join(format!("niwaki-tree-file-{}.bvh", std::process::id()));
    let bvh = median_tree(&soup_mesh(50, 0.2, 1), 2);
    bvh.save(&path).unwrap();
    assert_eq!(Bvh::load(&path).unwrap(), bvh);
    let mut file = std::fs::read(&path).unwrap();
    let whole = file.len() as u64;
    file.extend([0; 5]);
    std::fs::write(&path, &file).unwrap();
    let error = Bvh::load(&path).unwrap_err();
    assert!(
        matches!(error, ReadError::Trailing { found, expected } if found == whole + 5 && expected == whole),
        "{error}"
    );
    // In a stream, what follows is left for the next reader.
    let mut stream = &file[..];
    assert_eq!(Bvh::read_from(&mut stream).unwrap(), bvh);
    assert_eq!(stream, [0; 5]);
    std::fs::remove_file(&path).unwrap();
    assert!(matches!(Bvh::load(&path), Err(ReadError::Io(_))));
}

#[test]
fn every_error_names_what_is_wrong() {
    let good = bytes_of(&median_tree(&soup_mesh(50, 0.2, 1), 2));
    let refused = |file: &[u8]| Bvh::read_from(file).unwrap_err();
    let with = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut file = good.clone();
        change(&mut file);
        refused(&file)
    };
    assert!(matches!(refused(b""), ReadError::Truncated { found: 0, expected: 64 }));
    assert!(matches!(refused(b"solid"), ReadError::NotATree { .. }));
    assert!(matches!(refused(&[0; 4096]), ReadError::NotATree { .. }));
    // As a transfer in text mode would have it.
    assert!(matches!(with(&|f| f[7] = b'\r'), ReadError::NotATree { .. }));
    let error = with(&|f| word(f, 8, 2));
    assert!(matches!(error, ReadError::Version { found: 2, supported: 1 }), "{error}");
    assert!(matches!(with(&|f| f[20] ^= 1), ReadError::DamagedHeader { .. }));
    assert!(matches!(with(&|f| f[64] ^= 1), ReadError::Damaged { .. }));
    let error = Bvh8::read_from(&good[..]).unwrap_err();
    assert!(matches!(error, ReadError::Width { found: 2, expected: 8 }), "{error}");
    let end = good.len();
    for cut in [63, 64, 65, end / 2, end - 1] {
        match refused(&good[..cut]) {
            ReadError::Truncated { found, expected } => {
                assert_eq!(found, cut as u64);
                assert_eq!(expected, if cut < 64 { 64 } else { end as u64 });
            }
            error => panic!("{error}"),
        }
    }
    for at in [16, 20, 24] {
        let error = with(&|f| {
            word(f, at, 7);
            seal(f);
        });
        assert!(matches!(error, ReadError::BadCounts { .. }), "{error}");
    }
    // Read errors are passed on.
    struct Broken;
    impl std::io::Read for Broken {
        fn read(&mut self, _: &mut [u8]) -> std::io::Result<usize> {
            Err(std::io::Error::other("cable"))
        }
    }
    assert!(matches!(Bvh::read_from(Broken), Err(ReadError::Io(_))));
}

#[test]
fn forged_binary_trees_are_refused() {
    let unit = Aabb::new(Vec3::ZERO, Vec3::ONE);
    let leaf = |first, count| BvhNode::leaf(unit, first, count);
    let inner = |first| BvhNode::inner(unit, first);
    let good = Bvh {
        nodes: vec![inner(1), inner(3), leaf(0, 1), leaf(1, 1), leaf(2, 2)],
        prim_ids: vec![0, 1, 2, 3],
    };
    round_trip(&good);
    type Change = fn(&mut Bvh);
    let changes: [(Change, TreeFault); 11] = [
        (|b| b.nodes[0].first = 0, TreeFault::Child { node: 0, first_child: 0, nodes: 5 }),
        (|b| b.nodes[1].first = 0, TreeFault::Child { node: 1, first_child: 0, nodes: 5 }),
        (|b| b.nodes[1].first = 4, TreeFault::Child { node: 1, first_child: 4, nodes: 5 }),
        (
            |b| b.nodes[0].first = u32::MAX,
            TreeFault::Child { node: 0, first_child: u32::MAX, nodes: 5 },
        ),
        (|b| b.nodes[1].first = 2, TreeFault::TwoParents { node: 2 }),
        (|b| b.nodes[1] = b.nodes[2], TreeFault::TwoLeaves { reference: 0, node: 2 }),
        (|b| b.nodes[4].count = 3, TreeFault::Leaf { node: 4, end: 5, references: 4 }),
        (
            |b| b.nodes[4] = BvhNode { first: u32::MAX, count: u32::MAX, ..b.nodes[4] },
            TreeFault::Leaf { node: 4, end: 2 * u64::from(u32::MAX), references: 4 },
        ),
        (|b| b.nodes[4].count = 1, TreeFault::Unused { reference: 3 }),
        (|b| b.nodes[3].max.y = f32::NAN, TreeFault::Box { node: 3 }),
        (|b| b.nodes[3].min.y = 2.0, TreeFault::Box { node: 3 }),
    ];
    for (change, fault) in changes {
        let mut forged = good.clone();
        change(&mut forged);
        match Bvh::read_from(&bytes_of(&forged)[..]) {
            Err(ReadError::Malformed(found)) => assert_eq!(found, fault),
            other => panic!("{other:?} instead of {fault}"),
        }
    }
    // An orphan, and a box in the header that is not the root's.
    let mut forged = good.clone();
    forged.nodes[1] = leaf(4, 1);
    forged.prim_ids.push(4);
    let error = Bvh::read_from(&bytes_of(&forged)[..]).unwrap_err();
    assert!(matches!(error, ReadError::Malformed(TreeFault::Orphan { node: 3 })), "{error}");
    let mut file = bytes_of(&good);
    word(&mut file, 32, (-1.0_f32).to_bits());
    seal(&mut file);
    let error = Bvh::read_from(&file[..]).unwrap_err();
    assert!(matches!(error, ReadError::Malformed(TreeFault::Bounds)), "{error}");
}

#[test]
fn forged_wide_trees_are_refused() {
    let bvh = median_tree(&soup_mesh(60, 0.2, 1), 1);
    let good = bytes_of(&collapse::<4>(&bvh));
    let tree = collapse::<4>(&bvh);
    assert!(tree.nodes()[0].children[0] >> 31 == 0, "the root's first child is a node");
    // Words of the first node: 24 planes, 4 children, 3 counts.
    let at = |i: usize| 64 + 4 * i;
    let forged = |changes: &[(usize, u32)]| {
        let mut file = good.clone();
        for &(i, value) in changes {
            word(&mut file, at(i), value);
        }
        seal(&mut file);
        match Bvh4::read_from(&file[..]) {
            Err(ReadError::MalformedWide(fault)) => fault,
            other => panic!("{other:?}"),
        }
    };
    let used = tree.nodes()[0].used;
    assert_eq!(forged(&[(30, 0)]), PartsError::Slots { node: 0, used: 0 });
    assert_eq!(forged(&[(30, 5)]), PartsError::Slots { node: 0, used: 5 });
    let slot = used as usize - 1;
    assert_eq!(forged(&[(30, used - 1)]), PartsError::Unused { node: 0, slot });
    assert_eq!(forged(&[(0, f32::NAN.to_bits())]), PartsError::Box { node: 0, slot: 0 });
    for child in [0, 2, u32::MAX >> 1] {
        let fault = PartsError::Order { node: 0, slot: 0, child, expected: 1 };
        assert_eq!(forged(&[(24, child)]), fault);
    }
    assert_eq!(forged(&[(28, 3)]), PartsError::References { node: 0 });
    assert_eq!(forged(&[(24, (1 << 31) | 1)]), PartsError::References { node: 0 });
    assert_eq!(forged(&[(24, u32::MAX)]), PartsError::References { node: 0 });
    // A root of leaves alone leaves the others orphaned: none of them may lead to itself.
    let nodes = tree.nodes().to_vec();
    let mut lonely = WideBvh::<4>::collapse(
        &Bvh { nodes: vec![BvhNode::leaf(tree.bounds(), 0, 2)], prim_ids: vec![0, 1] },
        &CollapseSettings::default(),
    )
    .unwrap()
    .nodes()
    .to_vec();
    let root = lonely[0];
    lonely.extend(&nodes[1..]);
    let error = WideBvh::from_parts(lonely, vec![0, 1], tree.bounds()).unwrap_err();
    assert!(matches!(error, PartsError::Count { named_nodes: 1, .. }), "{error}");
    let mut own_child = nodes[0];
    own_child.children[0] = 1;
    let error = WideBvh::from_parts(vec![root, own_child], vec![0, 1], tree.bounds()).unwrap_err();
    assert!(matches!(error, PartsError::Count { named_nodes: 1, nodes: 2, .. }), "{error}");
    let error = WideBvh::from_parts(nodes, tree.prim_ids().to_vec(), Aabb::EMPTY).unwrap_err();
    assert_eq!(error, PartsError::Bounds);
    let error = WideBvh::<8>::from_parts(vec![], vec![3], Aabb::EMPTY).unwrap_err();
    assert!(matches!(error, PartsError::Count { .. }), "{error}");
}

/// Everything that traverses a tree, on whatever was loaded.
fn use_tree(bvh: &Bvh, rays: &[Ray]) {
    let mesh = soup_mesh(64, 0.3, 2);
    if let Ok(scene) = BinaryScene::new(bvh, &mesh) {
        let mut hits = Vec::new();
        for ray in rays {
            scene.all_hits(ray, &mut hits);
            assert_eq!(scene.any_hit(ray), !hits.is_empty());
        }
    }
    if let Ok(queries) = MeshQueries::new(bvh, &mesh) {
        let _ = queries.nearest(Vec3::ZERO, f64::INFINITY);
    }
    if let Ok(scene) = WideScene::new(bvh, &mesh) {
        rays.iter().for_each(|ray| assert!(scene.any_hit(ray) || !scene.closest_hit(ray).is_hit()));
    }
}

fn use_wide<const W: usize>(tree: WideBvh<W>, rays: &[Ray])
where
    WideScene<W>: Intersector,
{
    let mesh = soup_mesh(64, 0.3, 2);
    let Ok(scene) = WideScene::build_from(tree, &mesh) else { return };
    for kernel in WideScene::<W>::kernels() {
        let scene = scene.clone().with_kernel(kernel).unwrap();
        rays.iter().for_each(|ray| assert!(scene.any_hit(ray) || !scene.closest_hit(ray).is_hit()));
    }
}

fn rays() -> Vec<Ray> {
    let mesh = soup_mesh(64, 0.3, 2);
    hard::rays(&mesh, 3, 1)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn a_changed_byte_or_length_is_an_error(
        at in any::<prop::sample::Index>(), flip in 1..=255_u8, cut in any::<prop::sample::Index>(),
    ) {
        let bvh = median_tree(&soup_mesh(64, 0.3, 2), 2);
        for file in [bytes_of(&bvh), bytes_of(&collapse::<8>(&bvh))] {
            let mut changed = file.clone();
            changed[at.index(file.len())] ^= flip;
            prop_assert!(Bvh::read_from(&changed[..]).is_err());
            prop_assert!(Bvh8::read_from(&changed[..]).is_err());
            let cut = &file[..cut.index(file.len())];
            prop_assert!(Bvh::read_from(cut).is_err() && Bvh8::read_from(cut).is_err());
        }
    }

    #[test]
    fn forged_files_load_as_sound_trees_or_not_at_all(
        changes in prop::collection::vec(
            (any::<prop::sample::Index>(), prop_oneof![0..70_u32, any::<u32>()]), 1..4,
        ),
    ) {
        let rays = rays();
        let bvh = median_tree(&soup_mesh(64, 0.3, 2), 2);
        let forge = |mut file: Vec<u8>| {
            for (at, value) in &changes {
                let words = file.len() / 4 - 16;
                word(&mut file, 64 + 4 * at.index(words), *value);
            }
            seal(&mut file);
            file
        };
        if let Ok(bvh) = Bvh::read_from(&forge(bytes_of(&bvh))[..]) {
            use_tree(&bvh, &rays);
        }
        if let Ok(wide) = Bvh4::read_from(&forge(bytes_of(&collapse::<4>(&bvh)))[..]) {
            use_wide(wide, &rays);
        }
        if let Ok(wide) = Bvh8::read_from(&forge(bytes_of(&collapse::<8>(&bvh)))[..]) {
            use_wide(wide, &rays);
        }
        if let Ok(wide) = Bvh16::read_from(&forge(bytes_of(&collapse::<16>(&bvh)))[..]) {
            use_wide(wide, &rays);
        }
    }

    #[test]
    fn any_bytes_are_refused(
        mut bytes in prop::collection::vec(any::<u8>(), 0..600), marked in any::<bool>(),
    ) {
        if marked && bytes.len() >= 64 {
            bytes[..8].copy_from_slice(b"\x89NIWAKI\n");
            word(&mut bytes, 8, 1);
            word(&mut bytes, 12, 2);
            seal(&mut bytes);
        }
        prop_assert!(Bvh::read_from(&bytes[..]).is_err());
        prop_assert!(Bvh16::read_from(&bytes[..]).is_err());
    }
}
