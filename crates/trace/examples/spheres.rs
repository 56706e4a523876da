//! A tree over spheres: any primitive with a box and an intersection will do.

use fastrand::Rng;
use niwaki_build_sbvh::Sbvh;
use niwaki_core::{Aabb, Builder, Hit, Intersector, PrimRef, Ray, glam::Vec3};
use niwaki_trace::CustomScene;

struct Sphere {
    center: Vec3,
    radius: f32,
}

/// The first `t` in the ray's range.
fn intersect(sphere: &Sphere, ray: &Ray) -> Option<Hit> {
    let (to_origin, d) = (ray.origin - sphere.center, ray.direction);
    let (a, b) = (d.length_squared(), to_origin.dot(d));
    let root = (b * b - a * (to_origin.length_squared() - sphere.radius.powi(2))).sqrt();
    [(-b - root) / a, (-b + root) / a]
        .into_iter()
        .find(|t| (ray.t_min..=ray.t_max).contains(t))
        .map(|t| Hit { t, ..Hit::MISS })
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut rng = Rng::with_seed(3);
    let mut number = || rng.f32() * 2.0 - 1.0;
    let spheres: Vec<Sphere> = (0..40)
        .map(|_| Sphere {
            center: Vec3::new(number(), number(), number()),
            radius: 0.08 + 0.12 * number().abs(),
        })
        .collect();
    // A little more than the sphere, because computed hits are rounded.
    let bounds = |s: &Sphere| {
        let r = Vec3::splat(s.radius * 1.0001);
        Aabb::new(s.center - r, s.center + r)
    };
    let prims: Vec<PrimRef> =
        (0..).zip(&spheres).map(|(i, s)| PrimRef::new(bounds(s), i)).collect();
    let bvh = Sbvh::default().build(&prims)?;
    let scene = CustomScene::new(&bvh, |id: u32, ray: &Ray| intersect(&spheres[id as usize], ray))?;
    for y in 0..24_u16 {
        let line: String = (0..64_u16)
            .map(|x| {
                let at = Vec3::new(f32::from(x) / 25.0 - 1.28, 1.28 - f32::from(y) / 9.4, -4.0);
                let ray = Ray::new(at, Vec3::Z);
                let hit = scene.closest_hit(&ray);
                if !hit.is_hit() {
                    return ' ';
                }
                let sphere = &spheres[hit.prim_id as usize];
                let normal = (ray.at(hit.t) - sphere.center) / sphere.radius;
                match normal.dot(Vec3::new(-0.5, 0.5, -0.7)) {
                    d if d > 0.8 => '@',
                    d if d > 0.5 => 'o',
                    d if d > 0.1 => ':',
                    _ => '.',
                }
            })
            .collect();
        println!("{line}");
    }
    Ok(())
}
