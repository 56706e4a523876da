//! The command line of `cargo xtask render`.

use clap::{Args, ValueEnum};
use niwaki_core::glam::Vec3;
use niwaki_scene::Environment;
use std::{fmt, path::PathBuf, str::FromStr};

const EXAMPLES: &str = "\
Examples:
  cargo xtask render --scene gallery --mode whitted
      One picture of a procedural scene, with mirrors and glass.
  cargo xtask render --scene model.glb --mode path --samples 256 --size 1920x1080 --format exr
      Your own scene, path traced, as linear radiance.
  cargo xtask render --scene chess:200k --mode hybrid --frames 20 --explain
      Twenty frames along the scene's camera path on the GPU, each with what it calls for and why.
  cargo xtask render --scene gallery --mode hybrid --debug-view hits
      Where reflected rays ended: in the traced region (blue), in the cube map (red), in the sky.
  cargo xtask-window render --scene gallery --mode hybrid --window
      The same to walk through.

hybrid and full-bvh need a Vulkan device; ci/setup-vulkan.sh installs a software one on Debian.
NIWAKI_VULKAN_DEVICE chooses one of several, by a part of its name or by its number.

Output (in --out): a picture a frame; frames.json with the time that each part of each frame took
(on the GPU, for hybrid and full-bvh) and the rays that it traced; of several frames, frames.svg,
a plot of these times.";

/// Arguments of `cargo xtask render`.
#[derive(Args, Clone, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct RenderArgs {
    /// A file, or the name of a procedural scene with an optional number of triangles (city:200k)
    #[arg(long, value_name = "FILE|NAME[:TRIANGLES]")]
    pub(crate) scene: String,

    /// How light is simulated
    #[arg(long, value_enum, default_value = "whitted")]
    pub(crate) mode: Mode,

    /// Frames along the scene's camera path; 1 is its first camera, standing still
    #[arg(long, value_name = "NUMBER", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub(crate) frames: u32,

    /// Width and height of the pictures in pixels
    #[arg(long, value_name = "WIDTHxHEIGHT", default_value = "960x540")]
    pub(crate) size: Size,

    /// Paths a pixel, for --mode path
    #[arg(long, value_name = "NUMBER", default_value_t = 64)]
    pub(crate) samples: u32,

    /// Rays a pixel in each direction, for --mode whitted: 2 smooths edges with four
    #[arg(long, value_name = "NUMBER", default_value_t = 1,
          value_parser = clap::value_parser!(u32).range(1..=64))]
    pub(crate) grid: u32,

    /// Most bounces [default: 8, and what the preset says for hybrid and full-bvh, at most 16]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u32).range(0..=1000))]
    pub(crate) depth: Option<u32>,

    /// How finely hybrid and full-bvh render
    #[arg(long, value_enum, default_value = "default")]
    pub(crate) preset: Preset,

    /// Half the side of the cube around the camera in which hybrid traces rays, as a share of the
    /// longest side of the scene [default: the preset's]
    #[arg(long, value_name = "SHARE")]
    pub(crate) region: Option<f32>,

    /// Rays from each surface that look for what holds ambient light back, at most 1024, for hybrid,
    /// full-bvh and whitted
    #[arg(long, value_name = "NUMBER", default_value_t = 0,
          value_parser = clap::value_parser!(u32).range(0..=1024))]
    pub(crate) occlusion: u32,

    /// How far these rays look, as a share of the diagonal of the scene
    #[arg(long, value_name = "SHARE", default_value_t = 0.1)]
    pub(crate) occlusion_radius: f32,

    /// Light from all around, instead of what the scene says: daylight, dark, or a radiance such as 0.5
    #[arg(long, value_name = "SKY")]
    pub(crate) sky: Option<Sky>,

    /// Which animation of a glTF file moves the scene, from 0
    #[arg(long, value_name = "NUMBER", default_value_t = 0)]
    pub(crate) animation: usize,

    /// What pictures of hybrid and full-bvh show
    #[arg(long, value_enum, default_value = "image")]
    pub(crate) debug_view: View,

    /// Print what the scene calls for, what is skipped, and why
    #[arg(long)]
    pub(crate) explain: bool,

    /// What pictures are saved as
    #[arg(long, value_enum, default_value = "png")]
    pub(crate) format: Format,

    /// Brightness of PNG files in stops, 0 for radiance as it is [default: middle grey]
    #[arg(long, value_name = "STOPS", allow_negative_numbers = true)]
    pub(crate) exposure: Option<f32>,

    /// Builder of the tree for whitted and path, as in bench
    #[arg(long, value_name = "NAME", default_value = "balanced")]
    pub(crate) builder: String,

    /// Number of threads [default: all that this process may use]
    #[arg(long, value_name = "NUMBER", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,

    /// Seed of procedural scenes and of paths
    #[arg(long, default_value_t = 1)]
    pub(crate) seed: u64,

    /// Show hybrid or full-bvh in a window, with a free camera and settings on keys; F1 lists them
    /// (say `cargo xtask-window render`)
    #[arg(long, conflicts_with_all = ["frames", "format", "explain"])]
    pub(crate) window: bool,

    /// Where pictures and results go
    #[arg(long, value_name = "DIR", default_value = "out/render")]
    pub(crate) out: PathBuf,
}

/// How light is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mode {
    /// On the GPU: rays in triangles near the camera, and in a cube map of depths and colours
    /// beyond (thesis, paper III)
    Hybrid,
    /// On the GPU: rays in triangles everywhere, what hybrid is compared with
    FullBvh,
    /// Mirrors, glass and hard shadows by recursive ray tracing on the CPU: the reference of the
    /// hybrid renderer (Whitted 1980)
    Whitted,
    /// All light paths on the CPU, with noise: the reference of everything
    Path,
}

impl Mode {
    /// As on the command line.
    pub(crate) fn name(self) -> String {
        self.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
    }
}

/// What surrounds the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Sky(pub(crate) Environment);

impl FromStr for Sky {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "daylight" => Ok(Self(Environment::DAYLIGHT)),
            "dark" => Ok(Self(Environment::DARK)),
            _ => text
                .parse()
                .ok()
                .filter(|radiance| (0.0..=1e6).contains(radiance))
                .map(|radiance| Self(Environment::Constant(Vec3::splat(radiance))))
                .ok_or_else(|| String::from("wanted is daylight, dark or a radiance, 0 to 1e6")),
        }
    }
}

/// How finely the hybrid renderer works; `docs/hybrid.md` says what each means.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Preset {
    /// A small traced region and small maps
    Fast,
    /// In between
    Default,
    /// A large traced region and large maps
    Fine,
    /// As the paper describes it
    Paper,
}

/// What a picture of the hybrid renderer shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum View {
    /// The rendering
    Image,
    /// Where the first ray of each pixel's surface ended: blue in the traced region, red in the
    /// cube map, green on its second layer, light blue in the sky, magenta behind a surface of the map
    Hits,
    /// Shading normals
    Normals,
    /// Pixels and cells of the map that marches looked at
    Steps,
    /// The share of ambient light that arrives at surfaces; see --occlusion
    Occlusion,
}

/// What pictures are saved as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Format {
    /// 8 bits, tone mapped
    Png,
    /// Linear radiance as 32-bit floats
    Exr,
}

/// Width and height in pixels, 1 to 16384 each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Size {
    pub(crate) width: u32,
    pub(crate) height: u32,
}

impl FromStr for Size {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let side = |text: &str| text.parse().ok().filter(|side| (1..=16_384).contains(side));
        text.split_once('x')
            .and_then(|(w, h)| Some(Self { width: side(w)?, height: side(h)? }))
            .ok_or_else(|| String::from("wanted is a size such as 1280x720, 1 to 16384 each"))
    }
}

impl fmt::Display for Size {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn skies_are_read_and_refused() {
        assert_eq!("daylight".parse(), Ok(Sky(Environment::DAYLIGHT)));
        assert_eq!("0".parse(), Ok(Sky(Environment::DARK)));
        assert_eq!("0.5".parse(), Ok(Sky(Environment::Constant(Vec3::splat(0.5)))));
        for text in ["", "night", "-1", "NaN", "inf", "1e7"] {
            assert!(text.parse::<Sky>().is_err(), "{text}");
        }
    }

    #[test]
    fn sizes_are_read_and_refused() {
        let size: Size = "1280x720".parse().unwrap();
        assert_eq!((size.width, size.height), (1280, 720));
        assert_eq!(size.to_string(), "1280x720");
        for text in ["", "x", "0x1", "1x0", "1280", "16385x1", "-1x1", "1x1x1"] {
            assert!(text.parse::<Size>().is_err(), "{text}");
        }
    }
}
