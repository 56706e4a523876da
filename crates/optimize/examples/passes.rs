//! What every pass makes of a fast builder's tree: SAH cost before and after, and the time.
//!
//! `cargo run --release -p niwaki-optimize --example passes`

use niwaki_build_sweep::Sweep;
use niwaki_core::TriangleMesh;
use niwaki_hard_cases::{median_tree, soup};
use niwaki_optimize::{
    Annealing, Chain, CollapseLeaves, Insertion, OptimizeError, Optimizer, Prune, Reinsertion,
    Rotations, Treelets,
};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    // Small triangles, and large ones that a median split cannot tell from them.
    let triangles = [soup(50_000, 0.01, 1), soup(500, 0.5, 2)].concat();
    let mesh = TriangleMesh::from_triangles(&triangles)?;
    let tree = median_tree(&mesh, 1);
    let passes: Vec<Box<dyn Optimizer + Send>> = vec![
        Box::new(Rotations::default()),
        Box::new(Annealing::default()),
        Box::new(Treelets::default()),
        Box::new(Insertion::default()),
        Box::new(Reinsertion::default()),
        Box::new(Prune::new(Sweep::default())),
        Box::new(CollapseLeaves::default()),
        Box::new(Chain::new(vec![
            Box::new(Reinsertion::default()),
            Box::new(CollapseLeaves::default()),
        ])),
    ];
    println!("{:20} {:>8} {:>8} {:>6} {:>8} {:>9}", "pass", "before", "after", "", "changes", "ms");
    for pass in passes {
        print(&*pass, &mut tree.clone())?;
    }
    Ok(())
}

fn print(pass: &dyn Optimizer, tree: &mut niwaki_core::Bvh) -> Result<(), OptimizeError> {
    let report = pass.optimize(tree)?;
    println!(
        "{:20} {:8.2} {:8.2} {:5.0}% {:8} {:9.1}",
        pass.name(),
        report.before,
        report.after,
        100.0 * report.ratio(),
        report.changes,
        report.time.as_secs_f64() * 1e3
    );
    Ok(())
}
