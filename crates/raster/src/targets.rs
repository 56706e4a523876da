//! Images that frames draw to and read from.

use crate::pipelines::{DEPTH_STENCIL, MOMENTS, OUTPUT};
use niwaki_core::to_u32;
use niwaki_gpu_frame::{DEPTH, FrameError, Gpu, SURFACE, TRIANGLE, wgpu};
use wgpu::{TextureFormat, TextureUsages, TextureView};

/// What depends on the size of the image and on what is drawn to it.
pub(crate) struct Screen {
    pub(crate) kind: ScreenKind,
    pub(crate) output: wgpu::Texture,
    pub(crate) output_view: TextureView,
    /// Depth, with the stencil if there is one.
    pub(crate) depth: TextureView,
    pub(crate) deferred: Option<Deferred>,
}

/// What a screen is made for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ScreenKind {
    pub(crate) size: [u32; 2],
    pub(crate) stencil: bool,
    /// The format of sums of light; `None` for forward rendering.
    pub(crate) sum: Option<TextureFormat>,
    pub(crate) triangles: bool,
}

/// The G-buffer and the sum of light.
pub(crate) struct Deferred {
    pub(crate) surface: TextureView,
    /// Depth without the stencil, to be read.
    pub(crate) depth: TextureView,
    pub(crate) depth_texture: wgpu::Texture,
    pub(crate) triangle: Option<(wgpu::Texture, TextureView)>,
    pub(crate) sum: wgpu::Texture,
    pub(crate) sum_view: TextureView,
}

fn view(texture: &wgpu::Texture) -> TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

impl Screen {
    /// The size must not be 0.
    pub(crate) fn new(gpu: &Gpu, kind: ScreenKind) -> Result<Self, FrameError> {
        let [width, height] = kind.size;
        gpu.fits("the image", width.max(height))?;
        let drawn = TextureUsages::RENDER_ATTACHMENT;
        let copied = drawn | TextureUsages::COPY_SRC;
        let make = |label, format, usage| gpu.texture(label, [width, height, 1], format, usage);
        let output = make("picture", OUTPUT, copied)?;
        let format = if kind.stencil { DEPTH_STENCIL } else { DEPTH };
        let depth_texture = make("depth", format, copied)?;
        let depth = view(&depth_texture);
        let deferred = match kind.sum {
            None => None,
            Some(format) => {
                let sum = make("sum of light", format, copied)?;
                let triangle = if kind.triangles {
                    let texture = make("triangles", TRIANGLE, copied)?;
                    let view = view(&texture);
                    Some((texture, view))
                } else {
                    None
                };
                Some(Deferred {
                    surface: view(&make("surfaces", SURFACE, drawn)?),
                    depth: depth_texture.create_view(&wgpu::TextureViewDescriptor {
                        aspect: wgpu::TextureAspect::DepthOnly,
                        ..wgpu::TextureViewDescriptor::default()
                    }),
                    depth_texture,
                    triangle,
                    sum_view: view(&sum),
                    sum,
                })
            }
        };
        Ok(Self { kind, output_view: view(&output), output, depth, deferred })
    }
}

/// One shadow map, which lights use in turn, as in the paper.
pub(crate) struct Maps {
    pub(crate) side: u32,
    pub(crate) variance: bool,
    pub(crate) depth: TextureView,
    /// All levels.
    pub(crate) moments: TextureView,
    /// Each level.
    pub(crate) levels: Vec<TextureView>,
    pub(crate) comparing: wgpu::Sampler,
    pub(crate) filtering: wgpu::Sampler,
}

impl Maps {
    pub(crate) fn new(gpu: &Gpu, side: u32, variance: bool) -> Result<Self, FrameError> {
        gpu.fits("the shadow map", side)?;
        let usage = TextureUsages::RENDER_ATTACHMENT;
        let depth = gpu.texture("shadow map", [side, side, 1], DEPTH, usage)?;
        let (moments, count) = if variance {
            let what = "filtered 32-bit floats, which variance shadow maps need";
            gpu.require(wgpu::Features::FLOAT32_FILTERABLE, what)?;
            let count = side.max(1).ilog2() + 1;
            let size = [side, side, 1];
            (gpu.mipped_texture("moments", size, count, MOMENTS, usage)?, count)
        } else {
            // Something that can be bound and is not read.
            (gpu.texture("no moments", [1, 1, 1], TextureFormat::Rg16Float, usage)?, 0)
        };
        let sampler = |compare| {
            gpu.device().create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                mipmap_filter: wgpu::MipmapFilterMode::Linear,
                compare,
                ..wgpu::SamplerDescriptor::default()
            })
        };
        let level = |i| {
            moments.create_view(&wgpu::TextureViewDescriptor {
                base_mip_level: i,
                mip_level_count: Some(1),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        Ok(Self {
            side,
            variance,
            depth: view(&depth),
            levels: (0..count).map(level).collect(),
            moments: view(&moments),
            // Lit where the point is at least as near to the light: depth is reversed.
            comparing: sampler(Some(wgpu::CompareFunction::GreaterEqual)),
            filtering: sampler(None),
        })
    }

    /// Side of a level in pixels.
    pub(crate) fn level_side(&self, level: usize) -> u32 {
        (self.side >> to_u32(level).min(31)).max(1)
    }
}
