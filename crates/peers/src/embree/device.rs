//! Finding the library and making a device.

use super::{
    Quality,
    error::{LoadFailure, code_name},
    ffi::{self, Api, Handle, Queries},
};
use crate::PeerError;
use libloading::Library;
use std::{
    ffi::{CStr, CString, OsString, c_char, c_int, c_void},
    path::PathBuf,
    ptr,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicIsize, Ordering},
    },
};

/// The names asked of the system's loader, in this order, when neither
/// [`EmbreeSettings::library`] nor `EMBREE_LIBRARY` says otherwise: 4 before 3, versioned names
/// before those that only development packages install.
pub const LIBRARY_NAMES: &[&str] = if cfg!(target_os = "macos") {
    &["libembree4.4.dylib", "libembree4.dylib", "libembree3.3.dylib", "libembree3.dylib"]
} else if cfg!(windows) {
    &["embree4.dll", "embree3.dll"]
} else {
    &["libembree4.so.4", "libembree4.so", "libembree3.so.3", "libembree3.so"]
};

/// Which library, and how its device works.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EmbreeSettings {
    /// The library to open. `None`, the default: what the environment variable `EMBREE_LIBRARY`
    /// names, or else the first of [`LIBRARY_NAMES`] that loads.
    pub library: Option<PathBuf>,
    /// Threads that build; 0, the default, means all of the machine. They are Embree's own (TBB),
    /// not rayon's. **The limit is one of the process**: Embree takes the largest of all devices
    /// that live at the time, so drop a device before making one with fewer threads.
    pub threads: usize,
    /// More of Embree's device configuration, such as `max_isa=avx2`, passed on as it is
    /// (`rtcNewDevice`); empty by default. **Embree drops what it does not understand**, and takes
    /// an unknown instruction set for SSE2, so look at [`Embree::vector_width`].
    pub config: String,
}

/// A version of Embree.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct EmbreeVersion {
    /// 3 or 4.
    pub major: u32,
    /// Second number.
    pub minor: u32,
    /// Third number.
    pub patch: u32,
}

impl std::fmt::Display for EmbreeVersion {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}.{}.{}", self.major, self.minor, self.patch)
    }
}

/// An Embree library with a device; cheap to clone, and shared by the scenes made from it.
///
/// Rounding and denormals: Embree's manual recommends that callers set the flush-to-zero and
/// denormals-are-zero bits of MXCSR. Rust code must not run with these changed, so this crate
/// leaves them alone, and queries treat denormals as IEEE 754 says.
#[derive(Clone, Debug)]
pub struct Embree {
    pub(super) device: Arc<Device>,
}

impl Embree {
    /// Opens Embree with the default settings: see [`EmbreeSettings`].
    ///
    /// # Errors
    /// As [`Embree::with_settings`].
    pub fn load() -> Result<Self, PeerError> {
        Self::with_settings(&EmbreeSettings::default())
    }

    /// Opens Embree and makes a device. The library stays loaded until the process ends.
    ///
    /// # Errors
    /// [`PeerError::NotFound`] if no library is there; [`PeerError::BadLibrary`] if one was asked
    /// for by path and cannot be used, or if one that was found is neither Embree 3 nor 4;
    /// [`PeerError::Embree`] if the device cannot be made.
    pub fn with_settings(settings: &EmbreeSettings) -> Result<Self, PeerError> {
        let explicit = settings
            .library
            .clone()
            .map(PathBuf::into_os_string)
            .or_else(|| std::env::var_os("EMBREE_LIBRARY").filter(|value| !value.is_empty()));
        let (library, name) = match explicit {
            Some(path) => (open(&path)?, path.to_string_lossy().into_owned()),
            None => LIBRARY_NAMES
                .iter()
                .find_map(|&name| {
                    open(&OsString::from(name)).ok().map(|library| (library, name.to_owned()))
                })
                .ok_or_else(|| PeerError::NotFound {
                    searched: LIBRARY_NAMES.iter().map(|&name| name.to_owned()).collect(),
                })?,
        };
        Ok(Self { device: Arc::new(Device::new(library, name, settings)?) })
    }

    /// What the library says that it is.
    #[must_use]
    pub fn version(&self) -> EmbreeVersion {
        self.device.version
    }

    /// The floats of the widest vectors that the device computes with: 16 is AVX-512, 8 is AVX or
    /// AVX2, 4 is SSE or NEON. `None` where the library was compiled without ray packets, since
    /// their native size is where Embree tells this.
    #[must_use]
    pub fn vector_width(&self) -> Option<u32> {
        [
            (16, ffi::PROPERTY_NATIVE_RAY16_SUPPORTED),
            (8, ffi::PROPERTY_NATIVE_RAY8_SUPPORTED),
            (4, ffi::PROPERTY_NATIVE_RAY4_SUPPORTED),
        ]
        .into_iter()
        .find(|&(_, id)| self.device.property(id) != 0)
        .map(|(width, _)| width)
    }

    /// The name or path that was opened.
    #[must_use]
    pub fn library(&self) -> &str {
        &self.device.library
    }

    /// Bytes that the device holds now for scenes and trees, by Embree's memory monitor: shared
    /// vertex and index buffers are not in it, what an allocator rounds up to is.
    #[must_use]
    pub fn memory(&self) -> usize {
        usize::try_from(self.device.monitor.now.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// The most that [`Embree::memory`] has been since the device was made or
    /// [`Embree::reset_peak_memory`] was called, building included.
    #[must_use]
    pub fn peak_memory(&self) -> usize {
        usize::try_from(self.device.monitor.peak.load(Ordering::Relaxed)).unwrap_or(0)
    }

    /// Starts [`Embree::peak_memory`] anew from what is held now.
    pub fn reset_peak_memory(&self) {
        let monitor = &self.device.monitor;
        monitor.peak.store(monitor.now.load(Ordering::Relaxed), Ordering::Relaxed);
    }
}

fn open(path: &OsString) -> Result<Library, PeerError> {
    // SAFETY: loading runs the library's initialisers. That a library of this name is Embree, whose
    // initialisers are harmless, is what asking for it by name means.
    unsafe { Library::new(path) }.map_err(|error| PeerError::BadLibrary {
        library: path.to_string_lossy().into_owned(),
        cause: error.to_string(),
    })
}

/// Counts what Embree's memory monitor reports.
#[derive(Debug, Default)]
struct Monitor {
    now: AtomicIsize,
    peak: AtomicIsize,
}

/// A device with the functions of its library.
#[derive(Debug)]
pub(super) struct Device {
    pub(super) handle: Handle,
    pub(super) api: &'static Api,
    pub(super) queries: Queries,
    version: EmbreeVersion,
    library: String,
    // Embree holds their addresses until the device is released. Not boxes: moving a box claims
    // sole access to what it holds, which would end the right to use those addresses.
    monitor: Arc<Monitor>,
    message: Arc<Mutex<String>>,
}

// SAFETY: Embree's device functions may be called from any thread; the raw pointers are handles
// that stay valid until `drop`.
unsafe impl Send for Device {}
// SAFETY: as above; what this crate calls through a shared device are the functions that Embree
// documents as thread-safe.
unsafe impl Sync for Device {}

impl Device {
    fn new(library: Library, name: String, settings: &EmbreeSettings) -> Result<Self, PeerError> {
        let bad = |cause: String| PeerError::BadLibrary { library: name.clone(), cause };
        // SAFETY: a library with all these names is Embree.
        let api = unsafe { Api::find(&library) }
            .map_err(|failure: LoadFailure| bad(failure.to_string()))?;
        // Never unloaded: Embree's worker threads may still run its code after the last release.
        // The loader hands out the same copy next time, so this is bounded by the libraries used.
        std::mem::forget(library);
        let api: &'static Api = Box::leak(Box::new(api));

        let config = config_string(settings)?;
        // SAFETY: a NUL-terminated string that Embree copies.
        let handle = unsafe { (api.new_device)(config.as_ptr()) };
        if handle.is_null() {
            // SAFETY: a null device asks for this thread's last error without a device.
            let code = unsafe { (api.get_device_error)(ptr::null_mut()) };
            return Err(PeerError::Embree {
                operation: "rtcNewDevice",
                code: code_name(code),
                message: format!("with configuration `{}`", config.to_string_lossy()),
            });
        }
        let property = |id| {
            // SAFETY: a live device and a documented property.
            unsafe { (api.get_device_property)(handle, id) }
        };
        let major = property(ffi::PROPERTY_VERSION_MAJOR);
        let number = |n: isize| u32::try_from(n).unwrap_or(0);
        let version = EmbreeVersion {
            major: number(major),
            minor: number(property(ffi::PROPERTY_VERSION_MINOR)),
            patch: number(property(ffi::PROPERTY_VERSION_PATCH)),
        };
        // SAFETY: `major` comes from the library itself.
        let Some(queries) = (unsafe { api.queries(major) }) else {
            // SAFETY: the device was made above and nothing else uses it.
            unsafe { (api.release_device)(handle) };
            return Err(bad(format!("it is version {version}; 3 and 4 are supported")));
        };
        let device = Self {
            handle,
            api,
            queries,
            version,
            library: name,
            monitor: Arc::default(),
            message: Arc::default(),
        };
        let monitor = Arc::as_ptr(&device.monitor);
        let message = Arc::as_ptr(&device.message);
        // SAFETY: both outlive the device (`drop` releases it first), are only used through
        // shared references, and the callbacks have the types that Embree documents.
        unsafe {
            (api.set_device_memory_monitor)(handle, Some(count_memory), monitor.cast_mut().cast());
            (api.set_device_error_function)(handle, Some(keep_message), message.cast_mut().cast());
        }
        Ok(device)
    }

    /// A property of the device.
    fn property(&self, id: c_int) -> isize {
        // SAFETY: a live device and a documented property of both versions.
        unsafe { (self.api.get_device_property)(self.handle, id) }
    }

    /// The error that Embree noted on this thread since the last look, as a `Result`.
    pub(super) fn check(&self, operation: &'static str) -> Result<(), PeerError> {
        // SAFETY: a live device.
        let code = unsafe { (self.api.get_device_error)(self.handle) };
        if code == 0 {
            return Ok(());
        }
        let mut message = self.message.lock().unwrap_or_else(PoisonError::into_inner);
        Err(PeerError::Embree {
            operation,
            code: code_name(code),
            message: std::mem::take(&mut *message),
        })
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        // SAFETY: the last user of the handle. Scenes hold an `Arc` of this, so none is left, and
        // Embree calls no callback after the last release.
        unsafe { (self.api.release_device)(self.handle) };
    }
}

fn config_string(settings: &EmbreeSettings) -> Result<CString, PeerError> {
    let mut config = format!("set_affinity=0,threads={}", settings.threads);
    if !settings.config.is_empty() {
        config.push(',');
        config.push_str(&settings.config);
    }
    CString::new(config).map_err(|_| PeerError::Embree {
        operation: "rtcNewDevice",
        code: code_name(2),
        message: "the configuration contains a NUL byte".to_owned(),
    })
}

/// `RTCMemoryMonitorFunction`. Returning true lets Embree go on.
unsafe extern "C" fn count_memory(monitor: *mut c_void, bytes: isize, _post: bool) -> bool {
    // SAFETY: the address of the device's monitor, set with this function.
    let monitor = unsafe { &*monitor.cast::<Monitor>() };
    let now = monitor.now.fetch_add(bytes, Ordering::Relaxed) + bytes;
    monitor.peak.fetch_max(now, Ordering::Relaxed);
    true
}

/// `RTCErrorFunction`: keeps the text for [`Device::check`].
unsafe extern "C" fn keep_message(message: *mut c_void, _code: c_int, text: *const c_char) {
    if text.is_null() {
        return;
    }
    // SAFETY: the address of the device's message, set with this function.
    let message = unsafe { &*message.cast::<Mutex<String>>() };
    // SAFETY: Embree passes a NUL-terminated string.
    let text = unsafe { CStr::from_ptr(text) };
    *message.lock().unwrap_or_else(PoisonError::into_inner) = text.to_string_lossy().into_owned();
}

impl Quality {
    /// The value of `RTCBuildQuality`.
    pub(super) const fn code(self) -> c_int {
        match self {
            Self::Low => 0,
            Self::Medium => 1,
            Self::High => 2,
        }
    }
}
