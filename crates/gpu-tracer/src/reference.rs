//! The same frame on the CPU: twin of `tracer/frame.wgsl`, function by function, for tests and as the reference of
//! what ambient occlusion with few directions errs by.

use crate::{
    FrameSettings,
    layout::{
        DIRECTIONAL, FrameWords, LightWords, MaterialWords, SPOT, light_count, mean_radiance,
        shapes, unpack_normal,
    },
};
use niwaki_core::{
    Hit, Intersector, Ray,
    glam::{Vec2, Vec3},
};
use niwaki_render::{Image, offset::CLEARANCE, pcg4d};
use niwaki_scene::{Camera, Scene};
use rayon::prelude::*;
use std::f32::consts::PI;

/// What forming a point in `f32` errs by.
const POINT_ERROR: f32 = 9.6e-7;

/// Draws a frame on the current rayon pool. `intersector` must answer for the scene's mesh.
#[must_use]
pub fn draw<I: Intersector + Sync + ?Sized>(
    scene: &Scene,
    intersector: &I,
    camera: &Camera,
    settings: &FrameSettings,
) -> Image {
    let ambient = mean_radiance(&scene.environment);
    let twin = Twin {
        intersector,
        frame: FrameWords::new(camera, settings, ambient, light_count(scene)),
        shapes: shapes(scene),
        material_ids: &scene.material_ids,
        materials: MaterialWords::all(scene),
        lights: LightWords::all(scene),
    };
    let (width, height) = (settings.width, settings.height);
    let pixels: Vec<Vec3> = (0..height)
        .into_par_iter()
        .flat_map_iter(|y| (0..width).map(move |x| (x, y)))
        .map(|(x, y)| twin.pixel(x, y))
        .collect();
    Image::from_pixels(width, height, pixels).unwrap_or_else(|| Image::black(0, 0))
}

struct Twin<'a, I: ?Sized> {
    intersector: &'a I,
    frame: FrameWords,
    shapes: Vec<[[u32; 4]; 3]>,
    material_ids: &'a [u32],
    materials: Vec<MaterialWords>,
    lights: Vec<LightWords>,
}

/// What the lights need of a point.
struct Point {
    origin: Vec3,
    point: Vec3,
    normal: Vec3,
    geometric: Vec3,
    reflected: Vec3,
}

impl<I: Intersector + Sync + ?Sized> Twin<'_, I> {
    fn pixel(&self, x: u32, y: u32) -> Vec3 {
        let frame = &self.frame;
        let toward =
            (frame.corner + frame.step_x * (x as f32 + 0.5) + frame.step_y * (y as f32 + 0.5))
                .normalize();
        let ray = Ray::new(frame.position, toward).with_range(0.0, f32::MAX);
        let hit = self.intersector.closest_hit(&ray);
        if !hit.is_hit() {
            return frame.ambient;
        }
        self.shade(y * frame.width + x, toward, &hit)
    }

    fn shade(&self, pixel: u32, toward: Vec3, hit: &Hit) -> Vec3 {
        let frame = &self.frame;
        let rows = &self.shapes[hit.prim_id as usize];
        let corner = |k: usize| Vec3::from([0, 1, 2].map(|i| f32::from_bits(rows[k][i])));
        let (a, ab, ac) = (corner(0), corner(1) - corner(0), corner(2) - corner(0));
        let point = a + (ab * hit.u + ac * hit.v);
        let cross = ab.cross(ac);
        let area = cross.length();
        let mut geometric = if area > 0.0 { cross / area } else { -toward };
        if geometric.dot(toward) > 0.0 {
            geometric = -geometric;
        }
        let sum = unpack_normal(rows[0][3]) * (1.0 - hit.u - hit.v)
            + unpack_normal(rows[1][3]) * hit.u
            + unpack_normal(rows[2][3]) * hit.v;
        let size = sum.length();
        let mut normal = if size > 1e-3 { sum / size } else { geometric };
        if normal.dot(geometric) < 0.0 {
            normal = -normal;
        }
        let from = point - a;
        let reach = from.length().max((from - ab).length()).max((from - ac).length());
        let from_zero = (point.abs() + a.abs()).element_sum();
        let origin = point + geometric * (CLEARANCE * reach + POINT_ERROR * from_zero);
        let material = &self.materials[self.material_ids[hit.prim_id as usize] as usize];
        let reflected = toward - normal * (2.0 * normal.dot(toward));
        let at = Point { origin, point, normal, geometric, reflected };
        let mut light = material.emission;
        for one in &self.lights {
            light += self.lit(one, material, &at);
        }
        let [turn_x, turn_y, ..] = pcg4d([pixel, frame.seed, 0, 0]);
        let turn = Vec2::new(unit(turn_x), unit(turn_y));
        let mut open = 0_u32;
        for i in 0..frame.ao_rays {
            let direction = ao_direction(normal, i, frame.ao_rays, turn);
            let is_open =
                direction.dot(geometric) > 0.0 && self.is_open(origin, direction, frame.ao_radius);
            open += u32::from(is_open);
        }
        let share = if frame.ao_rays == 0 { 1.0 } else { open as f32 / frame.ao_rays as f32 };
        light + frame.ambient * (material.diffuse + material.specular) * share
    }

    fn is_open(&self, origin: Vec3, direction: Vec3, reach: f32) -> bool {
        !self.intersector.any_hit(&Ray::new(origin, direction).with_range(0.0, reach))
    }

    fn lit(&self, light: &LightWords, material: &MaterialWords, at: &Point) -> Vec3 {
        let mut to_light = light.place;
        let mut irradiance = light.intensity;
        if light.kind != DIRECTIONAL {
            let way = light.place - at.point;
            let distance = way.length();
            if distance.is_nan() || distance <= 0.0 {
                return Vec3::ZERO;
            }
            to_light = way / distance;
            irradiance /= distance * distance;
            if light.kind == SPOT {
                let cosine = -to_light.dot(light.direction);
                let t = ((cosine - light.outer) * light.falloff).clamp(0.0, 1.0);
                irradiance *= t * t;
            }
        }
        let cosine = at.normal.dot(to_light);
        let is_lit =
            cosine > 0.0 && at.geometric.dot(to_light) > 0.0 && irradiance.max_element() > 0.0;
        if !is_lit {
            return Vec3::ZERO;
        }
        if self.frame.shadows != 0 {
            let (mut aim, mut reach) = (to_light, f32::MAX);
            if light.kind != DIRECTIONAL {
                let way = light.place - at.origin;
                reach = way.length();
                aim = way / reach;
                reach *= 1.0 - CLEARANCE;
            }
            if !self.is_open(at.origin, aim, reach) {
                return Vec3::ZERO;
            }
        }
        let gloss = at.reflected.dot(to_light).max(0.0).powf(material.exponent);
        let lobe = material.diffuse * (1.0 / PI)
            + material.specular * ((material.exponent + 2.0) * (0.5 / PI) * gloss);
        irradiance * cosine * lobe
    }
}

const fn unit(bits: u32) -> f32 {
    (bits >> 8) as f32 / (1_u32 << 24) as f32
}

/// The i-th of n directions about a normal with density cos θ / π.
fn ao_direction(normal: Vec3, i: u32, n: u32, turn: Vec2) -> Vec3 {
    let u = ((i as f32 + 0.5) / n as f32 + turn.x).fract();
    let v = (unit(i.reverse_bits()) + turn.y).fract();
    let (sin, cos) = (2.0 * PI * v).sin_cos();
    let radius = u.sqrt();
    let (tangent, bitangent) = normal.any_orthonormal_pair();
    (tangent * (radius * cos) + bitangent * (radius * sin) + normal * (1.0 - u).sqrt()).normalize()
}
