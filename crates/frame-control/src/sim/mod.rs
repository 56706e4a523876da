//! A simulated renderer to judge controllers on: scenes that a camera moves through, a device whose
//! times follow laws that no controller is told, and scripts of what happens to both.
//!
//! Everything is a function of its inputs and of seeds: the same run gives the same times.
//!
//! ```
//! use niwaki_frame_control::sim::{Device, DeviceSpec, Run, Script};
//! use niwaki_frame_control::{FixedRung, Ladder, Summary};
//!
//! let ladder = Ladder::ray_tracing(64, 0.1)?;
//! let script = Script::fairy(100);
//! let mut device = Device::new(DeviceSpec::geforce_580(), 1)?;
//! let target_ms = device.ideal_ms(&script.view(0), &ladder.rungs()[30]);
//! let mut controller = FixedRung::new(&ladder, 30)?;
//! let records = Run::default().frames(&mut controller, &ladder, &mut device, &script, target_ms);
//! // Without tuning the time wanders off as the camera comes closer.
//! assert!(Summary::of(&records).unwrap().on_target < 0.8);
//! # Ok::<(), niwaki_frame_control::Error>(())
//! ```

pub use device::{Device, DeviceSpec};
pub use run::{Run, tune_by_hand};
pub use scene::{Camera, Cluster, Counters, Hidden, Scene, View};
pub use script::{Event, Script};

mod device;
mod random;
mod run;
mod scene;
mod script;
