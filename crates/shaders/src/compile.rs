//! Validation and translation.

use crate::{Composed, Library, ShaderError, spirv};
use naga::{
    AddressSpace, ShaderStage, SourceLocation, StorageAccess, TypeInner,
    back::{pipeline_constants::process_overrides, spv},
    proc::{BoundsCheckPolicies, BoundsCheckPolicy},
    valid::{Capabilities, ValidationFlags, Validator},
};

/// How an entry point is translated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Options<'a> {
    /// Values of `override` constants by name; others have the value in the text. Default none.
    pub constants: &'a [(&'a str, f64)],
    /// Forbids the driver to fuse or rearrange floating-point operations, so that they round as
    /// IEEE 754 says, one by one (`NoContraction` on all of them). Fused multiply-adds have to be
    /// written as such. Default true.
    pub exact: bool,
}

impl Default for Options<'_> {
    fn default() -> Self {
        Self { constants: &[], exact: true }
    }
}

/// What a shader wants bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// A uniform buffer.
    Uniform,
    /// A storage buffer.
    Storage {
        /// The shader may write to it.
        writable: bool,
    },
    /// An acceleration structure of the driver's own ray tracing.
    AccelerationStructure,
    /// A texture or sampler.
    Handle,
}

/// Where in a pipeline an entry point belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// A compute pipeline, alone.
    Compute,
    /// A ray-tracing pipeline: sends rays.
    RayGeneration,
    /// A ray-tracing pipeline: for rays that hit nothing.
    Miss,
    /// A ray-tracing pipeline: for the nearest hit of a ray.
    ClosestHit,
}

impl Stage {
    const fn of(stage: ShaderStage) -> Option<Self> {
        match stage {
            ShaderStage::Compute => Some(Self::Compute),
            ShaderStage::RayGeneration => Some(Self::RayGeneration),
            ShaderStage::Miss => Some(Self::Miss),
            ShaderStage::ClosestHit => Some(Self::ClosestHit),
            _ => None,
        }
    }
}

/// A resource that an entry point uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// The descriptor set.
    pub group: u32,
    /// The place in it.
    pub binding: u32,
    /// What belongs there.
    pub kind: BindingKind,
    /// The name in the text.
    pub name: String,
}

/// An entry point in SPIR-V 1.3 (1.4 for ray-tracing pipelines, which need it), with all that a
/// pipeline has to know of it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shader {
    /// The module, with this entry point alone.
    pub words: Vec<u32>,
    /// The name of the entry point.
    pub entry: String,
    /// Where it belongs.
    pub stage: Stage,
    /// `module.wgsl:entry`, for messages.
    pub label: String,
    /// What the entry point uses, by group and binding.
    pub bindings: Vec<Binding>,
    /// Bytes of its `var<immediate>`, which are push constants in Vulkan; 0 without.
    pub immediate_bytes: u32,
    /// Invocations of a workgroup along x, y and z; 0 for stages that have none.
    pub workgroup_size: [u32; 3],
}

/// The translator's options that leave out whatever the source does not ask for: no bounds checks,
/// no bounded loops, no zeroed workgroup memory. Kernels are written to need none of it.
fn lean<'a>(stage: Stage) -> spv::Options<'a> {
    spv::Options {
        lang_version: if stage == Stage::Compute { (1, 3) } else { (1, 4) },
        flags: spv::WriterFlags::empty(),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Unchecked,
            buffer: BoundsCheckPolicy::Unchecked,
            image_load: BoundsCheckPolicy::Unchecked,
            binding_array: BoundsCheckPolicy::Unchecked,
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        force_loop_bounding: false,
        emit_int_div_checks: false,
        ray_query_initialization_tracking: false,
        trace_ray_argument_validation: false,
        fake_missing_bindings: true,
        ..spv::Options::default()
    }
}

impl Library {
    /// Composes and validates a module without translating it: all of its functions and entry
    /// points, with the constants' own values.
    ///
    /// # Errors
    /// [`ShaderError`] names the file and line.
    pub fn validate(&self, module: &str) -> Result<(), ShaderError> {
        let composed = self.compose(module)?;
        parse(module, &composed).map(|_| ())
    }

    /// The names of a module's entry points for compute and ray-tracing pipelines.
    ///
    /// # Errors
    /// [`ShaderError`] names the file and line.
    pub fn entry_points(&self, module: &str) -> Result<Vec<String>, ShaderError> {
        let composed = self.compose(module)?;
        let (parsed, _) = parse(module, &composed)?;
        let entries = parsed.entry_points.into_iter();
        let known = entries.filter(|entry| Stage::of(entry.stage).is_some());
        Ok(known.map(|entry| entry.name).collect())
    }

    /// Composes and validates a module and translates an entry point to SPIR-V: of a compute shader,
    /// or of ray generation, miss or closest hit.
    ///
    /// Workgroup memory and the arrays of functions begin with whatever was there: kernels write
    /// them before they read them.
    ///
    /// # Errors
    /// [`ShaderError`] names the file and line.
    pub fn compile(
        &self,
        module: &str,
        entry: &str,
        options: &Options<'_>,
    ) -> Result<Shader, ShaderError> {
        let composed = self.compose(module)?;
        let (parsed, info) = parse(module, &composed)?;
        let points = || parsed.entry_points.iter();
        let found = points().find(|e| e.name == entry).map(|e| e.stage);
        let Some((stage, own)) = found.and_then(|stage| Some((stage, Stage::of(stage)?))) else {
            let known = points().filter(|e| Stage::of(e.stage).is_some());
            let names: Vec<_> = known.map(|e| e.name.as_str()).collect();
            return Err(ShaderError::UnknownEntry {
                module: module.to_owned(),
                entry: entry.to_owned(),
                known: names.join(", "),
            });
        };
        let constants = options.constants.iter().map(|&(name, x)| (name.to_owned(), x)).collect();
        let (parsed, info) =
            process_overrides(&parsed, &info, Some((stage, entry)), &constants).map_err(
                |error| ShaderError::Constant { module: module.to_owned(), message: chain(&error) },
            )?;
        let pipeline = spv::PipelineOptions { shader_stage: stage, entry_point: entry.to_owned() };
        let words =
            spv::write_vec(&parsed, &info, &lean(own), Some(&pipeline)).map_err(|error| {
                ShaderError::Untranslatable { module: module.to_owned(), message: chain(&error) }
            })?;
        let index = parsed.entry_points.iter().position(|e| e.stage == stage && e.name == entry);
        let index = index.unwrap_or_default();
        let used = info.get_entry_point(index);
        let mut bindings = Vec::new();
        let mut immediate_bytes = 0;
        for (handle, variable) in parsed.global_variables.iter() {
            if used[handle].is_empty() {
                continue;
            }
            if variable.space == AddressSpace::Immediate {
                immediate_bytes = parsed.types[variable.ty].inner.size(parsed.to_ctx());
            }
            let Some(place) = variable.binding else { continue };
            let kind = match variable.space {
                AddressSpace::Uniform => BindingKind::Uniform,
                AddressSpace::Storage { access } => {
                    BindingKind::Storage { writable: access.contains(StorageAccess::STORE) }
                }
                _ => match parsed.types[variable.ty].inner {
                    TypeInner::AccelerationStructure { .. } => BindingKind::AccelerationStructure,
                    _ => BindingKind::Handle,
                },
            };
            let name = variable.name.clone().unwrap_or_default();
            bindings.push(Binding { group: place.group, binding: place.binding, kind, name });
        }
        bindings.sort_by_key(|b| (b.group, b.binding));
        Ok(Shader {
            words: spirv::finish(words, options.exact),
            entry: entry.to_owned(),
            stage: own,
            label: format!("{module}.wgsl:{entry}"),
            bindings,
            immediate_bytes,
            workgroup_size: parsed.entry_points[index].workgroup_size,
        })
    }
}

/// The module in naga's form, validated.
fn parse(
    module: &str,
    composed: &Composed,
) -> Result<(naga::Module, naga::valid::ModuleInfo), ShaderError> {
    let parsed = naga::front::wgsl::parse_str(&composed.text).map_err(|error| {
        let mut message = error.message().to_owned();
        for (_, label) in error.labels().filter(|(_, label)| !label.is_empty()) {
            message = format!("{message}: {label}");
        }
        invalid(module, composed, error.location(&composed.text), message)
    })?;
    let mut validator = Validator::new(ValidationFlags::all(), Capabilities::all());
    let info = validator.validate(&parsed).map_err(|error| {
        let place = error.location(&composed.text);
        invalid(module, composed, place, chain(error.as_inner()))
    })?;
    Ok((parsed, info))
}

fn invalid(
    module: &str,
    composed: &Composed,
    place: Option<SourceLocation>,
    message: String,
) -> ShaderError {
    let origin = place.and_then(|place| composed.origin(place.line_number as usize));
    let (file, line) = origin.unwrap_or((module, 0));
    let column = place.map_or(0, |place| place.line_position as usize);
    ShaderError::Invalid { file: file.to_owned(), line, column, message }
}

/// An error with all its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(cause) = source {
        text = format!("{text}: {cause}");
        source = cause.source();
    }
    text
}
