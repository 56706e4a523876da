//! A worker process and the watch over it.

use super::worker::{Event, Row};
use anyhow::{Context, Result, bail};
use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How the attempt of an engine at a case ended, if not with answers.
#[derive(
    Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize, serde::Deserialize,
)]
#[serde(rename_all = "snake_case")]
pub(crate) enum End {
    /// It said that it does not take the case.
    Refused,
    /// It panicked.
    Panic,
    /// The process died.
    Crash,
    /// No sign of life for as long as patience lasts.
    Hang,
}

impl End {
    /// The name in tables.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Refused => "refused",
            Self::Panic => "panic",
            Self::Crash => "crash",
            Self::Hang => "hang",
        }
    }
}

/// What becomes of an engine's attempt at a case, in the order in which it happens.
#[derive(Clone, Debug)]
pub(crate) enum News {
    /// A kernel of it begins.
    Begins(String),
    /// What the kernel's answers have come to so far.
    SoFar(Row),
    /// A kernel has answered.
    Answered(String, Row),
    /// It ended in another way; the kernel at work, where one was, its answers up to then, and what
    /// was said.
    Ended { kernel: Option<String>, row: Option<Row>, end: End, what: String },
    /// Nothing more will come.
    Over,
}

/// Starts worker processes as they are needed, and kills those that show no sign of life, or take
/// too long.
pub(crate) struct Watch<'a> {
    command: &'a dyn Fn() -> Command,
    patience: Duration,
    /// The time that an engine may take for a case, where it is limited.
    limit: &'a dyn Fn(usize) -> Option<Duration>,
    worker: Option<Worker>,
}

/// How long a worker may go on.
struct Clock {
    /// How long it may be silent.
    patience: Duration,
    last_event: Instant,
    worker: u32,
    start: Instant,
    /// The rest of the time that the engine may take.
    left: Option<Duration>,
    /// The worker's time when that began to run; `None` while exact answers are found.
    running: Option<Duration>,
}

impl Clock {
    /// Exact arithmetic ends, but on hard cases it may take its time.
    const JUDGING: u32 = 20;

    fn new(patience: Duration, worker: u32) -> Self {
        let now = Instant::now();
        Self { patience, last_event: now, worker, start: now, left: None, running: None }
    }

    /// The worker's, on whatever it spent it; of the wall where the system does not tell.
    fn now(&self) -> Duration {
        processor_time(self.worker).unwrap_or_else(|| self.start.elapsed())
    }

    fn start(&mut self, left: Option<Duration>) {
        (self.left, self.running) = (left, Some(self.now()));
    }

    fn stop(&mut self) {
        // It has answered, if only just.
        self.left = self.left().map(|left| left.max(Duration::from_millis(1)));
        self.running = None;
    }

    fn go_on(&mut self) {
        self.last_event = Instant::now();
        if self.running.is_none() {
            self.running = Some(self.now());
        }
    }

    /// `None` where nothing is limited, or nothing runs.
    fn left(&self) -> Option<Duration> {
        let (left, since) = (self.left?, self.running?);
        Some(left.saturating_sub(self.now().saturating_sub(since)))
    }

    fn silence_left(&self) -> Duration {
        let patience =
            if self.running.is_none() { self.patience * Self::JUDGING } else { self.patience };
        patience.saturating_sub(self.last_event.elapsed())
    }

    /// No time is over before.
    fn wait(&self) -> Duration {
        let silence = self.silence_left();
        self.left().map_or(silence, |left| silence.min(left)).max(Duration::from_millis(5))
    }

    /// Why it may not go on any more.
    fn verdict(&self) -> Option<&'static str> {
        if self.left() == Some(Duration::ZERO) {
            Some("not finished after")
        } else {
            (self.silence_left() == Duration::ZERO).then_some("no sign of life for")
        }
    }
}

/// What all threads of a process have had of processors, where Linux tells: on a busy machine, a
/// process is not slow because it has to wait.
fn processor_time(process: u32) -> Option<Duration> {
    let mut sum = 0;
    for thread in std::fs::read_dir(format!("/proc/{process}/task")).ok()? {
        // Threads may end meanwhile.
        let text = std::fs::read_to_string(thread.ok()?.path().join("schedstat"));
        let nanoseconds = text.ok().and_then(|t| t.split(' ').next()?.parse::<u64>().ok());
        sum += nanoseconds.unwrap_or(0);
    }
    (sum > 0).then(|| Duration::from_nanos(sum))
}

struct Worker {
    child: Child,
    input: ChildStdin,
    events: Receiver<Event>,
    /// Ends with the last line that it wrote to standard error: an assertion, as a rule.
    last_words: Option<JoinHandle<Option<String>>>,
}

impl Worker {
    fn start(mut command: Command) -> Result<Self> {
        let mut child = command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .context("cannot start a worker process")?;
        let input = child.stdin.take().context("a worker has no input")?;
        let output = child.stdout.take().context("a worker has no output")?;
        let errors = child.stderr.take().context("a worker has no standard error")?;
        let last_words = std::thread::spawn(move || {
            BufReader::new(errors).lines().map_while(Result::ok).filter(|l| !l.is_empty()).last()
        });
        let (sender, events) = channel();
        std::thread::spawn(move || {
            // What is no event was printed by a library.
            let lines = BufReader::new(output).lines().map_while(Result::ok);
            for event in lines.filter_map(|line| serde_json::from_str(&line).ok()) {
                if sender.send(event).is_err() {
                    return;
                }
            }
        });
        Ok(Self { child, input, events, last_words: Some(last_words) })
    }
}

impl Worker {
    /// Makes an end of it and returns its last words.
    fn bury(mut self) -> Option<String> {
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.last_words.take()?.join().ok().flatten()
    }
}

impl Drop for Worker {
    fn drop(&mut self) {
        // It may be gone already; either way it is waited for, so that none stays behind.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl<'a> Watch<'a> {
    /// A watch over processes that `command` starts.
    pub(crate) fn new(
        command: &'a dyn Fn() -> Command,
        patience: Duration,
        limit: &'a dyn Fn(usize) -> Option<Duration>,
    ) -> Self {
        Self { command, patience, limit, worker: None }
    }

    /// Lets a worker try engines at a case, a new one after each that died or hung, and reports
    /// what comes of each engine.
    ///
    /// # Errors
    /// If no worker can be started, or one fails before it begins with an engine.
    pub(crate) fn run(
        &mut self,
        case: usize,
        engines: &[usize],
        mut report: impl FnMut(usize, News),
    ) -> Result<()> {
        let mut rest = engines;
        while !rest.is_empty() {
            let numbers: Vec<String> =
                std::iter::once(&case).chain(rest).map(ToString::to_string).collect();
            let worker = match &mut self.worker {
                Some(worker) => worker,
                none => none.insert(Worker::start((self.command)())?),
            };
            // If it cannot be written to, it died, and the channel says so.
            let _ = writeln!(worker.input, "{}", numbers.join(" "));
            let mut engine = None;
            let (mut kernel, mut so_far) = (None, None);
            // Before the first engine begins, it finds the exact answers.
            let mut clock = Clock::new(self.patience, worker.child.id());
            let mut tell = |engine: Option<usize>, news| {
                if let Some(engine) = engine {
                    report(engine, news);
                }
            };
            let end = loop {
                let event = worker.events.recv_timeout(clock.wait());
                if event.is_ok() {
                    clock.go_on();
                }
                match event {
                    Ok(Event::Done) => {
                        rest = &[];
                        break None;
                    }
                    Ok(Event::Engine(number)) => {
                        tell(engine, News::Over);
                        let place = rest.iter().position(|&e| e == number);
                        rest = &rest[place.map_or(rest.len(), |place| place + 1)..];
                        (engine, kernel, so_far) = (Some(number), None, None);
                        clock.start((self.limit)(number));
                    }
                    Ok(Event::Kernel(name)) => {
                        (kernel, so_far) = (Some(name.clone()), None);
                        tell(engine, News::Begins(name));
                    }
                    Ok(Event::Judging) => clock.stop(),
                    Ok(Event::SoFar(row)) => {
                        so_far = Some(row.clone());
                        tell(engine, News::SoFar(row));
                    }
                    Ok(Event::Row(name, row)) => {
                        (kernel, so_far) = (None, None);
                        tell(engine, News::Answered(name, row));
                    }
                    Ok(Event::Refused(what)) => {
                        let end = End::Refused;
                        tell(engine, News::Ended { kernel: None, row: None, end, what });
                    }
                    Ok(Event::Panicked(what)) => {
                        let (kernel, row) = (kernel.take(), so_far.take());
                        tell(engine, News::Ended { kernel, row, end: End::Panic, what });
                    }
                    Err(RecvTimeoutError::Timeout) => {
                        let Some(verdict) = clock.verdict() else { continue };
                        let time = if clock.left() == Some(Duration::ZERO) {
                            engine.and_then(self.limit).unwrap_or(self.patience)
                        } else {
                            self.patience
                        };
                        break Some((End::Hang, format!("{verdict} {} s", time.as_secs())));
                    }
                    Err(RecvTimeoutError::Disconnected) => {
                        let status = worker.child.wait().context("cannot wait for a worker")?;
                        break Some((End::Crash, status.to_string()));
                    }
                }
            };
            if let Some((end, mut what)) = end {
                if let Some(words) = self.worker.take().and_then(Worker::bury) {
                    what = format!("{what}, {words}");
                }
                if engine.is_none() {
                    bail!("a worker failed before its first engine: {}, {what}", end.name());
                }
                tell(engine, News::Ended { kernel, row: so_far, end, what });
            }
            tell(engine, News::Over);
        }
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// What a worker that runs a shell script comes to, for engines 4, 5 and 6 of case 1. Engine 5
    /// has one second.
    fn outcomes(script: &str) -> Result<Vec<(usize, String)>> {
        let command = || {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            command
        };
        let limit = |engine| (engine == 5).then(|| Duration::from_secs(1));
        let mut seen = Vec::new();
        let mut watch = Watch::new(&command, Duration::from_secs(3), &limit);
        watch.run(1, &[4, 5, 6], |engine, news| {
            let what = match news {
                News::Begins(_) | News::SoFar(_) => return,
                News::Answered(kernel, _) => kernel,
                News::Ended { kernel, end: End::Crash, what, .. } => {
                    assert!(what.ends_with("last words"), "{what}");
                    format!("crash in {kernel:?}")
                }
                News::Ended { kernel, row, end, .. } => {
                    let inside = row.map(|row| row.inside);
                    format!("{} in {kernel:?} after {inside:?}", end.name())
                }
                News::Over => "over".to_owned(),
            };
            seen.push((engine, what));
        })?;
        Ok(seen)
    }

    fn expected(what: &[(usize, &str)]) -> Vec<(usize, String)> {
        what.iter().map(|&(engine, what)| (engine, what.to_owned())).collect()
    }

    const ANSWER: &str = r#"
        row='{"tally":{"rays":1,"tie":0,"rounding":0,"ours_rounded":0,"peer_rounded":0,"peer_wrong":0,"ours_wrong":0},"illegal":0,"inside":7,"leaks":0,"example":null}'
        answer() { for e in "$@"; do
            echo "{\"Engine\":$e}"
            echo "{\"Row\":[\"k$e\",$row]}"
        done; }
        read case engines
    "#;

    #[test]
    fn a_crash_costs_one_engine() {
        let script = format!(
            "{ANSWER}
            case $engines in
                4*) answer 4; echo 'words of a library'; echo 'last words' >&2
                    echo '{{\"Engine\":5}}'; echo '{{\"Kernel\":\"fast\"}}'; kill -9 $$ ;;
                *) answer $engines; echo '\"Done\"' ;;
            esac"
        );
        let expected = expected(&[
            (4, "k4"),
            (4, "over"),
            (5, "crash in Some(\"fast\")"),
            (5, "over"),
            (6, "k6"),
            (6, "over"),
        ]);
        assert_eq!(outcomes(&script).unwrap(), expected);
    }

    #[test]
    fn a_hang_and_a_panic_cost_one_engine_each() {
        let script = format!(
            "{ANSWER}
            case $engines in
                4*) echo '{{\"Engine\":4}}'; echo '{{\"Kernel\":\"fast\"}}'
                    echo '{{\"Panicked\":\"x\"}}'; echo '{{\"Engine\":5}}'; exec sleep 1000 ;;
                *) answer $engines; echo '\"Done\"' ;;
            esac"
        );
        let expected = expected(&[
            (4, "panic in Some(\"fast\") after None"),
            (4, "over"),
            (5, "hang in None after None"),
            (5, "over"),
            (6, "k6"),
            (6, "over"),
        ]);
        assert_eq!(outcomes(&script).unwrap(), expected);
    }

    #[test]
    fn one_that_takes_too_long_keeps_what_it_had_and_is_not_charged_for_our_judging() {
        let script = format!(
            "{ANSWER}
            case $engines in
                4*) answer 4; echo '{{\"Engine\":5}}'; echo '{{\"Kernel\":\"fast\"}}'
                    echo '\"Judging\"'; sleep 2; echo \"{{\\\"SoFar\\\":$row}}\"
                    while :; do :; done ;;
                *) answer $engines; echo '\"Done\"' ;;
            esac"
        );
        let expected = expected(&[
            (4, "k4"),
            (4, "over"),
            (5, "hang in Some(\"fast\") after Some(7)"),
            (5, "over"),
            (6, "k6"),
            (6, "over"),
        ]);
        assert_eq!(outcomes(&script).unwrap(), expected);
    }

    #[test]
    fn a_worker_that_never_begins_is_an_error() {
        let error = outcomes("exit 3").unwrap_err().to_string();
        assert!(error.contains("before its first engine") && error.contains('3'), "{error}");
    }
}
