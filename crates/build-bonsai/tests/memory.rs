//! `memory_bound` holds and is not far off, measured by an allocator that counts.

use niwaki_build_bonsai::{Bonsai, Pruning};
use niwaki_build_sweep::Sweep;
use niwaki_core::glam::Vec3;
use niwaki_core::{Builder, Triangle, TriangleMesh};
use niwaki_hard_cases::counting::{self, Counting};

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// A bumpy sheet of about `count` triangles.
fn sheet(count: usize) -> TriangleMesh {
    let side = u32::try_from((count / 2).isqrt()).unwrap();
    let positions = (0..=side)
        .flat_map(|y| (0..=side).map(move |x| (x as f32, y as f32)))
        .map(|(x, y)| Vec3::new(x, y, (x * 0.1).sin() * (y * 0.07).cos() * 20.0))
        .collect();
    let indices = (0..side)
        .flat_map(|y| (0..side).map(move |x| (y * (side + 1) + x, (y + 1) * (side + 1) + x)))
        .flat_map(|(i, j)| [[i, i + 1, j], [j, i + 1, j + 1]])
        .collect();
    TriangleMesh::new(positions, indices).unwrap()
}

fn peak(builder: &dyn Builder, mesh: &TriangleMesh) -> usize {
    let (bvh, peak) = counting::peak(|| builder.build_mesh(mesh).unwrap());
    assert!(bvh.bytes() <= peak);
    peak
}

/// One test, because the counters are global.
#[test]
fn bounds_hold_and_are_tight() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(2).build().unwrap();
    pool.install(|| {
        let everything_cut = Bonsai { pruning: Pruning::Mean(0.0), ..Bonsai::bonsai() };
        let single_leaves = Bonsai { max_leaf_size: 1, ..everything_cut };
        for count in [1000, 30_000, 400_000] {
            let mesh = sheet(count);
            let builders: [(&dyn Builder, usize); 7] = [
                // The bounds allow for groups of one triangle each; these are of hundreds.
                (&Bonsai::bonsai(), 6),
                (&Bonsai::bonsai_p(), 6),
                (&Bonsai::bonsai_p_star(), 6),
                // The bound is for twice the references, of which a sheet has none.
                (&Bonsai::bonsai_s(), 10),
                (&everything_cut, 3),
                (&single_leaves, 2),
                (&Sweep::default(), 2),
            ];
            for (builder, slack) in builders {
                let (peak, bound) = (peak(builder, &mesh), builder.memory_bound(mesh.len()));
                println!(
                    "{} {count}: {} of {}",
                    builder.name(),
                    peak / mesh.len(),
                    bound / mesh.len()
                );
                assert!(peak <= bound, "{} {count}: {peak} over {bound}", builder.name());
                if count == 400_000 {
                    assert!(bound <= slack * peak, "{}: {bound} for {peak}", builder.name());
                }
            }
        }
        // The target for large meshes, the fixed part of workspaces left out.
        let mesh = sheet(400_000);
        let p = peak(&Bonsai::bonsai_p(), &mesh);
        assert!(p < 100 * mesh.len(), "{} bytes a triangle", p / mesh.len());
        let s = peak(&Bonsai::bonsai_s(), &mesh);
        assert!(s <= 2 * p, "{} bytes a triangle against {}", s / mesh.len(), p / mesh.len());
        // Everything overlaps everything and wants to be split.
        let triangles: Vec<Triangle> = (0..150_000)
            .map(|i| {
                let a = i as f32 * 0.001;
                let across = Vec3::new(1000.0 - a, 1000.0, 1000.0);
                Triangle::new(Vec3::new(a, 0.0, -a), across, Vec3::new(a + 3.0, 1.0, a))
            })
            .collect();
        let mesh = TriangleMesh::from_triangles(&triangles).unwrap();
        let builder = Bonsai::bonsai_s();
        let (peak, bound) = (peak(&builder, &mesh), builder.memory_bound(mesh.len()));
        println!("diagonals: {} of {}", peak / mesh.len(), bound / mesh.len());
        assert!(peak <= bound && bound <= 8 * peak, "{peak} of {bound}");
    });
}
