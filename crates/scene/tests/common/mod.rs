//! Small files made byte by byte.

#![allow(dead_code, unused_imports, unreachable_pub, reason = "each test file uses some of this")]

pub mod animated;

pub use niwaki_hard_cases::files::{glb, square, square_json};
use std::{
    path::{Path, PathBuf},
    sync::atomic::{AtomicU32, Ordering},
};

/// A folder that goes away with the value.
pub struct Folder(PathBuf);

impl Folder {
    pub fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let n = NEXT.fetch_add(1, Ordering::Relaxed);
        let path = std::env::temp_dir().join(format!("niwaki-scene-{}-{n}", std::process::id()));
        std::fs::create_dir_all(&path).expect("the temporary folder can be written");
        Self(path)
    }

    pub fn file(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).expect("the temporary folder can be written");
        path
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Loads with the default options.
pub fn load(path: &Path) -> Result<niwaki_scene::Scene, niwaki_scene::LoadError> {
    niwaki_scene::load(path, &niwaki_scene::LoadOptions::default())
}
