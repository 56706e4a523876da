//! A scene on the device.

use crate::{
    layout::{LightWords, MaterialWords, light_count, mean_radiance, shapes},
    settings::module,
};
use niwaki_core::{Bvh, glam::Vec3};
use niwaki_scene::Scene;
use niwaki_trace::Mode;
use niwaki_trace_vulkan::{Buffer, Device, GpuError, GpuScene, TreeLayout};

/// A scene on a device: tree, triangles, materials and lights.
///
/// Materials are reduced to Phong's model with one colour each, the mean of their texture; alpha is
/// not looked at.
#[derive(Clone, Debug)]
pub struct TracedScene {
    pub(crate) tree: GpuScene,
    pub(crate) shapes: Buffer,
    pub(crate) material_ids: Buffer,
    pub(crate) materials: Buffer,
    pub(crate) lights: Buffer,
    pub(crate) light_count: u32,
    pub(crate) ambient: Vec3,
}

impl TracedScene {
    /// Uploads a scene with a tree over its triangles, eight wide and watertight.
    ///
    /// # Errors
    /// As [`GpuScene::upload`].
    pub fn upload(device: &Device, bvh: &Bvh, scene: &Scene) -> Result<Self, GpuError> {
        Self::upload_in(device, TreeLayout::Wide, Mode::Watertight, bvh, scene)
    }

    /// [`TracedScene::upload`] in any layout and mode.
    ///
    /// # Errors
    /// As [`GpuScene::upload`].
    pub fn upload_in(
        device: &Device,
        layout: TreeLayout,
        mode: Mode,
        bvh: &Bvh,
        scene: &Scene,
    ) -> Result<Self, GpuError> {
        let mut lights = LightWords::all(scene);
        if lights.is_empty() {
            // Buffers are not empty; nothing reads this one.
            lights.push(bytemuck::Zeroable::zeroed());
        }
        Ok(Self {
            tree: GpuScene::upload_in(device, layout, mode, bvh, &scene.mesh)?,
            shapes: device.upload(&shapes(scene))?,
            material_ids: device.upload(&scene.material_ids)?,
            materials: device.upload(&MaterialWords::all(scene))?,
            lights: device.upload(&lights)?,
            light_count: light_count(scene),
            ambient: mean_radiance(&scene.environment),
        })
    }

    /// The tree.
    #[must_use]
    pub const fn tree(&self) -> &GpuScene {
        &self.tree
    }

    /// Lights, each of which takes a shadow ray where it shines.
    #[must_use]
    pub const fn lights(&self) -> u32 {
        self.light_count
    }

    /// The module of `niwaki-shaders` that traverses the tree.
    #[must_use]
    pub const fn module(&self) -> &'static str {
        module(self.tree.layout())
    }
}
