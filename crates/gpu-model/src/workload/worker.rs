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

/// What [`Background`] is asked to find out, and a frame's number to know it by.
struct Request<Q> {
    frame: u64,
    question: Q,
}

/// An answer of [`Background`].
#[derive(Clone, Debug, PartialEq)]
pub struct Answered<Q, A> {
    /// The number that was submitted with the question.
    pub frame: u64,
    /// The question.
    pub question: Q,
    /// The answer.
    pub answer: A,
    /// How long it took, by the wall clock.
    pub took: Duration,
}

/// What both threads see. Locks are held for as long as it takes to exchange a value.
struct Shared<Q, A> {
    next: Mutex<Option<Request<Q>>>,
    wake: Condvar,
    newest: Mutex<Option<Answered<Q, A>>>,
    is_closed: AtomicBool,
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Whoever panicked held a whole value.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Answers questions about frames to come on a thread of its own.
///
/// The thread sleeps until a question is submitted. Questions that come faster than they are answered
/// replace each other: the newest counts. Dropping it ends the thread as soon as the answer under way
/// looks at the flag it is given.
///
/// ```
/// use niwaki_gpu_model::workload::Background;
///
/// let squares = Background::spawn("squares", |x: &u64, _go_on: &dyn Fn() -> bool| Some(x * x))?;
/// squares.submit(0, 12);
/// let answer = loop {
///     if let Some(answered) = squares.newest() {
///         break answered.answer;
///     }
///     std::thread::yield_now();
/// };
/// assert_eq!(answer, 144);
/// # Ok::<(), std::io::Error>(())
/// ```
pub struct Background<Q, A> {
    shared: Arc<Shared<Q, A>>,
    thread: Option<JoinHandle<()>>,
}

impl<Q, A> fmt::Debug for Background<Q, A> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Background").field("thread", &self.thread).finish_non_exhaustive()
    }
}

impl<Q, A> Background<Q, A>
where
    Q: Clone + Send + 'static,
    A: Clone + Send + 'static,
{
    /// Starts a thread of this name. `answer` is also given a function that says whether to go on; it
    /// may return `None` if not.
    ///
    /// # Errors
    /// What the system says if it has no thread.
    pub fn spawn(
        name: &str,
        answer: impl FnMut(&Q, &dyn Fn() -> bool) -> Option<A> + Send + 'static,
    ) -> io::Result<Self> {
        let shared = Arc::new(Shared {
            next: Mutex::new(None),
            wake: Condvar::new(),
            newest: Mutex::new(None),
            is_closed: AtomicBool::new(false),
        });
        let theirs = shared.clone();
        let thread =
            std::thread::Builder::new().name(name.to_owned()).spawn(move || theirs.run(answer))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Asks about a frame, with any number to know it by. Returns at once; a question that nobody has
    /// begun to answer is forgotten.
    pub fn submit(&self, frame: u64, question: Q) {
        *lock(&self.shared.next) = Some(Request { frame, question });
        self.shared.wake.notify_one();
    }

    /// The last answer, if any: returns at once, and the same again until there is a newer one.
    #[must_use]
    pub fn newest(&self) -> Option<Answered<Q, A>> {
        lock(&self.shared.newest).clone()
    }

    /// False if the thread ended because `answer` panicked: there will be no newer answer.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.thread.as_ref().is_some_and(|thread| !thread.is_finished())
    }
}

impl<Q, A> Drop for Background<Q, A> {
    fn drop(&mut self) {
        self.shared.is_closed.store(true, Ordering::Release);
        // The thread looks at the flag while it holds the lock, or is asleep.
        drop(lock(&self.shared.next));
        self.shared.wake.notify_all();
        if let Some(thread) = self.thread.take() {
            // A panic was reported when it happened.
            let _ = thread.join();
        }
    }
}

impl<Q: Clone, A> Shared<Q, A> {
    fn is_open(&self) -> bool {
        !self.is_closed.load(Ordering::Acquire)
    }

    fn run(&self, mut answer: impl FnMut(&Q, &dyn Fn() -> bool) -> Option<A>) {
        while let Some(Request { frame, question }) = self.wait() {
            let begin = Instant::now();
            if let Some(answer) = answer(&question, &|| self.is_open()) {
                let took = begin.elapsed();
                *lock(&self.newest) = Some(Answered { frame, question, answer, took });
            }
        }
    }

    /// The next question; `None` at the end.
    fn wait(&self) -> Option<Request<Q>> {
        let mut next = lock(&self.next);
        loop {
            if !self.is_open() {
                return None;
            }
            if let Some(request) = next.take() {
                return Some(request);
            }
            next = self.wake.wait(next).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

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

/// A view's workload.
pub type Sampled = Answered<View, Workload>;

/// Samples views on a thread of its own, as [`Background`] answers questions: within a row of samples
/// it notices that it was dropped.
#[derive(Debug)]
pub struct BackgroundSampler {
    worker: Background<View, Workload>,
    what: Arc<Mutex<(SampledScene, Arc<Sampling>)>>,
}

impl BackgroundSampler {
    /// Starts the thread.
    ///
    /// # Errors
    /// What the system says if it has no thread.
    pub fn spawn(scene: SampledScene, sampling: Sampling) -> io::Result<Self> {
        let what = Arc::new(Mutex::new((scene, Arc::new(sampling))));
        let theirs = what.clone();
        let worker = Background::spawn("workload sampler", move |view, go_on| {
            let (SampledScene { kernel, mesh }, sampling) = lock(&theirs).clone();
            sampling.sample_while(&*kernel, &mesh, view, go_on)
        })?;
        Ok(Self { worker, what })
    }

    /// Asks for the workload of a view, with any number to know it by. Returns at once; a view that
    /// is not yet being sampled is forgotten.
    pub fn submit(&self, frame: u64, view: View) {
        self.worker.submit(frame, view);
    }

    /// The workload that was sampled last, if any: returns at once, and the same again until there
    /// is a newer one.
    #[must_use]
    pub fn newest(&self) -> Option<Sampled> {
        self.worker.newest()
    }

    /// Samples another scene from the next view on: for scenes that move.
    pub fn set_scene(&self, scene: SampledScene) {
        // The old one is freed after the lock.
        let _old = std::mem::replace(&mut lock(&self.what).0, scene);
    }

    /// Samples otherwise from the next view on.
    pub fn set_sampling(&self, sampling: Sampling) {
        lock(&self.what).1 = Arc::new(sampling);
    }

    /// False if the thread ended because a kernel panicked: there will be no newer workload.
    #[must_use]
    pub fn is_running(&self) -> bool {
        self.worker.is_running()
    }
}
