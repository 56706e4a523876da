//! The methods, and the choice among them.

use super::align::Pattern;
use super::fit::fit;
use super::{ClockMap, SyncMethod};
use crate::survey::{Bins, Survey};
use crate::{Clock, FrameLog, PowerError};

/// Frames with less idle time than this many samples between them have no edges that could be told apart.
const LEAST_GAP: f64 = 6.0;

/// Brings a log and a trace together.
pub(crate) fn synchronize(
    log: &FrameLog,
    survey: &Survey,
    trace_clock: Clock,
    period_ns: f64,
    method: SyncMethod,
) -> Result<ClockMap, PowerError> {
    if log.frames.is_empty() {
        return Err(PowerError::NoSync("the log has no frames".into()));
    }
    let is_shared = trace_clock == log.header.clock && trace_clock != Clock::Device;
    match method {
        SyncMethod::SharedClock if is_shared => Ok(shared(log)),
        SyncMethod::SharedClock => Err(PowerError::NoSync(
            "the log and the trace do not say that one clock stamped both".into(),
        )),
        SyncMethod::Marker => by_marker(log, survey, period_ns),
        SyncMethod::Correlation => by_correlation(log, survey, period_ns),
        SyncMethod::Idle => by_idle(log, survey, period_ns),
        SyncMethod::Auto => {
            if is_shared {
                return Ok(shared(log));
            }
            let mut tried = Vec::new();
            // A line through a few of many marks is a last resort.
            let mut doubtful = None;
            let marks = survey.marks.len().min(marked_frames(log).len());
            for (name, found) in [
                ("marker", (!survey.marks.is_empty()).then(|| by_marker(log, survey, period_ns))),
                ("correlation", Some(by_correlation(log, survey, period_ns))),
                ("idle", Some(by_idle(log, survey, period_ns))),
            ] {
                match found {
                    Some(Ok(map)) if name == "marker" && 2 * map.matched < marks.max(8) => {
                        tried.push(format!("marker: only {} of {marks} marks fit", map.matched));
                        doubtful = Some(map);
                    }
                    Some(Ok(map)) => return Ok(map),
                    Some(Err(error)) => tried.push(format!("{name}: {error}")),
                    None => tried.push(format!("{name}: there are no marks")),
                }
            }
            doubtful.ok_or_else(|| PowerError::NoSync(tried.join("; ")))
        }
    }
}

fn shared(log: &FrameLog) -> ClockMap {
    ClockMap {
        method: SyncMethod::SharedClock,
        reference_ns: log.frames[0].start_ns,
        offset_ns: 0.0,
        offset_error_ns: 0.0,
        drift_ppm: 0.0,
        drift_error_ppm: 0.0,
        residual_ns: 0.0,
        matched: 0,
        similarity: None,
        runner_up: None,
    }
}

/// Frames at whose start the log says a mark was given; all frames if it says so of none.
fn marked_frames(log: &FrameLog) -> Vec<i64> {
    let marked: Vec<_> = log.frames.iter().filter(|f| f.marker).map(|f| f.start_ns).collect();
    if marked.is_empty() { log.frames.iter().map(|f| f.start_ns).collect() } else { marked }
}

fn by_marker(log: &FrameLog, survey: &Survey, period_ns: f64) -> Result<ClockMap, PowerError> {
    let starts = marked_frames(log);
    let marks = survey.mark_times();
    if starts.len() < 2 || marks.len() < 2 {
        return Err(PowerError::NoSync(format!(
            "{} marks in the log and {} in the trace; two are needed",
            starts.len(),
            marks.len()
        )));
    }
    if starts.len() == marks.len() {
        // One to one, if times agree.
        let pairs: Vec<_> = starts.iter().map(|&s| s as f64).zip(marks.iter().copied()).collect();
        let all = pairs.len();
        if let Some(map) = fit(&pairs, SyncMethod::Marker, 2.0 * period_ns)
            && map.matched * 10 >= all * 9
            && map.drift_ppm.abs() < 1000.0
        {
            return Ok(map);
        }
    }
    // Marks are missing or too many: find the pattern.
    let width_ns = survey.bins.width_ns;
    let intervals: Vec<_> = starts.iter().map(|&s| (s - width_ns / 2, s + width_ns / 2)).collect();
    let mut shown = Bins { watts: vec![0.0; survey.bins.watts.len()], ..survey.bins.clone() };
    for mark in &survey.marks {
        let bin = usize::try_from((mark.time_ns - shown.start_ns) / width_ns).unwrap_or(usize::MAX);
        if let Some(bin) = shown.watts.get_mut(bin) {
            *bin = 1.0;
        }
    }
    let log_times: Vec<_> = starts.iter().map(|&s| s as f64).collect();
    let distinct_ns = half_frame(&starts);
    let events = [(log_times, marks)];
    let pattern =
        Pattern { intervals: &intervals, shown: &shown, events: &events, period_ns, distinct_ns };
    enough(pattern.align(SyncMethod::Marker)?, starts.len().min(survey.marks.len()), "marks")
}

fn half_frame(starts: &[i64]) -> f64 {
    let mut steps: Vec<_> = starts.windows(2).map(|p| p[1] - p[0]).collect();
    if steps.is_empty() {
        return 1e6;
    }
    let middle = steps.len() / 2;
    0.5 * *steps.select_nth_unstable(middle).1 as f64
}

/// A line through a few chance neighbours is no synchronisation.
fn enough(map: ClockMap, events: usize, what: &str) -> Result<ClockMap, PowerError> {
    if map.matched >= 4.max(events / 10) && map.drift_ppm.abs() < 1000.0 {
        return Ok(map);
    }
    Err(PowerError::NoSync(format!(
        "only {} of {events} {what} fall together (drift {:.0} ppm)",
        map.matched, map.drift_ppm
    )))
}

fn by_correlation(log: &FrameLog, survey: &Survey, period_ns: f64) -> Result<ClockMap, PowerError> {
    let levels = survey.levels;
    let range = levels.high_w - levels.low_w;
    if range < 6.0 * levels.noise_w.max(1e-9) {
        return Err(PowerError::NoSync("the power hardly changes".into()));
    }
    // Frames without idle time between them are one stretch of work.
    let mut intervals: Vec<(i64, i64)> = Vec::new();
    for frame in &log.frames {
        match intervals.last_mut() {
            Some((_, end)) if (frame.start_ns - *end) as f64 <= LEAST_GAP * period_ns => {
                *end = (*end).max(frame.end_ns);
            }
            _ => intervals.push((frame.start_ns, frame.end_ns)),
        }
    }
    #[expect(clippy::cast_possible_truncation, reason = "watts of a device")]
    let (low, scale) = (levels.low_w as f32, (1.0 / range) as f32);
    let watts = survey.bins.watts.iter().map(|w| ((w - low) * scale).clamp(0.0, 1.0)).collect();
    let shown = Bins { watts, ..survey.bins };
    let strong = |up: bool| -> Vec<f64> {
        let is_strong = |step: f32| {
            let step = f64::from(if up { step } else { -step });
            step > 0.25 * range
        };
        survey.edges.iter().filter(|e| is_strong(e.step_w)).map(|e| e.time_ns).collect()
    };
    let starts: Vec<_> = intervals.iter().map(|i| i.0 as f64).collect();
    let ends: Vec<_> = intervals.iter().map(|i| i.1 as f64).collect();
    let events = [(starts, strong(true)), (ends, strong(false))];
    let frame_starts: Vec<_> = log.frames.iter().map(|f| f.start_ns).collect();
    let distinct_ns = half_frame(&frame_starts);
    let pattern =
        Pattern { intervals: &intervals, shown: &shown, events: &events, period_ns, distinct_ns };
    let mut map = enough(pattern.align(SyncMethod::Correlation)?, 2 * intervals.len(), "edges")?;
    // Residuals of edges share the shape of the flank, so their mean is no better than a sample.
    map.offset_error_ns = map.offset_error_ns.hypot(period_ns / 12f64.sqrt());
    if map.similarity.is_some_and(|s| s < 0.3) {
        return Err(PowerError::NoSync(format!(
            "the power does not look like the frames (correlation {:.2})",
            map.similarity.unwrap_or(0.0)
        )));
    }
    Ok(map)
}

fn by_idle(log: &FrameLog, survey: &Survey, period_ns: f64) -> Result<ClockMap, PowerError> {
    let levels = survey.levels;
    let limit = levels.idle_limit_w();
    let range = levels.high_w - levels.low_w;
    let bins = &survey.bins;
    let is_busy = |w: &&f32| f64::from(**w) > limit;
    let quiet = |count: usize| count as i64 * bins.width_ns;
    let before = bins.watts.iter().take_while(|w| !is_busy(w)).count();
    let after = bins.watts.iter().rev().take_while(|w| !is_busy(w)).count();
    if before == bins.watts.len() || quiet(before.min(after)) < 50_000_000 {
        return Err(PowerError::NoSync(
            "the device is not idle for 50 ms at the start and at the end".into(),
        ));
    }
    // The sharp edge within two bins of where the bins change.
    let find = |bin: usize, up: bool| {
        let time = (bins.start_ns + quiet(bin)) as f64;
        let near = |t: f64| (t - time).abs() <= 2.0 * bins.width_ns as f64;
        let step = |s: f32| f64::from(if up { s } else { -s });
        let mut all =
            survey.edges.iter().filter(|e| near(e.time_ns) && step(e.step_w) > 0.1 * range);
        let edge = if up { all.next() } else { all.next_back() };
        edge.map(|e| e.time_ns)
    };
    let (Some(up), Some(down)) = (find(before, true), find(bins.watts.len() - after, false)) else {
        return Err(PowerError::NoSync("the power has no edge where idle time ends".into()));
    };
    let first = log.frames[0].start_ns as f64;
    let last = log.frames.iter().map(|f| f.end_ns).max().unwrap_or(0) as f64;
    // Two readings, each as good as a few samples: fit() takes a third of this as their deviation.
    let map = fit(&[(first, up), (last, down)], SyncMethod::Idle, 6.0 * period_ns)
        .filter(|map| map.drift_ppm.abs() < 1000.0 && last > first);
    map.ok_or_else(|| {
        PowerError::NoSync("idle times are not as far apart as the frames of the log".into())
    })
}
