//! Images that frames draw to and read from.

use crate::{Gpu, HybridError, report::Counters};
use niwaki_gpu_frame::{DEPTH, SURFACE, TRIANGLE};
use wgpu::{BufferUsages, TextureUsages};

/// A texture array with views of all of it and of each layer.
pub(crate) struct Layers {
    pub(crate) all: wgpu::TextureView,
    pub(crate) each: Vec<wgpu::TextureView>,
    /// Side in pixels.
    pub(crate) side: u32,
}

impl Layers {
    fn new(
        gpu: &Gpu,
        label: &str,
        side: u32,
        layers: u32,
        format: wgpu::TextureFormat,
    ) -> Result<Self, HybridError> {
        let size = [side, side, layers];
        let mut usage = TextureUsages::RENDER_ATTACHMENT;
        if cfg!(test) {
            usage |= TextureUsages::COPY_SRC;
        }
        let texture = gpu.texture(label, size, format, usage)?;
        let view = |base, count, dimension| {
            texture.create_view(&wgpu::TextureViewDescriptor {
                dimension: Some(dimension),
                base_array_layer: base,
                array_layer_count: Some(count),
                ..wgpu::TextureViewDescriptor::default()
            })
        };
        Ok(Self {
            all: view(0, layers.max(1), wgpu::TextureViewDimension::D2Array),
            each: (0..layers.max(1)).map(|i| view(i, 1, wgpu::TextureViewDimension::D2)).collect(),
            side,
        })
    }
}

/// The cube map of G-buffers: face f of layer k is array layer 6 k + f.
pub(crate) struct CubeMap {
    pub(crate) depth: Layers,
    pub(crate) surface: Layers,
    /// Layers, 1 or 2.
    pub(crate) layers: u32,
}

impl CubeMap {
    /// A map that nothing reads takes a pixel a face.
    pub(crate) fn new(gpu: &Gpu, side: u32, layers: u32) -> Result<Self, HybridError> {
        Ok(Self {
            depth: Layers::new(gpu, "depth of the cube map", side, 6 * layers, DEPTH)?,
            surface: Layers::new(gpu, "surfaces of the cube map", side, 6 * layers, SURFACE)?,
            layers,
        })
    }
}

/// Shadow maps of all lights.
pub(crate) fn shadow_maps(gpu: &Gpu, side: u32, layers: u32) -> Result<Layers, HybridError> {
    Layers::new(gpu, "shadow maps", side, layers, DEPTH)
}

/// What depends on the size of the image.
pub(crate) struct Screen {
    pub(crate) size: [u32; 2],
    pub(crate) depth: wgpu::TextureView,
    pub(crate) surface: wgpu::TextureView,
    pub(crate) triangle: wgpu::TextureView,
    /// A vector of four a pixel.
    pub(crate) image: wgpu::Buffer,
    /// How many pixels send rays on, and which.
    pub(crate) pixels: wgpu::Buffer,
    /// Workgroups that follow them.
    pub(crate) args: wgpu::Buffer,
    pub(crate) counters: wgpu::Buffer,
}

impl Screen {
    /// `size` must not be 0.
    pub(crate) fn new(gpu: &Gpu, size: [u32; 2]) -> Result<Self, HybridError> {
        let [width, height] = size;
        gpu.fits("the image", width.max(height))?;
        let texture = |label, format| {
            gpu.texture(label, [width, height, 1], format, TextureUsages::RENDER_ATTACHMENT)
                .map(|t| t.create_view(&wgpu::TextureViewDescriptor::default()))
        };
        let count = u64::from(width) * u64::from(height);
        let storage = BufferUsages::STORAGE;
        // The largest first, so that an image that does not fit is refused before anything is made.
        let image = gpu.buffer("the image", 16 * count, storage | BufferUsages::COPY_SRC)?;
        Ok(Self {
            size,
            image,
            pixels: gpu.buffer("the list of pixels", 4 * (count + 1), storage)?,
            args: gpu.buffer("workgroups", 16, storage | BufferUsages::INDIRECT)?,
            counters: gpu.buffer(
                "counters",
                8 * Counters::COUNT as u64,
                storage | BufferUsages::COPY_SRC,
            )?,
            depth: texture("primary depth", DEPTH)?,
            surface: texture("primary surfaces", SURFACE)?,
            triangle: texture("primary triangles", TRIANGLE)?,
        })
    }
}
