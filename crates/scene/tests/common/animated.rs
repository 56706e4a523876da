//! glTF files with key frames and skins, put together array by array.

use super::{Folder, glb, load};
use niwaki_core::glam::Vec3;
use niwaki_scene::Scene;

/// A quarter of a turn about z, and none.
pub const QUARTER: [f32; 4] =
    [0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2, std::f32::consts::FRAC_1_SQRT_2];
pub const NO_TURN: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

/// A file in the making: arrays go into one buffer, each with a view and an accessor.
#[derive(Default)]
pub struct File {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
    samplers: Vec<String>,
    channels: Vec<String>,
}

impl File {
    fn array(&mut self, bytes: Vec<u8>, count: usize, component: u32, kind: &str) -> usize {
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        let (offset, length) = (self.bytes.len(), bytes.len());
        self.views.push(format!(r#"{{"buffer":0,"byteOffset":{offset},"byteLength":{length}}}"#));
        let view = self.views.len() - 1;
        self.accessors.push(format!(
            r#"{{"bufferView":{view},"componentType":{component},"count":{count},"type":"{kind}"}}"#
        ));
        self.bytes.extend(bytes);
        self.accessors.len() - 1
    }

    /// Floats in vectors of `N`; returns the number of the accessor.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let kind = match N {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        let bytes = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        self.array(bytes, values.len(), 5126, kind)
    }

    /// Vectors of three signed bytes that stand for -1 to 1, each padded to four bytes.
    pub fn normalized_bytes(&mut self, values: &[[i8; 3]]) -> usize {
        let bytes = values.iter().flat_map(|v| [v[0], v[1], v[2], 0]).map(|x| x as u8).collect();
        let accessor = self.array(bytes, values.len(), 5120, "VEC3");
        let view = self.views.last_mut().expect("it was just added");
        *view = view.replace('}', r#","byteStride":4}"#);
        let text = &mut self.accessors[accessor];
        *text = text.replace('}', r#","normalized":true}"#);
        accessor
    }

    /// Vectors of three floats that are zero but for these, by their numbers in order.
    pub fn sparse(&mut self, count: usize, values: &[(u16, [f32; 3])]) -> usize {
        let places: Vec<[u16; 1]> = values.iter().map(|v| [v.0]).collect();
        let vectors: Vec<[f32; 3]> = values.iter().map(|v| v.1).collect();
        let (places, vectors) = (self.shorts(&places), self.floats(&vectors));
        self.accessors.push(format!(
            r#"{{"componentType":5126,"count":{count},"type":"VEC3","sparse":{{"count":{},
            "indices":{{"bufferView":{places},"componentType":5123}},
            "values":{{"bufferView":{vectors}}}}}}}"#,
            values.len()
        ));
        // Accessors and views share their numbers.
        self.views.push(self.views[vectors].clone());
        self.accessors.len() - 1
    }

    /// Unsigned 16-bit numbers.
    pub fn shorts<const N: usize>(&mut self, values: &[[u16; N]]) -> usize {
        let bytes = values.iter().flatten().flat_map(|x| x.to_le_bytes()).collect();
        self.array(bytes, values.len(), 5123, if N == 1 { "SCALAR" } else { "VEC4" })
    }

    /// A channel of the one animation.
    pub fn channel<const N: usize>(
        &mut self,
        node: usize,
        path: &str,
        how: &str,
        times: &[f32],
        values: &[[f32; N]],
    ) {
        let times: Vec<[f32; 1]> = times.iter().map(|t| [*t]).collect();
        let (input, output) = (self.floats(&times), self.floats(values));
        let sampler = self.samplers.len();
        self.samplers
            .push(format!(r#"{{"input":{input},"output":{output},"interpolation":"{how}"}}"#));
        self.channels
            .push(format!(r#"{{"sampler":{sampler},"target":{{"node":{node},"path":"{path}"}}}}"#));
    }

    /// The JSON; `more` is empty or begins with a comma.
    pub fn json(&self, nodes: &str, meshes: &str, more: &str) -> String {
        let animations = if self.channels.is_empty() {
            String::new()
        } else {
            format!(
                r#","animations":[{{"name":"move","samplers":[{}],"channels":[{}]}}]"#,
                self.samplers.join(","),
                self.channels.join(",")
            )
        };
        format!(
            r#"{{"asset":{{"version":"2.0"}},"buffers":[{{"byteLength":{}}}],
            "bufferViews":[{}],"accessors":[{}],"meshes":[{meshes}],
            "scenes":[{{"nodes":[0]}}],"nodes":[{nodes}]{animations}{more}}}"#,
            self.bytes.len(),
            self.views.join(","),
            self.accessors.join(",")
        )
    }

    /// The file.
    pub fn glb(&self, json: &str) -> Vec<u8> {
        glb(json, &self.bytes)
    }

    /// A unit square in the plane z = 0; returns the mesh.
    pub fn square(&mut self) -> String {
        let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let (positions, normals) = (self.floats(&corners), self.floats(&[[0.0, 0.0, 1.0]; 4]));
        let indices = self.shorts(&[[0], [1], [2], [0], [2], [3]]);
        format!(
            r#"{{"primitives":[{{"attributes":{{"POSITION":{positions},"NORMAL":{normals}}},
            "indices":{indices}}}]}}"#
        )
    }
}

pub fn loaded(bytes: &[u8]) -> Scene {
    let folder = Folder::new();
    load(&folder.file("a.glb", bytes)).expect("the file is good")
}

/// Vertices and normals at a time; all in the bounds that the scene says.
pub fn shape_at(scene: &Scene, time: f64) -> (Vec<Vec3>, Vec<Vec3>) {
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    scene.animate(time, &mut positions, &mut normals);
    assert!(normals.iter().all(|n| (n.length() - 1.0).abs() < 1e-4));
    let pose = scene.pose(time);
    for (i, object) in scene.objects.iter().enumerate() {
        let bounds = scene.bounds_in(&pose, i, object.bounds);
        let slack = Vec3::splat(1e-5 * (1.0 + bounds.extent().max_element()));
        for &p in &positions[object.vertices.start as usize..object.vertices.end as usize] {
            let inside = p.cmpge(bounds.min - slack) & p.cmple(bounds.max + slack);
            assert!(inside.all(), "{p} is not in {bounds:?} at {time}");
        }
    }
    (positions, normals)
}

pub fn near(a: Vec3, b: Vec3) -> bool {
    a.distance(b) < 1e-5
}
