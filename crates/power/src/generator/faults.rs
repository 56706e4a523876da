//! Faults, and where they are.

use crate::Fault;
use fastrand::Rng;

/// How many faults of each class a recording has. They are spread over it and never touch.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FaultPlan {
    /// Gaps of one to ten rows.
    pub gaps: usize,
    /// Holes of 400 to 2000 rows.
    pub holes: usize,
    /// Rows that come twice.
    pub duplicates: usize,
    /// Pairs of rows that are swapped.
    pub swaps: usize,
    /// Rows whose time alone is wrong, by a second.
    pub strays: usize,
    /// Steps of the meter's clock, a quarter of a second back.
    pub clock_steps: usize,
    /// Runs of one to five samples of a column that are not numbers.
    pub not_numbers: usize,
    /// Stretches of 40 rows in which a current exceeds its sensor's range.
    pub clipped: usize,
    /// Marks that are missing.
    pub lost_marks: usize,
    /// Marks where no frame starts.
    pub false_marks: usize,
}

impl FaultPlan {
    /// So many of each class.
    #[must_use]
    pub const fn of_each(count: usize) -> Self {
        Self {
            gaps: count,
            holes: count,
            duplicates: count,
            swaps: count,
            strays: count,
            clock_steps: count,
            not_numbers: count,
            clipped: count,
            lost_marks: count,
            false_marks: count,
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Rows that are left out.
    Gap(u64),
    Hole(u64),
    Duplicate,
    Swap,
    Stray,
    ClockStep,
    NotANumber(u64),
    Clipped,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct PlannedFault {
    pub(super) row: u64,
    pub(super) kind: Kind,
}

/// Rows of a stretch of clipped samples.
pub(super) const CLIPPED_ROWS: u64 = 40;

/// Spreads faults over the rows.
pub(super) fn plan(plan: &FaultPlan, rows: u64, random: &mut Rng) -> Vec<PlannedFault> {
    let mut kinds = Vec::new();
    let mut add = |count: usize, make: &mut dyn FnMut() -> Kind| {
        (0..count).for_each(|_| kinds.push(make()));
    };
    add(plan.gaps, &mut || Kind::Gap(random.u64(1..=10)));
    add(plan.holes, &mut || Kind::Hole(random.u64(400..=2000)));
    add(plan.duplicates, &mut || Kind::Duplicate);
    add(plan.swaps, &mut || Kind::Swap);
    add(plan.strays, &mut || Kind::Stray);
    add(plan.clock_steps, &mut || Kind::ClockStep);
    add(plan.not_numbers, &mut || Kind::NotANumber(random.u64(1..=5)));
    add(plan.clipped, &mut || Kind::Clipped);
    random.shuffle(&mut kinds);
    let share = rows / (kinds.len() as u64 + 1);
    let mut faults: Vec<_> = (1..)
        .zip(kinds)
        .map(|(place, kind)| PlannedFault { row: place * share + random.u64(0..=share / 4), kind })
        .collect();
    // Too short a recording has no room for its faults.
    if share < 4000 {
        faults.truncate(usize::try_from(rows / 16_000).unwrap_or(usize::MAX));
    }
    faults
}

/// Faults by class.
pub(super) fn count(faults: &[PlannedFault]) -> [u64; 7] {
    let mut counts = [0; 7];
    for fault in faults {
        let (class, count) = match fault.kind {
            Kind::Gap(_) => (Fault::Gap, 1),
            Kind::Hole(_) => (Fault::Hole, 1),
            Kind::Duplicate => (Fault::Duplicate, 1),
            Kind::Swap | Kind::Stray => (Fault::OutOfOrder, 1),
            Kind::ClockStep => (Fault::ClockStep, 1),
            Kind::NotANumber(rows) => (Fault::NotANumber, rows),
            Kind::Clipped => (Fault::Clipped, 1),
        };
        counts[class as usize] += count;
    }
    counts
}

/// Leaves marks out and puts false ones in; returns how many.
pub(super) fn spoil_marks(
    plan: &FaultPlan,
    marks: &mut Vec<(f64, u8)>,
    end_ns: f64,
    random: &mut Rng,
) -> (u64, u64) {
    if marks.is_empty() {
        return (0, 0);
    }
    let lost = plan.lost_marks.min(marks.len() / 2);
    for _ in 0..lost {
        marks.remove(random.usize(..marks.len()));
    }
    for _ in 0..plan.false_marks {
        marks.push((random.f64() * end_ns, b'X'));
    }
    marks.sort_by(|a, b| a.0.total_cmp(&b.0));
    (lost as u64, plan.false_marks as u64)
}
