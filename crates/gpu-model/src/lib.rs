//! How long a GPU will take, before it is asked: an analytical model, and what it has to know.
//!
//! ```
//! use niwaki_gpu_model::{Device, Program, hong_kim::Model};
//!
//! // A tiled matrix multiplication, as in Hong and Kim's worked example.
//! let device = Device {
//!     clock_ghz: 1.0,
//!     bandwidth_gb_s: 80.0,
//!     ..Device::builtin("quadro-fx-5600")?
//! };
//! let program = Program {
//!     compute_instructions: 27.0,
//!     uncoalesced_loads: 6.0,
//!     synchronizations: 6.0,
//!     threads_per_block: 128,
//!     blocks: 80,
//!     blocks_per_core: 5,
//!     ..Program::empty()
//! };
//! let prediction = Model::default().predict(&device, &program)?;
//! assert_eq!(prediction.parallelism.mwp, 2.28125);
//! assert!((prediction.execution.cycles - 50_728.19).abs() < 0.005);
//! # Ok::<(), niwaki_gpu_model::ModelError>(())
//! ```
//!
//! | module | holds |
//! |---|---|
//! | [`hong_kim`] | the model of Hong and Kim 2009, in full |
//! | [`shortened`] | the thesis's shortened form |
//! | [`ray_tracing`] | instructions of a ray-traced frame from its workload, and [`FrameModel`] |
//! | [`device`] | parameters of devices as TOML tables |
//! | [`program`] | what a kernel does and how it is launched |
//! | `microbench` | parameters of the device at hand, measured (feature `vulkan`) |
//! | [`calibrate`](mod@calibrate) | parameters that fit the times of frames that were drawn |
//! | [`counts`] | instructions of a kernel, counted in its SPIR-V |
//! | [`workload`] | what the rays of a view do, sampled on the CPU |

pub mod calibrate;
pub mod counts;
pub mod device;
pub mod hong_kim;
#[cfg(feature = "vulkan")]
pub mod microbench;
pub mod program;
pub mod ray_tracing;
pub mod shortened;
pub mod workload;

pub use counts::CountError;
pub use device::{Device, DeviceError};
pub use program::{ModelError, Occupancy, Program};
pub use ray_tracing::{
    Constants, Form, FrameModel, FramePrediction, Instructions, KernelCounts, RaySettings,
};
pub use workload::Workload;

#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
