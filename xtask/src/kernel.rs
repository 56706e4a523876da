//! Our traversal kernels by name.

use anyhow::{Result, bail};
use niwaki_trace::{Kernel, Mode};

/// A kernel in a mode, over nodes of full precision or quantised ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TraceKernel {
    pub(crate) kernel: Kernel,
    pub(crate) mode: Mode,
    pub(crate) quantised: bool,
}

/// What selects, and is in the names of, kernels over quantised nodes.
const QUANTISED: &str = "quantised";

impl TraceKernel {
    /// All that this processor can run, by mode and nodes, slowest first.
    pub(crate) fn available() -> Vec<Self> {
        Self::all().into_iter().filter(|kernel| kernel.kernel.is_available()).collect()
    }

    fn all() -> Vec<Self> {
        let mut all = Vec::new();
        for mode in Mode::ALL {
            for quantised in [false, true] {
                all.extend(Kernel::ALL.map(|kernel| Self { kernel, mode, quantised }));
            }
        }
        all
    }

    /// The fastest, in a mode, with nodes of full precision.
    fn best_in(mode: Mode) -> Self {
        Self { kernel: Kernel::best(), mode, quantised: false }
    }

    /// The fastest.
    pub(crate) fn best() -> Self {
        Self::best_in(Mode::default())
    }

    /// `avx512` in the default mode, which is the watertight one; `avx512_quantised`;
    /// `avx512_fast`; `avx512_quantised_fast`.
    pub(crate) fn name(self) -> String {
        let nodes = if self.quantised { format!("_{QUANTISED}") } else { String::new() };
        let mode =
            if self.mode == Mode::default() { String::new() } else { format!("_{}", self.mode) };
        format!("{}{nodes}{mode}", self.kernel)
    }

    /// The kernels that a list names, each once: names, `watertight` or `fast` for the
    /// processor's best in that mode, and `quantised` for its best over quantised nodes. The best
    /// in the default mode without a name.
    pub(crate) fn select(names: &[String]) -> Result<Vec<Self>> {
        let mut kernels = Vec::new();
        for name in names {
            let kernel = match Mode::ALL.into_iter().find(|mode| mode.name() == name) {
                Some(mode) => Self::best_in(mode),
                None if name == QUANTISED => Self { quantised: true, ..Self::best() },
                None => Self::named(name)?,
            };
            if !kernels.contains(&kernel) {
                kernels.push(kernel);
            }
        }
        if kernels.is_empty() {
            kernels.push(Self::best());
        }
        Ok(kernels)
    }

    fn named(name: &str) -> Result<Self> {
        match Self::all().into_iter().find(|kernel| kernel.name() == name) {
            Some(found) if found.kernel.is_available() => Ok(found),
            Some(_) => bail!("this processor lacks the instructions of the kernel {name}"),
            None => {
                let known: Vec<_> = Self::all().into_iter().map(Self::name).collect();
                bail!(
                    "`{name}` is no kernel; known are fast, watertight, {QUANTISED}, {}",
                    known.join(", ")
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(list: &[&str]) -> Vec<String> {
        let list: Vec<_> = list.iter().map(ToString::to_string).collect();
        TraceKernel::select(&list).unwrap().into_iter().map(TraceKernel::name).collect()
    }

    #[test]
    fn names_select() {
        let best = Kernel::best().name();
        assert_eq!(names(&[]), [best]);
        assert_eq!(names(&["scalar_fast", "scalar", "scalar"]), ["scalar_fast", "scalar"]);
        assert_eq!(names(&["watertight", "fast"]), [best.to_owned(), format!("{best}_fast")]);
        assert_eq!(names(&["quantised"]), [format!("{best}_quantised")]);
        assert_eq!(names(&["scalar_quantised_fast"]), ["scalar_quantised_fast"]);
        assert_eq!(TraceKernel::available().len(), 4 * Kernel::available().len());
        let error = TraceKernel::select(&["avx".into()]).unwrap_err().to_string();
        assert!(error.contains("`avx`") && error.contains("avx2_fast"), "{error}");
    }
}
