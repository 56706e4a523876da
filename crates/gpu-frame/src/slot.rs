//! What the passes' bindings are.

/// What a binding holds and which stages see it.
#[derive(Clone, Copy, Debug)]
pub enum Slot {
    /// A uniform buffer, for all stages.
    Uniform,
    /// A uniform buffer with an offset given at the draw, for all stages.
    DynamicUniform,
    /// A storage buffer that is read, in all stages.
    Read,
    /// A storage buffer that compute shaders read and write.
    Write,
    /// A texture that is read by pixel, in fragment and compute shaders.
    Texture(wgpu::TextureSampleType, wgpu::TextureViewDimension),
    /// How a texture of depths is compared with, in fragment shaders.
    ComparingSampler,
    /// How a texture is filtered, in fragment shaders.
    FilteringSampler,
    /// A texture array that compute shaders write.
    Storage(wgpu::TextureFormat),
}

impl Slot {
    /// Numbers a pixel.
    pub const UINT: Self =
        Self::Texture(wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D2);
    /// Numbers a pixel, in layers.
    pub const UINT_ARRAY: Self =
        Self::Texture(wgpu::TextureSampleType::Uint, wgpu::TextureViewDimension::D2Array);
    /// A depth buffer.
    pub const DEPTH: Self =
        Self::Texture(wgpu::TextureSampleType::Depth, wgpu::TextureViewDimension::D2);
    /// Depth buffers in layers.
    pub const DEPTH_ARRAY: Self =
        Self::Texture(wgpu::TextureSampleType::Depth, wgpu::TextureViewDimension::D2Array);
    /// Colours in layers, read by pixel.
    pub const COLOR_ARRAY: Self = Self::Texture(
        wgpu::TextureSampleType::Float { filterable: false },
        wgpu::TextureViewDimension::D2Array,
    );

    /// Its entry in a layout.
    #[must_use]
    pub fn entry(self, binding: u32) -> wgpu::BindGroupLayoutEntry {
        use wgpu::{BindingType, BufferBindingType, ShaderStages};
        let buffer = |ty, has_dynamic_offset| BindingType::Buffer {
            ty,
            has_dynamic_offset,
            min_binding_size: None,
        };
        let all = ShaderStages::VERTEX_FRAGMENT | ShaderStages::COMPUTE;
        let (visibility, ty) = match self {
            Self::Uniform => (all, buffer(BufferBindingType::Uniform, false)),
            Self::DynamicUniform => (all, buffer(BufferBindingType::Uniform, true)),
            Self::Read => (all, buffer(BufferBindingType::Storage { read_only: true }, false)),
            Self::Write => (
                ShaderStages::COMPUTE,
                buffer(BufferBindingType::Storage { read_only: false }, false),
            ),
            Self::Texture(sample_type, view_dimension) => (
                ShaderStages::FRAGMENT | ShaderStages::COMPUTE,
                BindingType::Texture { sample_type, view_dimension, multisampled: false },
            ),
            Self::ComparingSampler => {
                (ShaderStages::FRAGMENT, BindingType::Sampler(wgpu::SamplerBindingType::Comparison))
            }
            Self::FilteringSampler => {
                (ShaderStages::FRAGMENT, BindingType::Sampler(wgpu::SamplerBindingType::Filtering))
            }
            Self::Storage(format) => (
                ShaderStages::COMPUTE,
                BindingType::StorageTexture {
                    access: wgpu::StorageTextureAccess::WriteOnly,
                    format,
                    view_dimension: wgpu::TextureViewDimension::D2Array,
                },
            ),
        };
        wgpu::BindGroupLayoutEntry { binding, visibility, ty, count: None }
    }
}
