//! The header of a run: the computer, the compiler, the date and the revision.

use crate::results::{Machine, Run};
use std::process::Command;
use std::time::{SystemTime, UNIX_EPOCH};

/// A header with everything that does not depend on the arguments.
pub(crate) fn describe() -> Run {
    let flags = env!("NIWAKI_RUSTFLAGS");
    Run {
        machine: Machine {
            cpu: cpu_name(),
            cores: cores(),
            isa: isa(),
            os: format!("{} {}", std::env::consts::OS, std::env::consts::ARCH),
        },
        rustc: env!("NIWAKI_RUSTC").into(),
        flags: format!(
            "{} profile, opt-level {}, RUSTFLAGS {}",
            env!("NIWAKI_PROFILE"),
            env!("NIWAKI_OPT_LEVEL"),
            if flags.is_empty() { "none" } else { flags },
        ),
        date: utc(SystemTime::now()),
        revision: revision(),
        ..Run::default()
    }
}

/// Hardware threads that this process may use.
pub(crate) fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Memory that can be had without swapping, where the system tells.
pub(crate) fn available_memory() -> Option<usize> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    let kib: usize = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    kib.checked_mul(1024)
}

/// Time that processors have spent since the system started, in its ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Busy {
    /// Of all processors together: any, and idle.
    total: u64,
    idle: u64,
    /// Of this process.
    own: u64,
    processors: usize,
}

impl Busy {
    /// Until now; none where the system does not tell.
    pub(crate) fn now() -> Option<Self> {
        let all = std::fs::read_to_string("/proc/stat").ok()?;
        let own = std::fs::read_to_string("/proc/self/stat").ok()?;
        Self::parse(&all, &own)
    }

    fn parse(all: &str, own: &str) -> Option<Self> {
        let numbers = |line: &str| -> Option<Vec<u64>> {
            line.split_whitespace().map(|x| x.parse().ok()).collect()
        };
        // Guests are counted in user time already.
        let sums = numbers(all.lines().next()?.strip_prefix("cpu ")?)?;
        let sums = sums.get(..8)?;
        let is_processor = |line: &&str| line.starts_with("cpu") && !line.starts_with("cpu ");
        // Names of programs may hold spaces and parentheses.
        let (_, fields) = own.rsplit_once(')')?;
        let fields: Vec<_> = fields.split_whitespace().collect();
        let time = |at: usize| fields.get(at)?.parse::<u64>().ok();
        Some(Self {
            total: sums.iter().sum(),
            idle: sums[3] + sums[4],
            own: time(11)? + time(12)?,
            processors: all.lines().filter(is_processor).count(),
        })
    }

    /// How many processors others kept busy between this and a later time.
    pub(crate) fn others_until(&self, later: &Self) -> Option<f64> {
        let total = later.total.checked_sub(self.total).filter(|ticks| *ticks > 0)?;
        let idle = later.idle.saturating_sub(self.idle) + later.own.saturating_sub(self.own);
        Some(total.saturating_sub(idle) as f64 / total as f64 * self.processors as f64)
    }
}

fn cpu_name() -> String {
    let from_proc = || {
        let text = std::fs::read_to_string("/proc/cpuinfo").ok()?;
        let line = text.lines().find(|line| line.starts_with("model name"))?;
        Some(line.split_once(':')?.1.trim().to_owned())
    };
    let from_sysctl = || {
        let output =
            Command::new("sysctl").args(["-n", "machdep.cpu.brand_string"]).output().ok()?;
        let name = String::from_utf8(output.stdout).ok()?.trim().to_owned();
        (!name.is_empty()).then_some(name)
    };
    from_proc()
        .or_else(from_sysctl)
        .or_else(|| std::env::var("PROCESSOR_IDENTIFIER").ok())
        .unwrap_or_else(|| format!("unknown {}", std::env::consts::ARCH))
}

fn isa() -> Vec<String> {
    let mut found = Vec::new();
    #[cfg(target_arch = "x86_64")]
    {
        macro_rules! look_for {
            ($($feature:tt)*) => {
                $(if std::arch::is_x86_feature_detected!($feature) { found.push($feature.into()); })*
            };
        }
        look_for!("sse4.2" "avx" "avx2" "fma" "bmi2" "avx512f" "avx512vl" "avx512bw" "avx512dq");
    }
    #[cfg(target_arch = "aarch64")]
    if std::arch::is_aarch64_feature_detected!("neon") {
        found.push("neon".into());
    }
    found
}

fn revision() -> Option<String> {
    let git = |arguments: &[&str]| {
        let output = Command::new("git")
            .args(["-C", env!("CARGO_MANIFEST_DIR")])
            .args(arguments)
            .output()
            .ok()?;
        output.status.success().then(|| String::from_utf8_lossy(&output.stdout).trim().to_owned())
    };
    let mut revision = git(&["rev-parse", "--short=12", "HEAD"])?;
    if git(&["status", "--porcelain", "--untracked-files=no"]).is_some_and(|s| !s.is_empty()) {
        revision.push('+');
    }
    Some(revision)
}

/// ISO 8601 in UTC, to the second.
fn utc(time: SystemTime) -> String {
    let seconds = time.duration_since(UNIX_EPOCH).map_or(0, |d| d.as_secs());
    let (days, rest) = (seconds / 86_400, seconds % 86_400);
    // Civil date from a day number (H. Hinnant, "chrono-Compatible Low-Level Date Algorithms"):
    // years start in March, so that the leap day is the last of its year.
    let z = days + 719_468;
    let era = z / 146_097;
    let day_of_era = z % 146_097;
    let year_of_era =
        (day_of_era - day_of_era / 1460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let shifted_month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * shifted_month + 2) / 5 + 1;
    let month = if shifted_month < 10 { shifted_month + 3 } else { shifted_month - 9 };
    let year = year_of_era + era * 400 + u64::from(month <= 2);
    let (hour, minute, second) = (rest / 3600, rest / 60 % 60, rest % 60);
    format!("{year:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z")
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    #[test]
    fn dates_are_those_of_the_calendar() {
        let at = |seconds| utc(UNIX_EPOCH + Duration::from_secs(seconds));
        assert_eq!(at(0), "1970-01-01T00:00:00Z");
        assert_eq!(at(951_782_400), "2000-02-29T00:00:00Z");
        assert_eq!(at(1_234_567_890), "2009-02-13T23:31:30Z");
        assert_eq!(at(4_102_444_799), "2099-12-31T23:59:59Z");
    }

    #[test]
    fn work_of_others_is_what_is_neither_idle_nor_own() {
        let at = |user: u64, idle: u64, own: u64| {
            let all = format!("cpu  {user} 0 0 {idle} 0 0 0 0 0 0\ncpu0 1\ncpu1 1\nintr 5\n");
            Busy::parse(&all, &format!("7 (a b) c) S 1 1 1 0 -1 0 0 0 0 0 {own} 2 0 0")).unwrap()
        };
        // Of 200 ticks on two processors 60 were idle and 40 our own.
        let others = at(100, 50, 10).others_until(&at(240, 110, 50)).unwrap();
        assert!((others - 1.0).abs() < 1e-12, "{others}");
        assert_eq!(at(1, 1, 1).others_until(&at(1, 1, 1)), None);
        assert_eq!(Busy::parse("cpu", ""), None);
    }

    #[test]
    fn the_header_names_compiler_and_cores() {
        let run = describe();
        assert!(run.rustc.starts_with("rustc "), "{}", run.rustc);
        assert!(run.machine.cores >= 1 && !run.machine.cpu.is_empty());
    }
}
