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
        Self { kernel: Kernel::best(), mode: Mode::default() }
    }

    /// `avx512` in the default mode, which is the watertight one; `avx512_fast`.
    pub(crate) fn name(self) -> String {
        if self.mode == Mode::default() {
            self.kernel.name().to_owned()
        } else {
            format!("{}_{}", self.kernel, self.mode)
        }
    }

    /// The kernels that a list names, each once: names, and `watertight` or `fast` for the
    /// processor's best in that mode. The best in the default mode without a name.
    pub(crate) fn select(names: &[String]) -> Result<Vec<Self>> {
        let mut kernels = Vec::new();
        for name in names {
            let kernel = match Mode::ALL.into_iter().find(|mode| mode.name() == name) {
                Some(mode) => Self { kernel: Kernel::best(), mode },
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
        let all = || {
            let of = |mode| Kernel::ALL.into_iter().map(move |kernel| Self { kernel, mode });
            Mode::ALL.into_iter().flat_map(of)
        };
        match all().find(|kernel| kernel.name() == name) {
            Some(found) if found.kernel.is_available() => Ok(found),
            Some(_) => bail!("this processor lacks the instructions of the kernel {name}"),
            None => {
                let known: Vec<_> = all().map(Self::name).collect();
                bail!("`{name}` is no kernel; known are fast, watertight, {}", known.join(", "))
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
        assert_eq!(TraceKernel::available().len(), 2 * Kernel::available().len());
        let error = TraceKernel::select(&["avx".into()]).unwrap_err().to_string();
        assert!(error.contains("`avx`") && error.contains("avx2_fast"), "{error}");
    }
}
