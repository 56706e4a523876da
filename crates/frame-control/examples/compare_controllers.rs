//! probe
use niwaki_frame_control::sim::*;
use niwaki_frame_control::*;
fn main() {
    for script in [
        Script::fairy(100),
        Script::cabin(100),
        Script::wall(Scene::fairy(), 60, 20, 40),
        Script::turn(Scene::fairy(), 60, 30),
        Script::turn(Scene::cabin(), 60, 30),
    ] {
        println!("{}", script.name);
        for f in [0, 25, 29, 31, 50, 75, 99] {
            let v = script.view(f);
            let c = v.counters;
            let h = v.hidden;
            print!(
                "{f:3} pt {:.1} pi {:.2} st {:.1} v {:.2} at {:.1} aw {:.2} m {:.2} mir {:.3} ws {:.2}M spread {:.2} depth {:.1}",
                c.primary_traversals,
                c.primary_intersections,
                c.shadow_traversals,
                c.visible,
                c.ao_traversals,
                c.ao_intersections,
                c.coalescing,
                c.mirrors,
                h.working_set / 1e6,
                h.spread,
                h.depth
            );
            for spec in
                [DeviceSpec::geforce_8800(), DeviceSpec::geforce_580(), DeviceSpec::radeon_5870()]
            {
                let d = Device::new(spec, 1).unwrap();
                let l = Ladder::ray_tracing(64, 0.1).unwrap();
                print!(
                    " | {:.0} {:.0} {:.0}",
                    d.ideal_ms(&v, &l.rungs()[0]),
                    d.ideal_ms(&v, &l.rungs()[30]),
                    d.ideal_ms(&v, &l.rungs()[65])
                );
            }
            println!();
        }
    }
}
