enable wgpu_ray_tracing_pipeline;
enable primitive_index;
