//! The paper's five questions (§2), answered by what was measured.

use super::rows::{Answer, Cell, Study, median};
use crate::power::published;
use crate::report::axis::short;
use niwaki_frame_control::kendall_tau_b;
use niwaki_raster::Algorithm;
use std::cmp::Ordering;

/// Power that differs by less than this share over all cells counts as the same, and energy as
/// proportional to time.
const PROPORTIONAL: f64 = 0.05;

const QUESTIONS: [&str; 5] = [
    "1. What are the power characteristics of different graphics algorithms solving the same problem on \
     different graphics architectures?",
    "2. Is energy directly proportional to frame time?",
    "3. What does the power consumption look like during an animation?",
    "4. What does the power consumption look like inside a frame (for different algorithms)?",
    "5. Can power optimization of software algorithms become a new subtopic in graphics?",
];

const NO_METER: &str = "There is no energy to say more: --source names a meter or the trace of an \
                        instrument.";

const NO_CONTEST: &str = "No two algorithms that solve the same problem were measured.";

/// Algorithms that solve one problem.
struct Contest<'a> {
    title: String,
    cells: Vec<&'a Cell>,
}

/// All answers; without cells there are none.
pub(super) fn all(study: &Study) -> Vec<Answer> {
    if study.cells.is_empty() {
        return Vec::new();
    }
    let contests = contests(&study.cells);
    let measured: Vec<&Cell> = study.cells.iter().filter(|c| c.energy.is_some()).collect();
    let words = [
        characteristics(&contests),
        proportional(&measured, &contests),
        along(&study.cells),
        inside(&study.cells),
        worth_it(&contests),
    ];
    let of_energy = [!measured.is_empty(); 5];
    let mut answers = Vec::new();
    for ((question, mut words), is_answered) in QUESTIONS.into_iter().zip(words).zip(of_energy) {
        if !is_answered {
            words.push(NO_METER.into());
        }
        answers.push(Answer { question, is_answered, words });
    }
    answers
}

fn contests(cells: &[Cell]) -> Vec<Contest<'_>> {
    let mut contests: Vec<Contest<'_>> = Vec::new();
    for cell in cells {
        match contests.iter_mut().find(|c| c.cells[0].key.competes_with(&cell.key)) {
            Some(contest) => contest.cells.push(cell),
            None => {
                let key = &cell.key;
                let what = match key.algorithm.has_shadows() {
                    true => format!("shadows of {} lights", key.lights),
                    false => "primary rendering".into(),
                };
                let title = format!("{} {}, {what}", key.scene, key.size());
                contests.push(Contest { title, cells: vec![cell] });
            }
        }
    }
    contests.retain(|c| c.cells.len() > 1);
    contests
}

/// The cells of a contest in the order of a quantity, as `A 1 < B 2`; `A 1 ≈ B 2` where what is known of
/// both, from the least to the most, overlaps.
fn order(cells: &[&Cell], unit: &str, of: impl Fn(&Cell) -> (f64, [f64; 2])) -> String {
    let mut sorted: Vec<_> = cells.iter().map(|c| (c.key.algorithm.short(), of(c))).collect();
    sorted.sort_by(|a, b| a.1.0.total_cmp(&b.1.0));
    let mut text = String::new();
    for (at, (name, (value, [low, _]))) in sorted.iter().enumerate() {
        if let Some((_, (_, [_, high]))) = at.checked_sub(1).and_then(|before| sorted.get(before)) {
            text += if low > high { " < " } else { " ≈ " };
        }
        text += &format!("{name} {}", short(*value));
    }
    format!("{text} {unit}")
}

/// The time of a cell, and its least and most of all repetitions.
fn time(cell: &Cell) -> (f64, [f64; 2]) {
    let ends = cell
        .repeats_ms
        .iter()
        .fold([f64::INFINITY, 0.0], |[low, high], ms| [ms.min(low), ms.max(high)]);
    (cell.ms, ends)
}

fn energy(cell: &Cell, of: impl Fn(&super::rows::Energy) -> f64) -> f64 {
    cell.energy.as_ref().map_or(f64::NAN, of)
}

fn ratio(cells: &[&Cell], of: impl Fn(&Cell) -> f64) -> f64 {
    let low = cells.iter().map(|c| of(c)).fold(f64::INFINITY, f64::min);
    cells.iter().map(|c| of(c)).fold(0.0, f64::max) / low
}

/// How the order of a contest agrees with that of the published devices, by energy per pixel.
fn agreement(contest: &Contest<'_>, of: impl Fn(&Cell) -> f64) -> String {
    let Ok(table) = published::table_1() else { return String::new() };
    let mut devices: Vec<&str> = table.iter().map(|c| c.device.as_str()).collect();
    devices.dedup();
    let mut parts = Vec::new();
    for device in devices {
        let pairs: Vec<(f64, f64)> = contest
            .cells
            .iter()
            .filter_map(|cell| {
                let name = cell.key.algorithm.short();
                let known = table.iter().find(|c| c.device == device && c.algorithm == name)?;
                Some((of(cell), known.energy))
            })
            .collect();
        let (ours, theirs): (Vec<f64>, Vec<f64>) = pairs.into_iter().unzip();
        if let Some(tau) = kendall_tau_b(&ours, &theirs) {
            parts.push(match tau {
                t if t > 0.999 => format!("{device} the same"),
                t if t < -0.999 => format!("{device} the reverse"),
                t => format!("{device} another (Kendall's τ {t:.2})"),
            });
        }
    }
    parts.join(", ")
}

fn characteristics(contests: &[Contest<'_>]) -> Vec<String> {
    let mut words = Vec::new();
    for contest in contests {
        let cells = &contest.cells;
        let is_measured = cells.iter().all(|c| c.energy.is_some());
        let mut text = format!("{}: by time {}", contest.title, order(cells, "ms", time));
        if is_measured {
            let watts = |c: &Cell| energy(c, |e| e.mean_w);
            let nj = |c: &Cell| energy(c, |e| e.nj_per_pixel);
            text += &format!(
                "; by power {} (by a factor of {:.2}); by energy {} (by a factor of {:.2}). By energy the \
                 order of the published devices is: {}.",
                order(cells, "W", |c| (watts(c), [watts(c); 2])),
                ratio(cells, watts),
                order(cells, "nJ/pixel", |c| {
                    let half = energy(c, |e| e.half_width);
                    let half = if half.is_finite() { half } else { 0.0 };
                    (nj(c), [nj(c) - half, nj(c) + half])
                }),
                ratio(cells, nj),
                agreement(contest, nj)
            );
        } else {
            text += &format!(
                " (by a factor of {:.2}). Published devices order energy: {}.",
                ratio(cells, |c| c.ms),
                agreement(contest, |c| c.ms)
            );
        }
        words.push(text);
    }
    words.push(match contests.is_empty() {
        true => NO_CONTEST.into(),
        false => "Where ≈ stands repetitions (of energies: intervals) overlap, and the order may be chance."
            .into(),
    });
    words
}

fn proportional(cells: &[&Cell], contests: &[Contest<'_>]) -> Vec<String> {
    if cells.is_empty() {
        return vec!["Only time was measured, and it cannot be compared with itself.".into()];
    }
    let joules: f64 = cells.iter().map(|c| energy(c, |e| e.joules_per_frame)).sum();
    let seconds: f64 = cells.iter().map(|c| 1e-3 * energy(c, |e| e.ms)).sum();
    let overall = joules / seconds;
    let watts = |c: &Cell| energy(c, |e| e.mean_w);
    let off = cells.iter().map(|c| (watts(c) / overall - 1.0).abs()).fold(0.0, f64::max);
    let low = cells.iter().min_by(|a, b| watts(a).total_cmp(&watts(b)));
    let high = cells.iter().max_by(|a, b| watts(a).total_cmp(&watts(b)));
    let verdict = if off <= PROPORTIONAL { "Yes" } else { "No" };
    let mut words = vec![format!(
        "{verdict}: if it were, power would be the same for all. It is {overall:.1} W over all {} cells, and \
         single cells are off by up to {:.1} % (up to {:.0} % counts as proportional).",
        cells.len(),
        100.0 * off,
        100.0 * PROPORTIONAL
    )];
    if let (Some(low), Some(high)) = (low, high) {
        let name = |c: &Cell| format!("{} {} {}", c.key.scene, c.key.size(), c.key.name());
        words.push(format!(
            "The least power is drawn by {} ({:.1} W), the most by {} ({:.1} W).",
            name(low),
            watts(low),
            name(high),
            watts(high)
        ));
    }
    let (mut pairs, mut against) = (0, Vec::new());
    for contest in contests {
        for (i, a) in contest.cells.iter().enumerate() {
            for b in &contest.cells[i + 1..] {
                if a.energy.is_none() || b.energy.is_none() {
                    continue;
                }
                pairs += 1;
                let (fast, slow) = if a.ms <= b.ms { (a, b) } else { (b, a) };
                if cheaper(slow, fast) == Some(Ordering::Less) {
                    let (fast, slow) = (fast.key.algorithm, slow.key.algorithm);
                    against.push(format!("{fast} before {slow} ({})", contest.title));
                }
            }
        }
    }
    words.push(match against.len() {
        _ if pairs == 0 => NO_CONTEST.into(),
        0 => format!(
            "The order by energy is that by time: in none of {pairs} pairs of algorithms for the same \
             problem does the faster one take more energy by more than both intervals."
        ),
        n => format!(
            "The order by energy is not that by time: in {n} of {pairs} pairs the faster takes more \
             energy: {}.",
            against.join(", ")
        ),
    });
    words
}

/// How the energy of two cells compares, if they differ by more than their intervals.
fn cheaper(a: &Cell, b: &Cell) -> Option<Ordering> {
    let (a, b) = (a.energy.as_ref()?, b.energy.as_ref()?);
    let within = |x: f64| if x.is_finite() { x } else { 0.0 };
    let apart = (a.nj_per_pixel - b.nj_per_pixel).abs();
    (apart > within(a.half_width) + within(b.half_width))
        .then(|| a.nj_per_pixel.total_cmp(&b.nj_per_pixel))
}

/// The 5th and the 95th of a hundred, and the deviation relative to the mean.
fn swing(values: impl Iterator<Item = f64>) -> Option<(f64, f64, f64)> {
    let mut all: Vec<f64> = values.filter(|x| x.is_finite()).collect();
    if all.len() < 2 {
        return None;
    }
    all.sort_by(f64::total_cmp);
    #[expect(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place in it")]
    let at = |share: f64| all[((all.len() - 1) as f64 * share).round() as usize];
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let square = all.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (all.len() - 1) as f64;
    Some((at(0.05), at(0.95), square.sqrt() / mean))
}

fn along(cells: &[Cell]) -> Vec<String> {
    let mut words = Vec::new();
    let mut changes: Vec<(f64, f64)> = Vec::new();
    for cell in cells {
        let Some((low, high, time)) = swing(cell.path_ms.iter().copied()) else { continue };
        let mut text = format!(
            "{} {} {}: frames take {} to {} ms along the path (deviation {:.0} %)",
            cell.key.scene,
            cell.key.size(),
            cell.key.name(),
            short(low),
            short(high),
            100.0 * time
        );
        if let Some(energy) = &cell.energy
            && let Some((low, high, power)) = swing(energy.path_w.iter().map(|p| p.1))
        {
            changes.push((time, power));
            text += &format!(
                "; {} draw {low:.1} to {high:.1} W (deviation {:.1} %), with {} changes of the power \
                 state and {} frames that take longer than those around them",
                if energy.by_frame { "they" } else { "windows of many" },
                100.0 * power,
                energy.states,
                energy.spikes
            );
        }
        words.push(text + ".");
    }
    if !changes.is_empty() {
        let time = median(changes.iter().map(|c| c.0).collect());
        let power = median(changes.iter().map(|c| c.1).collect());
        let which = if power < 0.5 * time {
            "less than half as much as time"
        } else if power > 2.0 * time {
            "more than twice as much as time"
        } else {
            "about as much as time"
        };
        words.insert(
            0,
            format!(
                "Power varies {which}: by {:.1} % along the path against {:.1} % (medians of the \
                 deviations of {} cells).",
                100.0 * power,
                100.0 * time,
                changes.len()
            ),
        );
    }
    words
}

fn inside(cells: &[Cell]) -> Vec<String> {
    let mut words = Vec::new();
    for cell in cells {
        let name = format!("{} {} {}", cell.key.scene, cell.key.size(), cell.key.name());
        let total: f64 = cell.passes.iter().map(|p| p.ms).sum();
        let mut text = match cell.passes.iter().max_by(|a, b| a.ms.total_cmp(&b.ms)) {
            Some(most) if total > 0.0 => format!(
                "{name}: {:.0} % of the time on the GPU is in {} ({} of {} ms), and {:.0} % of the frame's \
                 time is on the GPU",
                100.0 * most.ms / total,
                most.name.replace('_', " "),
                short(most.ms),
                short(total),
                100.0 * total / cell.ms
            ),
            _ => format!("{name}: the device does not time its passes"),
        };
        if let Some(energy) = &cell.energy {
            let shown: Vec<f64> =
                energy.signature_w.iter().copied().filter(|w| w.is_finite()).collect();
            text += &if shown.is_empty() {
                format!(
                    "; power within a frame is not known, there are too few readings: {}",
                    energy.sensor
                )
            } else {
                let low = shown.iter().copied().fold(f64::INFINITY, f64::min);
                let high = shown.iter().copied().fold(0.0, f64::max);
                format!(
                    "; power goes from {low:.1} to {high:.1} W within the average frame, which idles for \
                     {} ms before its work is done and {} ms after",
                    short(energy.idle_inside_ms),
                    short(energy.idle_between_ms)
                )
            };
        }
        words.push(text + ".");
    }
    words
}

fn worth_it(contests: &[Contest<'_>]) -> Vec<String> {
    let mut words = Vec::new();
    let (mut judged, mut differ) = (0, 0);
    for contest in contests {
        let cells = &contest.cells;
        let Some(fastest) = cells.iter().min_by(|a, b| a.ms.total_cmp(&b.ms)) else { continue };
        let name = |c: &Cell| c.key.algorithm.short();
        if !cells.iter().all(|c| c.energy.is_some()) {
            words.push(format!(
                "{}: {} is the fastest; the slowest takes {:.2} times as long.",
                contest.title,
                name(fastest),
                ratio(cells, |c| c.ms)
            ));
            continue;
        }
        let nj = |c: &Cell| energy(c, |e| e.nj_per_pixel);
        let Some(least) = cells.iter().min_by(|a, b| nj(a).total_cmp(&nj(b))) else { continue };
        let saved = 1.0 - 1.0 / ratio(cells, nj);
        judged += 1;
        let other = cheaper(least, fastest) == Some(Ordering::Less);
        differ += usize::from(other);
        words.push(format!(
            "{}: choosing {} saves {:.0} % of the energy of the most expensive; {}.",
            contest.title,
            name(least),
            100.0 * saved,
            if other {
                format!(
                    "the fastest, {}, would take {:.1} % more",
                    name(fastest),
                    100.0 * (nj(fastest) / nj(least) - 1.0)
                )
            } else if name(least) == name(fastest) {
                "it is the fastest, too".into()
            } else {
                format!("the fastest, {}, takes as much within the intervals", name(fastest))
            }
        ));
    }
    if judged > 0 {
        words.insert(
            0,
            if differ > 0 {
                format!(
                    "Yes, as far as this device goes: in {differ} of {judged} problems the fastest algorithm \
                     is not the one that takes the least energy."
                )
            } else {
                format!(
                    "On this device it would not differ from optimising time: in all {judged} problems the \
                     fastest algorithm is among those that take the least energy."
                )
            },
        );
    }
    if contests.is_empty() {
        words.push(NO_CONTEST.into());
    }
    let shadows = |a: Algorithm| a.has_shadows();
    if contests.iter().any(|c| shadows(c.cells[0].key.algorithm)) {
        words.push(
            "SV, SM and VSM do not give the same picture; what their errors are, \
             cargo xtask accuracy --suite shadows measures."
                .into(),
        );
    }
    words
}
