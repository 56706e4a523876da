//! A header that claims much costs no more memory than what follows it.

use niwaki_core::Bvh;
use niwaki_hard_cases::{counting, median_tree, soup_mesh};
use niwaki_tree_file::{ReadError, TreeFile};

#[global_allocator]
static ALLOCATOR: counting::Counting = counting::Counting;

#[test]
fn memory_grows_with_the_file_not_with_its_claims() {
    // Two buffers of 65,536 words.
    const BUFFERS: usize = 2 << 18;
    let bvh = median_tree(&soup_mesh(50_000, 0.05, 1), 1);
    let mut file = Vec::new();
    bvh.write_to(&mut file).unwrap();
    for claimed in [bvh.nodes.len(), u32::MAX as usize] {
        let nodes = u32::try_from(claimed).unwrap();
        let bytes = 32 * u64::from(nodes) + 4 * bvh.prim_ids.len() as u64;
        file[16..20].copy_from_slice(&nodes.to_le_bytes());
        file[24..32].copy_from_slice(&bytes.to_le_bytes());
        let header = crc32fast::hash(&file[..60]);
        file[60..64].copy_from_slice(&header.to_le_bytes());
        for length in [64, 1_000, file.len() / 2, file.len()] {
            let (tree, peak) = counting::peak(|| Bvh::read_from(&file[..length]));
            assert!(peak <= 3 * length + BUFFERS, "{peak} bytes for a file of {length}");
            if length == file.len() && claimed == bvh.nodes.len() {
                assert_eq!(tree.unwrap(), bvh);
            } else {
                let error = tree.unwrap_err();
                assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
            }
        }
    }
}
