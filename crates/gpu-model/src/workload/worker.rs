//! Sampling on a thread of its own, while the previous frame is drawn.

use super::{CountingKernel, Sampling, View, Workload};
use niwaki_core::TriangleMesh;
use std::{
    fmt, io,
    sync::{
        Arc, Condvar, Mutex, MutexGuard, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::JoinHandle,
    time::{Duration, Instant},
};

/// A scene that can be sampled: a kernel and the mesh that it was made of.
#[derive(Clone)]
pub struct SampledScene {
    /// The kernel.
    pub kernel: Arc<dyn CountingKernel>,
    /// The mesh.
    pub mesh: Arc<TriangleMesh>,
}

impl fmt::Debug for SampledScene {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("SampledScene").field("triangles", &self.mesh.len()).finish_non_exhaustive()
    }
}

/// What is to be sampled.
struct Request {
    frame: u64,
    view: View,
}

/// A workload and what it is of.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampled {
    /// The number that was submitted with the view.
    pub frame: u64,
    /// The view.
    pub view: View,
    /// Its workload.
    pub workload: Workload,
    /// How long sampling took, by the wall clock.
    pub took: Duration,
}

/// What both threads see. Locks are held for as long as it takes to exchange a value.
struct Shared {
    /// The view to be sampled next, the scene and the settings.
    next: Mutex<Next>,
    wake: Condvar,
    newest: Mutex<Option<Sampled>>,
    is_closed: AtomicBool,
}

struct Next {
    request: Option<Request>,
    scene: SampledScene,
    sampling: Arc<Sampling>,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Whoever panicked held a whole value.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Samples views on a thread of its own.
///
/// The thread sleeps until a view is submitted. Views that are submitted faster than they are
/// sampled replace each other: the newest counts. Dropping the sampler ends the thread, within a row
/// of samples.
#[derive(Debug)]
pub struct BackgroundSampler {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl fmt::Debug for Shared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Shared").finish_non_exhaustive()
    }
}

impl BackgroundSampler {
    /// Starts the thread.
    ///
    /// # Errors
    /// What the system says if it has no thread.
    pub fn spawn(scene: SampledScene, sampling: Sampling) -> io::Result<Self> {
        let next = Next { request: None, scene, sampling: Arc::new(sampling) };
        let shared = Arc::new(Shared {
            next: Mutex::new(next),
            wake: Condvar::new(),
            newest: Mutex::new(None),
            is_closed: AtomicBool::new(false),
        });
        let theirs = shared.clone();
        let thread = std::thread::Builder::new()
            .name("workload sampler".to_owned())
            .spawn(move || theirs.run())?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Asks for the workload of a view, with any number to know it by. Returns at once; a view that
    /// is not yet being sampled is forgotten.
    pub fn submit(&self, frame: u64, view: View) {
        lock(&self.shared.next).request = Some(Request { frame, view });
        self.shared.wake.notify_one();
    }

    /// The workload that was sampled last, if any: returns at once, and the same again until there
    /// is a newer one.
    #[must_use]
    pub fn newest(&self) -> Option<Sampled> {
        *lock(&self.shared.newest)
    }

    /// Samples another scene from the next view on: for scenes that move.
    pub fn set_scene(&self, scene: SampledScene) {
        // The old one is freed after the lock.
        let _old = std::mem::replace(&mut lock(&self.shared.next).scene, scene);
    }

    /// Samples otherwise from the next view on.
    pub fn set_sampling(&self, sampling: Sampling) {
        lock(&self.shared.next).sampling = Arc::new(sampling);
    }

    /// False if the thread ended because a kernel panicked: there will be no newer workload.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl Drop for BackgroundSampler {
    fn drop(&mut self) {
        self.shared.is_closed.store(true, Ordering::Release);
        // The thread looks at the flag while it holds the lock, or is asleep.
        drop(lock(&self.shared.next));
        self.shared.wake.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic of a kernel was reported when it happened.
            let _ = thread.join();
        }
    }
}

impl Shared {
    fn is_open(&self) -> bool {
        !self.is_closed.load(Ordering::Acquire)
    }

    fn run(&self) {
        while let Some((Request { frame, view }, scene, sampling)) = self.wait() {
            let begin = Instant::now();
            let SampledScene { kernel, mesh } = &scene;
            let sampled = sampling.sample_while(&**kernel, mesh, &view, || self.is_open());
            if let Some(workload) = sampled {
                let took = begin.elapsed();
                *lock(&self.newest) = Some(Sampled { frame, view, workload, took });
            }
        }
    }

    /// The next view; `None` at the end.
    fn wait(&self) -> Option<(Request, SampledScene, Arc<Sampling>)> {
        let mut next = lock(&self.next);
        loop {
            if !self.is_open() {
                return None;
            }
            if let Some(request) = next.request.take() {
                return Some((request, next.scene.clone(), next.sampling.clone()));
            }
            next = self.wake.wait(next).unwrap_or_else(PoisonError::into_inner);
        }
    }
}
