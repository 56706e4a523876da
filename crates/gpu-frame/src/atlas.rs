//! All textures of a scene in the layers of one array, so that kernels can read any of them.

use crate::{FrameError, Gpu, layout::TextureInfo};
use niwaki_core::to_u32;
use niwaki_scene::{Texture, Wrap};
use std::collections::HashMap;

/// Side of a layer, unless a texture is larger.
const LAYER: u32 = 2048;

/// The textures on the GPU.
pub(crate) struct Atlas {
    pub(crate) view: wgpu::TextureView,
    /// One a texture; never empty.
    pub(crate) infos: Vec<TextureInfo>,
}

/// Where rectangles stand in square layers.
struct Packing {
    /// Top left corner and layer of each, in the order given.
    places: Vec<[u32; 3]>,
    layers: u32,
}

/// Puts rectangles on shelves, the highest first.
fn pack(sizes: &[[u32; 2]], side: u32) -> Packing {
    let mut order: Vec<usize> = (0..sizes.len()).collect();
    order.sort_by_key(|&i| std::cmp::Reverse((sizes[i][1], sizes[i][0])));
    let mut places = vec![[0; 3]; sizes.len()];
    let (mut x, mut y, mut height, mut layer) = (0_u32, 0_u32, 0_u32, 0_u32);
    for i in order {
        let [w, h] = sizes[i];
        if x + w > side {
            (x, y, height) = (0, y + height, 0);
        }
        if y + h > side {
            (x, y, height, layer) = (0, 0, 0, layer + 1);
        }
        places[i] = [x, y, layer];
        x += w;
        height = height.max(h);
    }
    Packing { places, layers: layer + 1 }
}

const fn wrap_number(wrap: Wrap) -> u32 {
    match wrap {
        Wrap::Repeat => 0,
        Wrap::Mirror => 1,
        Wrap::Clamp => 2,
    }
}

impl Atlas {
    pub(crate) fn new(gpu: &Gpu, textures: &[Texture]) -> Result<Self, FrameError> {
        // Textures that show one image in several ways share it.
        let mut images: HashMap<*const [u8; 4], usize> = HashMap::new();
        let mut firsts: Vec<&Texture> = Vec::new();
        let image_of: Vec<usize> = textures
            .iter()
            .map(|t| {
                *images.entry(t.pixels().as_ptr()).or_insert_with(|| {
                    firsts.push(t);
                    firsts.len() - 1
                })
            })
            .collect();
        let sizes: Vec<[u32; 2]> = firsts.iter().map(|t| [t.width(), t.height()]).collect();
        let longest = sizes.iter().flatten().copied().max().unwrap_or(1);
        gpu.fits("a texture", longest)?;
        let side = if sizes.is_empty() {
            1
        } else {
            longest.max(LAYER.min(gpu.limits().max_texture_dimension_2d))
        };
        let packing = pack(&sizes, side);
        let texture = gpu.texture(
            "texture atlas",
            [side, side, packing.layers],
            wgpu::TextureFormat::Rgba8Unorm,
            wgpu::TextureUsages::COPY_DST,
        )?;
        for (image, &[x, y, layer]) in firsts.iter().zip(&packing.places) {
            let target = wgpu::TexelCopyTextureInfo {
                texture: &texture,
                mip_level: 0,
                origin: wgpu::Origin3d { x, y, z: layer },
                aspect: wgpu::TextureAspect::All,
            };
            let layout = wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * image.width()),
                rows_per_image: Some(image.height()),
            };
            let size = wgpu::Extent3d {
                width: image.width(),
                height: image.height(),
                depth_or_array_layers: 1,
            };
            gpu.queue().write_texture(target, bytemuck::cast_slice(image.pixels()), layout, size);
        }
        let mut infos: Vec<TextureInfo> = textures
            .iter()
            .zip(image_of)
            .map(|(t, image)| {
                let [x, y, layer] = packing.places[image];
                let [u, v] = t.wrap().map(wrap_number);
                let flags = u32::from(t.is_srgb()) | u << 8 | v << 16;
                let (width, height) = (t.width(), t.height());
                TextureInfo { x, y, layer, width, height, flags, pad: [0; 2] }
            })
            .collect();
        if infos.is_empty() {
            infos.push(TextureInfo { width: 1, height: 1, ..TextureInfo::default() });
        }
        gpu.check()?;
        let view = texture.create_view(&wgpu::TextureViewDescriptor {
            dimension: Some(wgpu::TextureViewDimension::D2Array),
            ..wgpu::TextureViewDescriptor::default()
        });
        debug_assert_eq!(infos.len(), textures.len().max(1), "{}", to_u32(infos.len()));
        Ok(Self { view, infos })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rectangles_stand_within_layers_and_apart() {
        let sizes: Vec<[u32; 2]> =
            (0..200_u32).map(|i| [1 + (i * 37) % 90, 1 + (i * 61) % 70]).collect();
        let packing = pack(&sizes, 100);
        let end = |i: usize, k: usize| packing.places[i][k] + sizes[i][k];
        for i in 0..sizes.len() {
            assert!(end(i, 0) <= 100 && end(i, 1) <= 100 && packing.places[i][2] < packing.layers);
            for j in 0..i {
                let (a, b) = (packing.places[i], packing.places[j]);
                let apart = a[2] != b[2] || (0..2).any(|k| end(i, k) <= b[k] || end(j, k) <= a[k]);
                assert!(apart, "{i} and {j}");
            }
        }
    }
}
