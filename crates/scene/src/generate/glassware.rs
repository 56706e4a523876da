//! Glasses, bottles and what is in them: closed surfaces with walls of their real thickness, in
//! metres, so that light refracts on the way in and on the way out.

use super::{
    lathe::{Point, Profile, turned},
    piece::{Plan, ROUND, capped_len, caps},
};
use glam::DVec3;

/// A turned thing for the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vessel {
    WineGlass,
    /// What is in a wine glass: a little less than fits, as light that passes two surfaces at one
    /// place has no order.
    Wine,
    Tumbler,
    Bottle,
    Carafe,
    /// What is in a carafe.
    Water,
    Plate,
}

/// How far what is in a vessel keeps from its wall.
const GAP: f64 = 0.0004;

impl Vessel {
    #[cfg(test)]
    pub(super) const ALL: [Self; 7] = [
        Self::WineGlass,
        Self::Wine,
        Self::Tumbler,
        Self::Bottle,
        Self::Carafe,
        Self::Water,
        Self::Plate,
    ];

    /// Triangles in proportion to those of the others.
    pub(super) const fn weight(self) -> f64 {
        match self {
            Self::WineGlass | Self::Bottle => 1.0,
            Self::Carafe => 1.3,
            Self::Wine | Self::Water | Self::Plate => 0.4,
            Self::Tumbler => 0.6,
        }
    }

    /// The inside of a vessel from the rim down to the axis.
    fn inside(self) -> &'static [Point] {
        match self {
            Self::WineGlass | Self::Wine => &[
                (0.0312, 0.2080, 0.0),
                (0.0368, 0.1800, 0.0),
                (0.0416, 0.1420, 0.0),
                (0.0386, 0.1130, 0.0),
                (0.0210, 0.0985, 0.0),
                (0.0070, 0.0960, 0.0),
                (0.0, 0.0960, 0.0),
            ],
            Self::Carafe | Self::Water => &[
                (0.0405, 0.2580, 0.0),
                (0.0280, 0.2250, 0.0),
                (0.0230, 0.1900, 0.0),
                (0.0300, 0.1550, 0.0),
                (0.0600, 0.1000, 0.0),
                (0.0670, 0.0450, 0.0),
                (0.0600, 0.0100, 0.008),
                (0.0, 0.0090, 0.0),
            ],
            Self::Tumbler => &[
                (0.0358, 0.0960, 0.0),
                (0.0335, 0.0300, 0.0),
                (0.0318, 0.0130, 0.006),
                (0.0, 0.0110, 0.0),
            ],
            Self::Bottle => &[
                (0.0100, 0.3000, 0.0),
                (0.0100, 0.2250, 0.0),
                (0.0130, 0.2050, 0.0),
                (0.0338, 0.1750, 0.0),
                (0.0338, 0.0060, 0.004),
                (0.0200, 0.0140, 0.0),
                (0.0, 0.0240, 0.0),
            ],
            Self::Plate => &[],
        }
    }

    /// From the foot up to the rim, outside.
    fn outside(self) -> &'static [Point] {
        match self {
            Self::WineGlass => &[
                (0.0, 0.0, 0.0),
                (0.0345, 0.0, 0.0008),
                (0.0345, 0.0022, 0.0008),
                (0.0150, 0.0050, 0.0),
                (0.0050, 0.0100, 0.0),
                (0.0036, 0.0300, 0.0),
                (0.0036, 0.0720, 0.0),
                (0.0060, 0.0900, 0.0),
                (0.0225, 0.0955, 0.0),
                (0.0402, 0.1115, 0.0),
                (0.0432, 0.1420, 0.0),
                (0.0382, 0.1800, 0.0),
                (0.0326, 0.2080, 0.0),
                (0.0322, 0.2100, 0.0),
                (0.0314, 0.2100, 0.0),
            ],
            Self::Carafe => &[
                (0.0, 0.0, 0.0),
                (0.0560, 0.0, 0.004),
                (0.0690, 0.0080, 0.0),
                (0.0700, 0.0450, 0.0),
                (0.0628, 0.1010, 0.0),
                (0.0330, 0.1560, 0.0),
                (0.0258, 0.1900, 0.0),
                (0.0306, 0.2250, 0.0),
                (0.0430, 0.2570, 0.0),
                (0.0430, 0.2600, 0.0),
                (0.0412, 0.2604, 0.0),
            ],
            Self::Tumbler => &[
                (0.0, 0.0, 0.0),
                (0.0320, 0.0, 0.003),
                (0.0350, 0.0120, 0.0),
                (0.0378, 0.0960, 0.0),
                (0.0376, 0.0980, 0.0),
                (0.0362, 0.0980, 0.0),
            ],
            Self::Bottle => &[
                (0.0, 0.0180, 0.0),
                (0.0200, 0.0090, 0.0),
                (0.0290, 0.0, 0.002),
                (0.0368, 0.0, 0.004),
                (0.0368, 0.1780, 0.0),
                (0.0165, 0.2080, 0.0),
                (0.0132, 0.2260, 0.0),
                (0.0130, 0.2880, 0.001),
                (0.0152, 0.2890, 0.001),
                (0.0152, 0.3012, 0.0),
                (0.0145, 0.3030, 0.0),
                (0.0105, 0.3030, 0.0),
            ],
            Self::Plate => &[
                (0.0, 0.0, 0.0),
                (0.0750, 0.0, 0.003),
                (0.0800, 0.0050, 0.0),
                (0.1300, 0.0170, 0.0),
                (0.1320, 0.0185, 0.0),
                (0.1310, 0.0200, 0.0),
                (0.0850, 0.0090, 0.0),
                (0.0750, 0.0050, 0.0),
                (0.0, 0.0045, 0.0),
            ],
            Self::Wine | Self::Water => &[],
        }
    }

    fn profile(self) -> Profile {
        let level = match self {
            Self::Wine => 0.142,
            Self::Water => 0.13,
            _ => {
                let points: Vec<Point> = [self.outside(), self.inside()].concat();
                return Profile::new(&points);
            }
        };
        // The vessel's inside from below, drawn in by the gap, up to the level.
        let wall: Vec<Point> = self.inside().iter().rev().copied().collect();
        let wall = Profile::new(&wall);
        const STEPS: u32 = 64;
        let at = |i: u32| wall.at(f64::from(i) / f64::from(STEPS));
        let mut points = vec![(0.0, at(0).y + GAP, 0.0)];
        for i in 1..STEPS {
            let along = (at(i + 1) - at(i - 1)).normalize_or_zero();
            let p = at(i) + along.perp() * GAP;
            if p.y > level {
                break;
            }
            points.push((p.x, p.y, 0.0));
        }
        let rim = points[points.len() - 1].0;
        points.extend([(rim, level, 0.0), (0.0, level, 0.0)]);
        Profile::new(&points)
    }

    /// Adds a vessel of about `share` triangles that stands at `foot`, enlarged by `scale`;
    /// returns how many it has.
    pub(super) fn build(
        self,
        plan: &mut Plan,
        share: usize,
        material: u32,
        foot: DVec3,
        scale: f64,
    ) -> usize {
        let size = caps(share, 0.7, [8, 12]);
        let profile = self.profile();
        plan.crease = Some(ROUND);
        plan.piece(material, move || profile.lathe(size, &|p, u| foot + turned(p, u) * scale));
        capped_len(size)
    }
}

/// Triangles of the smallest vessel that shows what it is.
pub(super) const FEWEST: usize = 2 * 8 * 11;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Camera, Environment, Material};
    use glam::Vec3;

    fn made(vessel: Vessel) -> crate::Scene {
        let camera = Camera::look_at(Vec3::ZERO, Vec3::X, Vec3::Y, 1.0);
        let mut plan = Plan::new(vec![Material::default()], camera, Environment::DAYLIGHT);
        let made = vessel.build(&mut plan, 6000, 0, DVec3::ZERO, 1.0);
        let scene = plan.into_scene("vessel");
        assert_eq!(scene.mesh.len(), made);
        scene
    }

    #[test]
    fn vessels_are_closed_with_thin_walls() {
        for vessel in Vessel::ALL {
            let scene = made(vessel);
            let mut edges = std::collections::HashMap::new();
            for t in scene.mesh.indices() {
                for k in 0..3 {
                    *edges.entry((t[k], t[(k + 1) % 3])).or_insert(0) += 1;
                }
            }
            let closed = edges.iter().all(|(&(a, b), &n)| n == 1 && edges.get(&(b, a)) == Some(&1));
            assert!(closed, "{vessel:?}");
            let volume: f64 = scene
                .mesh
                .triangles()
                .map(|t| {
                    let [a, b, c] = t.vertices().map(|v| v.as_dvec3());
                    a.dot(b.cross(c)) / 6.0
                })
                .sum();
            // A bottle has about a quarter of a litre of glass; a carafe holds more than one of
            // water.
            let most = if vessel == Vessel::Water { 1.6e-3 } else { 4e-4 };
            assert!(volume > 1e-6 && volume < most, "{vessel:?}: {volume} m³");
        }
    }

    /// At every height what is in a vessel is narrower than the vessel's inside.
    #[test]
    fn what_is_in_a_vessel_does_not_touch_it() {
        for (vessel, content) in
            [(Vessel::WineGlass, Vessel::Wine), (Vessel::Carafe, Vessel::Water)]
        {
            let (outer, inner) = (vessel.profile(), content.profile());
            let samples = |p: &Profile| -> Vec<glam::DVec2> {
                (0..=4000).map(|i| p.at(f64::from(i) / 4000.0)).collect()
            };
            let (glass, wine) = (samples(&outer), samples(&inner));
            let nearest = wine
                .iter()
                .flat_map(|w| glass.iter().map(move |g| w.distance(*g)))
                .fold(f64::INFINITY, f64::min);
            assert!(nearest > 0.5 * GAP, "{content:?}: {nearest}");
        }
    }
}
