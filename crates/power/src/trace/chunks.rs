//! Pieces of a stream, decoded on several threads and handed on in order.

use super::Block;
use crate::PowerError;
use std::collections::BTreeMap;
use std::io::Read;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;

/// How files are read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadOptions {
    /// Threads that turn bytes into samples, beside the one that asks for blocks; at least 1. The
    /// default is all that this process may use.
    pub threads: usize,
    /// Bytes that one thread takes at once, 4 KiB to 1 GiB. Memory is about ten times this for each
    /// thread. The default is 1 MiB.
    pub chunk_bytes: usize,
}

impl Default for ReadOptions {
    fn default() -> Self {
        Self {
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            chunk_bytes: 1 << 20,
        }
    }
}

impl ReadOptions {
    pub(super) fn chunk(&self) -> usize {
        self.chunk_bytes.clamp(4 << 10, 1 << 30)
    }
}

/// What one piece decodes to.
#[derive(Debug, Default)]
pub(super) struct Decoded {
    pub(super) block: Block,
    /// Times that only the whole stream makes sense of: see the dump format.
    pub(super) raw_times: Vec<RawTime>,
    /// Lines of text.
    pub(super) lines: u64,
    /// Lines that are broken, and the first of them, counted from 0 within the piece.
    pub(super) bad: u64,
    pub(super) first_bad: Option<(u64, String)>,
}

/// The three clocks of a dump's row.
#[derive(Clone, Copy, Debug)]
pub(super) struct RawTime {
    pub(super) host_ns: i64,
    pub(super) host_step_us: i64,
    pub(super) device_us: i64,
}

/// Cuts a stream into pieces that can be decoded alone.
pub(super) trait Cut: Send {
    /// The next piece; none at the end.
    fn cut(&mut self) -> Result<Option<Vec<u8>>, PowerError>;
}

/// Cuts after line breaks.
pub(super) struct Lines {
    input: Box<dyn Read + Send>,
    size: usize,
    rest: Vec<u8>,
    is_done: bool,
}

impl Lines {
    pub(super) const fn new(input: Box<dyn Read + Send>, size: usize, rest: Vec<u8>) -> Self {
        Self { input, size, rest, is_done: false }
    }
}

impl Cut for Lines {
    fn cut(&mut self) -> Result<Option<Vec<u8>>, PowerError> {
        let mut piece = std::mem::take(&mut self.rest);
        while !self.is_done {
            let read = self.input.by_ref().take(self.size as u64).read_to_end(&mut piece)?;
            self.is_done = read < self.size;
            if self.is_done {
                break;
            }
            if let Some(end) = piece.iter().rposition(|&b| b == b'\n') {
                self.rest = piece.split_off(end + 1);
                return Ok(Some(piece));
            }
            // A file without line breaks is no trace; don't read all of it to find out.
            if piece.len() > 64 << 20 {
                return Err(PowerError::Header("a line is longer than 64 MiB".into()));
            }
        }
        Ok(if piece.is_empty() { None } else { Some(piece) })
    }
}

type Piece = (u64, Result<Decoded, PowerError>);

/// Decodes pieces on threads of its own.
pub(super) struct Pipeline {
    receiver: Option<Receiver<Piece>>,
    waiting: BTreeMap<u64, Result<Decoded, PowerError>>,
    next: u64,
    workers: Vec<JoinHandle<()>>,
    stop: Arc<AtomicBool>,
}

impl Pipeline {
    pub(super) fn start<C, D>(cutter: C, decode: D, threads: usize) -> Self
    where
        C: Cut + 'static,
        D: Fn(&[u8]) -> Result<Decoded, PowerError> + Send + Sync + 'static,
    {
        let threads = threads.clamp(1, 256);
        let shared = Arc::new((Mutex::new((cutter, 0u64, false)), decode));
        let stop = Arc::new(AtomicBool::new(false));
        let (sender, receiver) = sync_channel(threads);
        let workers = (0..threads)
            .map(|_| {
                let (shared, sender, stop) = (shared.clone(), sender.clone(), stop.clone());
                std::thread::spawn(move || {
                    while !stop.load(Ordering::Relaxed) {
                        let (number, piece) = {
                            let Ok(mut guard) = shared.0.lock() else { return };
                            let (cutter, number, is_done) = &mut *guard;
                            if *is_done {
                                return;
                            }
                            let piece = cutter.cut();
                            *is_done = !matches!(piece, Ok(Some(_)));
                            *number += 1;
                            (*number - 1, piece)
                        };
                        let decoded = match piece {
                            Ok(Some(piece)) => (shared.1)(&piece),
                            Ok(None) => return,
                            Err(error) => Err(error),
                        };
                        if sender.send((number, decoded)).is_err() {
                            return;
                        }
                    }
                })
            })
            .collect();
        Self { receiver: Some(receiver), waiting: BTreeMap::new(), next: 0, workers, stop }
    }

    /// What the next piece decodes to; none at the end.
    pub(super) fn next(&mut self) -> Option<Result<Decoded, PowerError>> {
        loop {
            if let Some(decoded) = self.waiting.remove(&self.next) {
                self.next += 1;
                return Some(decoded);
            }
            let (number, decoded) = self.receiver.as_ref()?.recv().ok()?;
            self.waiting.insert(number, decoded);
        }
    }
}

impl Drop for Pipeline {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        // Without a receiver, threads that wait to send end too.
        self.receiver = None;
        for worker in self.workers.drain(..) {
            // A panic of a worker has been printed; there is nobody to tell here.
            let _ = worker.join();
        }
    }
}

/// Counts lines and says when too many are broken.
#[derive(Debug, Default)]
pub(super) struct LineCount {
    lines: u64,
    bad: u64,
    first: Option<(u64, String)>,
}

impl LineCount {
    /// Lines before the first data line.
    pub(super) fn starting_at(lines: u64) -> Self {
        Self { lines, ..Self::default() }
    }

    /// Some broken lines end up in any recording that is cut off or disturbed; more than ten and more
    /// than one in a hundred mean another format.
    pub(super) fn add(&mut self, piece: &mut Decoded) -> Result<(), PowerError> {
        if let (None, Some((line, reason))) = (&self.first, piece.first_bad.take()) {
            self.first = Some((self.lines + line + 1, reason));
        }
        self.lines += piece.lines;
        self.bad += piece.bad;
        match &self.first {
            Some((first, reason)) if self.bad > 10 && self.bad * 100 > self.lines => {
                Err(PowerError::Lines {
                    bad: self.bad,
                    lines: self.lines,
                    first: *first,
                    reason: reason.clone(),
                })
            }
            _ => Ok(()),
        }
    }

    pub(super) const fn bad(&self) -> u64 {
        self.bad
    }
}
