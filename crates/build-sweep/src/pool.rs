//! Workspaces for as many tasks as run at once.

use crate::kernel::Kernel;
use crate::workspace::SweepWorkspace;
use std::ops::{Deref, DerefMut};
use std::sync::Mutex;

/// Lends workspaces. Rayon makes more states for a parallel loop than there are threads, one after
/// the other; with a pool they share memory that has its size and is in the cache.
#[derive(Debug)]
pub struct WorkspacePool {
    free: Mutex<Vec<SweepWorkspace>>,
    kernel: Kernel,
    /// Primitives that a new workspace has room for.
    capacity: usize,
}

/// A workspace that goes back to its pool when it is dropped.
#[derive(Debug)]
pub struct PooledWorkspace<'a> {
    workspace: SweepWorkspace,
    pool: &'a WorkspacePool,
}

impl WorkspacePool {
    /// A pool of workspaces for trees of up to `capacity` primitives; larger ones cost an
    /// allocation.
    #[must_use]
    pub const fn new(kernel: Kernel, capacity: usize) -> Self {
        Self { free: Mutex::new(Vec::new()), kernel, capacity }
    }

    /// A workspace that was used before, or a new one.
    #[must_use]
    pub fn take(&self) -> PooledWorkspace<'_> {
        let free = self.free.lock().ok().and_then(|mut free| free.pop());
        PooledWorkspace {
            workspace: free
                .unwrap_or_else(|| SweepWorkspace::with_capacity(self.kernel, self.capacity)),
            pool: self,
        }
    }
}

impl Deref for PooledWorkspace<'_> {
    type Target = SweepWorkspace;

    fn deref(&self) -> &SweepWorkspace {
        &self.workspace
    }
}

impl DerefMut for PooledWorkspace<'_> {
    fn deref_mut(&mut self) -> &mut SweepWorkspace {
        &mut self.workspace
    }
}

impl Drop for PooledWorkspace<'_> {
    fn drop(&mut self) {
        let empty = SweepWorkspace::new(self.pool.kernel);
        if let Ok(mut free) = self.pool.free.lock() {
            free.push(std::mem::replace(&mut self.workspace, empty));
        }
    }
}
