//! `cargo xtask trace`: answers rays from a file.

mod args;
mod output;

pub(crate) use args::TraceArgs;

use crate::{
    bench::{pool, progress::Progress, timing::median},
    machine,
    registry::{self, TreeBuilder},
    results::Source,
    scenes::SceneSpec,
};
use anyhow::{Context, Result, bail, ensure};
use args::Mode;
use clap::ValueEnum as _;
use niwaki_core::{Bvh, Hit, Intersector, Ray, TriangleMesh};
use niwaki_peers::{Embree, EmbreeSettings};
use niwaki_trace::{Batches, BinaryScene, BruteForce, Kernel, WideScene};
use niwaki_wide::{CollapseSettings, WideBvh};
use output::OutputFormat;
use std::{process::ExitCode, time::Instant};

/// Triangles of procedural scenes that are named without a number, as in `bench`.
const TRIANGLES: usize = 100_000;

/// Rays between two steps of the progress bar.
const STEP: usize = 1 << 16;

/// Seconds that are measured at least: passes are repeated until then.
const SECONDS: f64 = 0.3;

/// Runs the command.
pub(crate) fn run(args: &TraceArgs) -> Result<ExitCode> {
    // What is wrong with the arguments is said before anything takes time.
    let format = OutputFormat::of(&args.out)?;
    let choice = Choice::of(args)?;
    let builder = registry::one("--builder", &args.builder)?;
    let spec = SceneSpec::parse(&args.scene, TRIANGLES)?;
    let rays = niwaki_ray_file::load(&args.rays)
        .with_context(|| format!("cannot read rays from {}", args.rays.display()))?;
    let threads = args.threads.map_or_else(machine::cores, usize::from);
    let pool = pool(threads)?;
    let progress = Progress::new(3 + rays.len().div_ceil(STEP));
    progress.message(&format!("load {}", spec.describe()));
    let mesh = pool.install(|| spec.load(args.seed))?.mesh;
    progress.step();

    progress.message(&format!("build {}", builder.full_name()));
    let embree = match builder.source() {
        Source::Embree => {
            Some(Embree::with_settings(&EmbreeSettings { threads, ..EmbreeSettings::default() })?)
        }
        _ => None,
    };
    let scene = pool.install(|| choice.scene(&mesh, &builder, embree.as_ref()))?;
    progress.step();
    let mut hits = vec![Hit::MISS; rays.len()];
    let seconds = pool.install(|| answer(&*scene.scene, &rays, &mut hits, &progress))?;
    progress.message("write");
    format.save(&args.out, &hits)?;
    progress.finish();

    let count = hits.iter().filter(|hit| hit.is_hit()).count();
    println!("scene     {}, {} triangles", spec.describe(), mesh.len());
    println!("tree      {}", scene.tree);
    let mode = args.mode.to_possible_value();
    let mode = mode.as_ref().map_or("", |mode| mode.get_name());
    println!("kernel    {}, {mode}", choice.describe());
    println!("rays      {}: {count} hits, {} misses", rays.len(), rays.len() - count);
    let rate = rays.len() as f64 / median(&seconds) / 1e6;
    let passes = if seconds.len() == 1 { "one pass" } else { "median of several passes" };
    println!("speed     {rate:.3} million rays/s on {threads} threads ({passes})");
    println!("hits      {}", args.out.display());
    Ok(ExitCode::SUCCESS)
}

/// Which kernel answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Choice {
    /// Every triangle for every ray.
    Brute(Mode),
    /// Over the binary tree.
    Binary(Mode),
    Wide {
        width: usize,
        kernel: Kernel,
        mode: Mode,
    },
}

/// What answers, and what to say about its tree.
struct Traced<'a> {
    scene: Box<dyn Intersector + Send + 'a>,
    tree: String,
}

impl Choice {
    /// Checked against this processor.
    fn of(args: &TraceArgs) -> Result<Self> {
        let mode = args.mode;
        if let Some(width) = args.width {
            ensure!(matches!(width, 4 | 8 | 16), "--width {width} must be 4, 8 or 16");
        }
        let kernel = match args.kernel.as_deref() {
            Some("brute") => return Ok(Self::Brute(mode)),
            Some("binary") => return Ok(Self::Binary(mode)),
            Some(name) => named(name)?,
            // The fastest that traces the width.
            None => args.width.map_or_else(Kernel::best, |width| {
                let mut traced = Kernel::available();
                traced.retain(|kernel| kernel.traces(width.into()));
                traced.pop().unwrap_or(Kernel::Scalar)
            }),
        };
        let width = args.width.map_or(kernel.best_width(), usize::from);
        ensure!(
            kernel.traces(width),
            "the kernel {kernel} does not trace trees of {width} children a node"
        );
        Ok(Self::Wide { width, kernel, mode })
    }

    fn describe(self) -> String {
        match self {
            Self::Brute(_) => "brute force".into(),
            Self::Binary(_) => "binary".into(),
            Self::Wide { width, kernel, .. } => format!("{kernel}, {width} wide"),
        }
    }

    /// The tree, and the scene over it. The one place that knows what each mode is made of.
    fn scene<'a>(
        self,
        mesh: &'a TriangleMesh,
        builder: &TreeBuilder,
        embree: Option<&Embree>,
    ) -> Result<Traced<'a>> {
        if let Self::Brute(mode) = self {
            let scene = Box::new(BruteForce::new(mode.of_scene(), mesh));
            return Ok(Traced { scene, tree: "none".into() });
        }
        let tree = builder
            .build(mesh, embree)
            .with_context(|| format!("{} failed", builder.full_name()))?;
        let bvh = &tree.bvh;
        let scene: Box<dyn Intersector + Send> = match self {
            Self::Brute(mode) | Self::Binary(mode) => {
                Box::new(BinaryScene::new_in(mode.of_scene(), bvh, mesh)?)
            }
            Self::Wide { width: 4, kernel, mode } => wide::<4>(bvh, mesh, kernel, mode)?,
            Self::Wide { width: 16, kernel, mode } => wide::<16>(bvh, mesh, kernel, mode)?,
            Self::Wide { kernel, mode, .. } => wide::<8>(bvh, mesh, kernel, mode)?,
        };
        let (time, references) = (tree.time.as_secs_f64() * 1e3, bvh.prim_ids.len());
        let tree = format!("{} in {time:.1} ms, {references} references", builder.full_name());
        Ok(Traced { scene, tree })
    }
}

fn wide<const W: usize>(
    bvh: &Bvh,
    mesh: &TriangleMesh,
    kernel: Kernel,
    mode: Mode,
) -> Result<Box<dyn Intersector + Send>>
where
    WideScene<W>: Intersector + 'static,
{
    let wide = WideBvh::<W>::collapse(bvh, &CollapseSettings::default())?;
    let scene = WideScene::build_in(mode.of_scene(), wide, mesh)?;
    Ok(Box::new(scene.with_kernel(kernel)?))
}

/// The kernel of a name, if this processor can run it.
fn named(name: &str) -> Result<Kernel> {
    let Some(kernel) = Kernel::ALL.into_iter().find(|kernel| kernel.name() == name) else {
        let known = Kernel::ALL.map(Kernel::name).join(", ");
        bail!("`{name}` is no kernel; known are {known}, binary and brute");
    };
    ensure!(kernel.is_available(), "this processor lacks the instructions of the kernel {name}");
    Ok(kernel)
}

/// Answers all rays, on all threads of the pool. Returns the seconds of each pass: one, or as many
/// as make a time that can be measured.
fn answer(
    scene: &dyn Intersector,
    rays: &[Ray],
    hits: &mut [Hit],
    progress: &Progress,
) -> Result<Vec<f64>> {
    progress.message(&format!("trace {} rays", rays.len()));
    let mut times = Vec::new();
    let mut spent = 0.0;
    while spent < SECONDS {
        let start = Instant::now();
        for (rays, hits) in rays.chunks(STEP).zip(hits.chunks_mut(STEP)) {
            scene.par_closest_hits(rays, hits)?;
            if times.is_empty() {
                progress.step();
            }
        }
        let time = start.elapsed().as_secs_f64();
        times.push(time);
        spent += time;
        if rays.is_empty() {
            break;
        }
    }
    Ok(times)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::{Cli, Command};
    use clap::Parser;
    use std::path::PathBuf;

    fn args(arguments: &[&str]) -> TraceArgs {
        let cli = Cli::try_parse_from([&["xtask", "trace"], arguments].concat()).unwrap();
        let Command::Trace(args) = cli.command else { panic!("not a trace") };
        *args
    }

    fn folder(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("niwaki-trace-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        path
    }

    const RAYS: &str =
        "ox,oy,oz,dx,dy,dz\n3.3,2.7,1000,0,0,-1\n1,2,1000,0.01,0,-1\n0,0,1000,0,0,1\n";

    #[test]
    fn every_kernel_and_width_answers_as_brute_force_does() {
        let folder = folder("kernels");
        let rays = folder.join("rays.csv");
        std::fs::write(&rays, RAYS).unwrap();
        let trace = |more: &[&str]| {
            let out = folder.join("hits.csv");
            let mut all = vec!["--scene", "city:1000", "--builder", "binned", "--threads", "2"];
            let (rays, hits) = (rays.display().to_string(), out.display().to_string());
            all.extend(["--rays", &rays, "--out", &hits]);
            all.extend(more);
            run(&args(&all)).unwrap();
            std::fs::read_to_string(out).unwrap()
        };
        let expected = trace(&["--kernel", "brute"]);
        let lines: Vec<_> = expected.lines().collect();
        assert_eq!(lines.len(), 4, "{expected}");
        assert!(!lines[1].ends_with("-1") && lines[3] == "inf,0.0,0.0,-1", "{expected}");
        assert_eq!(trace(&["--kernel", "binary"]), expected);
        assert_eq!(trace(&[]), expected);
        for kernel in Kernel::available() {
            assert_eq!(trace(&["--kernel", kernel.name()]), expected, "{kernel}");
        }
        for width in ["4", "8", "16"] {
            assert_eq!(trace(&["--width", width]), expected, "{width} wide");
            assert_eq!(trace(&["--width", width, "--kernel", "scalar"]), expected, "{width} wide");
        }
        std::fs::remove_dir_all(folder).unwrap();
    }

    #[test]
    fn wrong_arguments_are_named_before_anything_is_built() {
        let folder = folder("faults");
        let rays = folder.join("rays.csv");
        std::fs::write(&rays, RAYS).unwrap();
        let rays = rays.display().to_string();
        let refused = |more: &[&str]| {
            let rays = if more.contains(&"--rays") { &[][..] } else { &["--rays", rays.as_str()] };
            let all = [&["--scene", "city:1000"], rays, more].concat();
            format!("{:#}", run(&args(&all)).unwrap_err())
        };
        let error = refused(&["--out", "hits.txt"]);
        assert!(error.contains(".csv or .npy"), "{error}");
        let error = refused(&["--out", "h.csv", "--kernel", "sse9"]);
        assert!(error.contains("sse9") && error.contains("brute"), "{error}");
        let error = refused(&["--out", "h.csv", "--width", "5"]);
        assert!(error.contains("--width 5"), "{error}");
        let error = refused(&["--out", "h.csv", "--builder", "embree"]);
        assert!(error.contains("takes one"), "{error}");
        let error = refused(&["--out", "h.csv", "--builder", "bonzai"]);
        assert!(error.contains("bonzai"), "{error}");
        let error = refused(&["--out", "h.csv", "--rays", "no/such.csv"]);
        assert!(error.contains("no/such.csv"), "{error}");
        std::fs::remove_dir_all(folder).unwrap();
    }
}
