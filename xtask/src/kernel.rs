//! Our traversal kernels by name.

use anyhow::{Result, bail};
use niwaki_trace::{Kernel, Mode};

/// A kernel in a mode.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TraceKernel {
    pub(crate) kernel: Kernel,
    pub(crate) mode: Mode,
}

impl TraceKernel {
    /// All that this processor can run, by mode, slowest first.
    pub(crate) fn available() -> Vec<Self> {
        let of = |mode| Kernel::available().into_iter().map(move |kernel| Self { kernel, mode });
        Mode::ALL.into_iter().flat_map(of).collect()
    }

    /// The fastest.
    pub(crate) fn best() -> Self {
        Self { kernel: Kernel::best(), mode: Mode::Fast }
    }

    /// `avx512`, `avx512_watertight`.
    pub(crate) fn name(self) -> String {
        match self.mode {
            Mode::Fast => self.kernel.name().to_owned(),
            mode => format!("{}_{mode}", self.kernel),
        }
    }

    /// The kernels that a list names, each once: names, and `watertight` for the fastest such.
    /// The fastest of all without a name.
    pub(crate) fn select(names: &[String]) -> Result<Vec<Self>> {
        let mut kernels = Vec::new();
        for name in names {
            let kernel = if name == Mode::Watertight.name() {
                Self { kernel: Kernel::best(), mode: Mode::Watertight }
            } else {
                Self::named(name)?
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
        let all = || {
            let of = |mode| Kernel::ALL.into_iter().map(move |kernel| Self { kernel, mode });
            Mode::ALL.into_iter().flat_map(of)
        };
        match all().find(|kernel| kernel.name() == name) {
            Some(found) if found.kernel.is_available() => Ok(found),
            Some(_) => bail!("this processor lacks the instructions of the kernel {name}"),
            None => {
                let known: Vec<_> = all().map(Self::name).collect();
                bail!("`{name}` is no kernel; known are watertight, {}", known.join(", "))
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
        assert_eq!(names(&["scalar_watertight", "scalar", "scalar"]), [
            "scalar_watertight",
            "scalar"
        ]);
        assert_eq!(names(&["watertight"]), [format!("{best}_watertight")]);
        assert_eq!(TraceKernel::available().len(), 2 * Kernel::available().len());
        let error = TraceKernel::select(&["avx".into()]).unwrap_err().to_string();
        assert!(error.contains("`avx`") && error.contains("avx2_watertight"), "{error}");
    }
}
