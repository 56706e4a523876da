//! A worker process and the watch over it.

use super::worker::{Event, Row};
use anyhow::{Context, Result};
use std::io::{BufRead as _, BufReader, Write as _};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::thread::JoinHandle;
use std::time::Duration;

/// How the attempt of an engine at a case ended, if not with answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
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

/// What came of an engine's attempt at a case.
#[derive(Clone, Debug)]
pub(crate) enum Outcome {
    /// A kernel has answered.
    Answered(Row),
    /// It ended in another way; the kernel at work, where one was, and what was said.
    Ended { kernel: Option<String>, end: End, what: String },
}

/// Starts worker processes as they are needed, and kills those that show no sign of life.
pub(crate) struct Watch<'a> {
    command: &'a dyn Fn() -> Command,
    patience: Duration,
    worker: Option<Worker>,
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
    pub(crate) fn new(command: &'a dyn Fn() -> Command, patience: Duration) -> Self {
        Self { command, patience, worker: None }
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
        mut report: impl FnMut(usize, Outcome),
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
            let mut kernel = None;
            let end = loop {
                match worker.events.recv_timeout(self.patience) {
                    Ok(Event::Done) => {
                        rest = &[];
                        break None;
                    }
                    Ok(Event::Alive) => {}
                    Ok(Event::Engine(number)) => {
                        let place = rest.iter().position(|&e| e == number);
                        rest = &rest[place.map_or(rest.len(), |place| place + 1)..];
                        (engine, kernel) = (Some(number), None);
                    }
                    Ok(Event::Kernel(name)) => kernel = Some(name),
                    Ok(Event::Row(row)) => {
                        kernel = None;
                        engine.into_iter().for_each(|e| report(e, Outcome::Answered(row.clone())));
                    }
                    Ok(Event::Refused(what)) => {
                        let ended = Outcome::Ended { kernel: None, end: End::Refused, what };
                        engine.into_iter().for_each(|e| report(e, ended.clone()));
                    }
                    Ok(Event::Panicked(what)) => {
                        let kernel = kernel.take();
                        let ended = Outcome::Ended { kernel, end: End::Panic, what };
                        engine.into_iter().for_each(|e| report(e, ended.clone()));
                    }
                    Err(RecvTimeoutError::Timeout) => {
                        break Some((End::Hang, format!("nothing for {:?}", self.patience)));
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
                let engine = engine.with_context(|| {
                    format!("a worker failed before its first engine: {}, {what}", end.name())
                })?;
                report(engine, Outcome::Ended { kernel, end, what });
            }
        }
        Ok(())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    /// What a worker that runs a shell script comes to, for engines 4, 5 and 6 of case 1.
    fn outcomes(script: &str) -> Result<Vec<(usize, String)>> {
        let command = || {
            let mut command = Command::new("sh");
            command.args(["-c", script]);
            command
        };
        let mut seen = Vec::new();
        let mut watch = Watch::new(&command, Duration::from_secs(3));
        watch.run(1, &[4, 5, 6], |engine, outcome| {
            seen.push((
                engine,
                match outcome {
                    Outcome::Answered(row) => row.kernel,
                    Outcome::Ended { kernel, end: End::Crash, what } => {
                        assert!(what.ends_with("last words"), "{what}");
                        format!("crash in {kernel:?}")
                    }
                    Outcome::Ended { kernel, end, .. } => format!("{} in {kernel:?}", end.name()),
                },
            ));
        })?;
        Ok(seen)
    }

    const ANSWER: &str = r#"
        answer() { for e in "$@"; do
            echo "{\"Engine\":$e}"
            echo "{\"Row\":{\"kernel\":\"k$e\",\"tally\":{\"rays\":1,\"tie\":0,\"rounding\":0,\"ours_rounded\":0,\"peer_rounded\":0,\"peer_wrong\":0,\"ours_wrong\":0},\"illegal\":0,\"inside\":0,\"leaks\":0,\"example\":null}}"
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
        let expected = [(4, "k4"), (5, "crash in Some(\"fast\")"), (6, "k6")];
        assert_eq!(outcomes(&script).unwrap(), expected.map(|(e, s)| (e, s.to_owned())));
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
        let expected = [(4, "panic in Some(\"fast\")"), (5, "hang in None"), (6, "k6")];
        assert_eq!(outcomes(&script).unwrap(), expected.map(|(e, s)| (e, s.to_owned())));
    }

    #[test]
    fn a_worker_that_never_begins_is_an_error() {
        let error = outcomes("exit 3").unwrap_err().to_string();
        assert!(error.contains("before its first engine") && error.contains('3'), "{error}");
    }
}
