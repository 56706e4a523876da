//! Settings of a ray tracer, and ladders of them: the thesis's and one past it.

use serde::{Deserialize, Serialize};

use crate::error::within;
use crate::{Error, Ladder};

/// What a frame of the ray tracer or of the hybrid renderer is asked to do (x in Ganestam and
/// Doggett's Fig. 1).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Unchecked", deny_unknown_fields)]
pub struct RenderSettings {
    /// Whether a ray goes to each light.
    pub shadows: bool,
    /// Rays of ambient occlusion for each pixel that shows a surface, 0 to 1,024.
    pub ao_rays: u16,
    /// Length of those rays as a share of the diagonal of the scene's bounds, 0 to 1.
    pub ao_radius: f64,
    /// Mirror and refraction bounces, 0 to 64.
    pub reflection_depth: u8,
    /// Rendered width and height over the shown ones, above 0 and up to 2.
    pub render_scale: f64,
    /// Radius of the region whose geometry is traced rather than marched, as a share of the
    /// diagonal of the scene's bounds, 0 to 1.
    pub near_region: f64,
}

/// The fields as they are read, before their ranges are checked.
#[derive(Deserialize)]
struct Unchecked {
    shadows: bool,
    ao_rays: u16,
    ao_radius: f64,
    reflection_depth: u8,
    render_scale: f64,
    near_region: f64,
}

impl TryFrom<Unchecked> for RenderSettings {
    type Error = Error;

    fn try_from(read: Unchecked) -> Result<Self, Error> {
        let Unchecked { shadows, ao_rays, ao_radius, reflection_depth, render_scale, near_region } =
            read;
        let settings =
            Self { shadows, ao_rays, ao_radius, reflection_depth, render_scale, near_region };
        settings.validate()?;
        Ok(settings)
    }
}

impl RenderSettings {
    /// Primary rays and Phong shading, nothing more: the lowest rung of the thesis.
    pub const PRIMARY: Self = Self {
        shadows: false,
        ao_rays: 0,
        ao_radius: 0.1,
        reflection_depth: 0,
        render_scale: 1.0,
        near_region: 0.0,
    };

    /// Fails at the first field that is outside its documented range.
    pub fn validate(&self) -> Result<(), Error> {
        within("ao_rays", f64::from(self.ao_rays), 0.0, 1024.0, "within 0 and 1,024")?;
        within("ao_radius", self.ao_radius, 0.0, 1.0, "within 0 and 1")?;
        within("reflection_depth", f64::from(self.reflection_depth), 0.0, 64.0, "within 0 and 64")?;
        within("render_scale", self.render_scale, 0.01, 2.0, "within 0.01 and 2")?;
        within("near_region", self.near_region, 0.0, 1.0, "within 0 and 1")
    }

    /// Pixels of a frame of this full width and height at the render scale, at least 1 each.
    #[must_use]
    pub fn scaled(&self, size: [u32; 2]) -> [u32; 2] {
        size.map(|pixels| {
            #[expect(
                clippy::cast_possible_truncation,
                clippy::cast_sign_loss,
                reason = "saturates; a number of pixels"
            )]
            let scaled = (f64::from(pixels) * self.render_scale).round() as u32;
            scaled.max(1)
        })
    }

    /// Whether every field asks for as much as `other`'s or more. Where this holds, quality and
    /// the work of any sane renderer are no lower.
    pub fn at_least(&self, other: &Self) -> bool {
        self.shadows >= other.shadows
            && self.ao_rays >= other.ao_rays
            && self.ao_radius >= other.ao_radius
            && self.reflection_depth >= other.reflection_depth
            && self.render_scale >= other.render_scale
            && self.near_region >= other.near_region
    }
}

impl Ladder<RenderSettings> {
    /// The thesis's scale: shading alone, then shadows, then 1, 2, .. `max_ao_rays` rays of ambient
    /// occlusion of one radius.
    ///
    /// Fails where the rays or the radius are out of range.
    pub fn ray_tracing(max_ao_rays: u16, ao_radius: f64) -> Result<Self, Error> {
        let primary = RenderSettings { ao_radius, ..RenderSettings::PRIMARY };
        let shadows = RenderSettings { shadows: true, ..primary };
        let mut rungs = vec![primary];
        rungs.extend((0..=max_ao_rays).map(|ao_rays| RenderSettings { ao_rays, ..shadows }));
        Self::chain(rungs)
    }

    /// Past the thesis, for the hybrid renderer: from half resolution without effects to full
    /// resolution with four bounces and 64 rays of ambient occlusion.
    ///
    /// What is missed most comes first: resolution (0.5 to 1 in tenths), shadows, a near region and
    /// in it four short rays of ambient occlusion (the hybrid renderer has none elsewhere), the first
    /// bounce, the region growing, 16 rays of a growing radius, the second bounce, 32 rays, bounces
    /// three and four, 64 rays.
    pub fn hybrid() -> Self {
        let mut s =
            RenderSettings { ao_radius: 0.025, render_scale: 0.5, ..RenderSettings::PRIMARY };
        let mut rungs = vec![s];
        let mut step = |change: &dyn Fn(&mut RenderSettings)| {
            change(&mut s);
            rungs.push(s);
        };
        for tenths in [6.0, 7.0, 8.0, 9.0, 10.0] {
            step(&|s| s.render_scale = tenths / 10.0);
        }
        step(&|s| s.shadows = true);
        step(&|s| s.near_region = 0.025);
        for ao_rays in 1..=4 {
            step(&|s| s.ao_rays = ao_rays);
        }
        step(&|s| s.reflection_depth = 1);
        for near in [0.05, 0.1, 0.2] {
            step(&|s| s.near_region = near);
        }
        for ao_rays in 5..=16 {
            step(&|s| s.ao_rays = ao_rays);
        }
        for radius in [0.035, 0.05, 0.07, 0.1] {
            step(&|s| s.ao_radius = radius);
        }
        step(&|s| s.reflection_depth = 2);
        for ao_rays in (18..=32).step_by(2) {
            step(&|s| s.ao_rays = ao_rays);
        }
        step(&|s| s.reflection_depth = 3);
        step(&|s| s.reflection_depth = 4);
        for ao_rays in (35..=62).step_by(3).chain([64]) {
            step(&|s| s.ao_rays = ao_rays);
        }
        Self { rungs }
    }

    /// A ladder in which every rung asks for at least as much as the one below in every field.
    /// On such a chain no sane cost law falls with the rung, and
    /// [`Search::Bisection`](crate::Search::Bisection) is right.
    ///
    /// Fails at a rung out of range or out of order.
    pub fn chain(rungs: Vec<RenderSettings>) -> Result<Self, Error> {
        for rung in &rungs {
            rung.validate()?;
        }
        match rungs.windows(2).position(|pair| !pair[1].at_least(&pair[0])) {
            Some(below) => Err(Error::Unordered { rung: below + 1 }),
            None => Self::new(rungs),
        }
    }
}
