//! Nine chess boards with 288 lacquered and metal figures and nine mirror balls, all in motion:
//! the hardest case for reflections that are approximated, after the chess scene of Ganestam and
//! Doggett 2015, §4.

mod figure;

use super::{
    math::{circle, sin_cos_turns},
    piece::{Budget, EDGES, Patch, Plan, ROUND, capped, capped_len, caps},
    random::Random,
};
use crate::{
    Camera, CameraKey, CameraPath, Environment, Hop, Light, LightKind, Material, Motion, Rigid,
};
use figure::{FEWEST, Figure, Stand, upright};
use glam::{DVec3, Vec3};
use niwaki_core::to_u32;

const FLOOR: u32 = 0;
const FRAME: u32 = 1;
/// Light squares; dark ones are the next.
const SQUARE: u32 = 2;
const WHITE: u32 = 4;
const BLACK: u32 = 5;
const MIRROR: u32 = 6;

/// From board to board; a board is 8 squares of 1 with a frame of 0.35 around.
const PITCH: f64 = 11.5;
/// Height of a board's squares over the floor.
const TOP: f64 = 0.6;
const BALL: f64 = 0.85;

/// Triangles of a board: a box and 64 squares of two.
const BOARD: usize = 12 + 128;

fn materials() -> Vec<Material> {
    let lacquer =
        |name, ior, color| Material { roughness: 0.0, ior, ..Material::matte(name, color) };
    vec![
        lacquer("polished stone", 1.5, Vec3::new(0.30, 0.33, 0.38)),
        lacquer("lacquered frame", 1.6, Vec3::new(0.16, 0.06, 0.03)),
        lacquer("light squares", 1.8, Vec3::new(0.72, 0.62, 0.45)),
        lacquer("dark squares", 1.8, Vec3::new(0.07, 0.045, 0.035)),
        lacquer("ivory", 2.0, Vec3::new(0.78, 0.72, 0.58)),
        Material::metal("gunmetal", Vec3::new(0.42, 0.40, 0.44), 0.0),
        Material::metal("mirror", Vec3::splat(0.95), 0.0),
    ]
}

pub(super) fn plan(triangles: usize, seed: u64) -> Plan {
    let camera =
        Camera::look_at(Vec3::new(-9.5, 6.5, 15.5), Vec3::new(-1.0, 0.8, 0.5), Vec3::Y, 0.8);
    let mut plan = Plan::new(materials(), camera, Environment::DAYLIGHT);
    plan.path = Some(path());
    plan.lights.push(Light {
        kind: LightKind::Directional,
        position: Vec3::ZERO,
        direction: Vec3::new(0.45, -0.75, -0.4).normalize(),
        intensity: Vec3::splat(2.6),
    });
    // Small requests get fewer boards, and fewer figures, rather than figures of no shape.
    let per_board = BOARD + 40 + 32 * FEWEST;
    let boards = (triangles / per_board).clamp(1, 9);
    let room = triangles.saturating_sub(2 + boards * (BOARD + 40)) / boards;
    let figures = (room / FEWEST).clamp(1, 32);
    plan.crease = Some(EDGES);
    plan.object("floor", Motion::default());
    plan.piece(FLOOR, || {
        let mut patch = Patch::default();
        let s = 60.0;
        patch.quad([[-s, s], [s, s], [s, -s], [-s, -s]].map(|[x, z]| DVec3::new(x, 0.0, z)));
        patch
    });
    let mut budget = Budget::new(triangles.saturating_sub(2), boards as f64);
    // From the middle outward, so that few boards stand where the camera looks.
    const ORDER: [[i8; 2]; 9] =
        [[0, 0], [-1, 0], [0, 1], [1, 0], [0, -1], [-1, 1], [1, 1], [1, -1], [-1, -1]];
    for (k, place) in ORDER.iter().take(boards).enumerate() {
        let [i, j] = place.map(f64::from);
        let share = budget.share(1.0);
        let mut random = Random::new(seed, 50 + k as u64);
        let center = DVec3::new(i * PITCH, TOP, j * PITCH);
        budget.spend(board(&mut plan, share, figures, center, &mut random));
    }
    plan
}

/// The motion of what stands on a board: the board's own sway, and jumps.
fn motion(sway: &Hop, hop: Option<(DVec3, &mut Random)>, height: f64) -> Motion {
    let mut out = *sway;
    if let Some((foot, random)) = hop {
        out.pivot = foot.as_vec3();
        out.jump = (DVec3::Y * height).as_vec3();
        out.period = narrow(random.range(2.4, 6.0));
        out.phase = narrow(random.unit());
        out.airborne = narrow(random.range(0.6, 1.0)) / out.period;
        out.turns = [-1.0, 0.0, 1.0][random.below(3)];
    }
    Motion { rigid: Rigid::Hop(out), ..Motion::default() }
}

#[expect(clippy::cast_possible_truncation, reason = "motion in f32 is enough")]
const fn narrow(x: f64) -> f32 {
    x as f32
}

/// A board with its ball and figures; returns how many triangles these are.
fn board(
    plan: &mut Plan,
    share: usize,
    figures: usize,
    center: DVec3,
    random: &mut Random,
) -> usize {
    let sway = Hop {
        sway: Vec3::new(0.0, 0.12, 0.0),
        sway_period: narrow(random.range(3.0, 5.0)),
        sway_phase: narrow(random.unit()),
        ..Hop::default()
    };
    let axes = upright(0.25 * random.below(4) as f64 + random.range(-0.02, 0.02));
    plan.crease = Some(EDGES);
    plan.object("board", motion(&sway, None, 0.0));
    plan.piece(FRAME, move || {
        let mut patch = Patch::default();
        patch.cuboid(center - DVec3::Y * 0.18, DVec3::new(4.35, 0.175, 4.35), axes);
        patch
    });
    for color in 0..2 {
        plan.piece(SQUARE + color, move || {
            let mut patch = Patch::default();
            for n in (0..64).filter(|n| to_u32(n / 8 + n % 8) % 2 == color) {
                let (x, z) = ((n % 8) as f64 - 4.0, (n / 8) as f64 - 4.0);
                let corners = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
                patch.quad(corners.map(|[a, b]| center + axes * DVec3::new(x + a, 0.0, z + b)));
            }
            patch
        });
    }
    let placed = place(random);
    let chosen = &placed[..figures.min(placed.len())];
    let weight: f64 = chosen.iter().map(|(f, ..)| f.weight()).sum();
    let mut parts = Budget::new(share.saturating_sub(BOARD), weight + 1.2);
    let size = caps(parts.share(1.2), 2.0, [6, 4]);
    plan.crease = Some(ROUND);
    let middle = center + DVec3::Y * BALL;
    plan.object("mirror ball", motion(&sway, Some((middle, random)), 0.7));
    plan.piece(MIRROR, move || {
        capped(size, &|u, v| {
            let (sin, cos) = sin_cos_turns(0.5 * v);
            middle + (circle(-u) * sin.max(0.0) - DVec3::Y * cos) * BALL
        })
    });
    parts.spend(capped_len(size));
    for &(figure, square, black) in chosen {
        let share = parts.share(figure.weight());
        let (x, z) = ((square % 8) as f64 - 3.5, (square / 8) as f64 - 3.5);
        let jitter = DVec3::new(random.range(-0.05, 0.05), 0.0, random.range(-0.05, 0.05));
        let foot = center + axes * (DVec3::new(x, 0.0, z) + jitter);
        // Each side faces the other.
        let forward = axes * if black { DVec3::NEG_Z } else { DVec3::Z };
        let facing = turns_towards(forward) + random.range(-0.04, 0.04);
        let height = if figure == Figure::Knight { 0.9 } else { random.range(0.25, 0.6) };
        let name = format!("{} {figure:?}", if black { "black" } else { "white" }).to_lowercase();
        plan.object(&name, motion(&sway, Some((foot, random)), height));
        let material = if black { BLACK } else { WHITE };
        parts.spend(figure.build(plan, share, material, Stand { foot, facing }));
    }
    share.saturating_sub(BOARD) - parts.left() + BOARD
}

/// The turns around Y that take +X to a horizontal unit direction, to a thousandth: by halving,
/// as the arc tangent of the system's library differs between platforms.
fn turns_towards(direction: DVec3) -> f64 {
    let (mut low, mut high) = (0.0, 0.5);
    for _ in 0..12 {
        let middle = 0.5 * (low + high);
        // The cosine falls from 1 to −1 over half a turn.
        if sin_cos_turns(middle).1 > direction.x { low = middle } else { high = middle }
    }
    if direction.z <= 0.0 { low } else { -low }
}

/// A position in the middle of a game: figure, square and colour, officers first. The four squares
/// in the middle are the ball's.
fn place(random: &mut Random) -> Vec<(Figure, usize, bool)> {
    use Figure::{Bishop, King, Knight, Pawn, Queen, Rook};
    const OFFICERS: [Figure; 8] = [Rook, Knight, Bishop, Queen, King, Bishop, Knight, Rook];
    // Few figures should be of all kinds: king, queen, knight, ... of both colours first.
    const ORDER: [usize; 8] = [4, 3, 1, 2, 0, 6, 5, 7];
    let mut taken = [false; 64];
    for square in [27, 28, 35, 36] {
        taken[square] = true;
    }
    let mut out = Vec::with_capacity(32);
    let mut put = |figure, home: usize, black: bool| {
        let home = if black { 63 - home } else { home };
        let mut square = home;
        if random.unit() < 0.45 {
            let elsewhere = 16 + random.below(32);
            if !taken[elsewhere] {
                square = elsewhere;
            }
        }
        if taken[square] {
            square = (0..64).map(|k| (home + k) % 64).find(|&s| !taken[s]).unwrap_or(home);
        }
        taken[square] = true;
        out.push((figure, square, black));
    };
    for file in ORDER {
        put(OFFICERS[file], file, false);
        // Mirrored, so that kings face each other.
        put(OFFICERS[file], 7 - file, true);
    }
    for file in 0..8 {
        put(Pawn, 8 + file, false);
        put(Pawn, 8 + file, true);
    }
    out
}

/// Down from above into the lane between two rows of boards, through it, and round the middle
/// board.
fn path() -> CameraPath {
    let lane = narrow(0.5 * PITCH);
    let key = |x: f32, y: f32, z: f32, tx: f32, ty: f32, tz: f32| CameraKey {
        position: Vec3::new(x, y, z),
        target: Vec3::new(tx, ty, tz),
        vertical_fov: 0.8,
    };
    CameraPath::new(
        vec![
            key(-9.5, 6.5, 15.5, -1.0, 0.8, 0.5),
            key(-7.5, 4.4, 12.0, -1.0, 1.0, 1.0),
            key(-lane - 0.3, 2.9, 8.8, -1.5, 1.1, 1.0),
            key(-lane, 2.2, 5.6, -1.0, 1.2, 0.5),
            key(-lane, 1.9, 2.4, -1.0, 1.2, -1.5),
            key(-lane, 1.8, -0.8, -2.0, 1.3, -6.5),
            key(-lane, 2.0, -3.6, 0.0, 1.2, -8.0),
            key(-lane + 0.8, 2.4, -5.2, 3.0, 1.2, -7.0),
            key(-lane + 3.2, 2.7, -lane, 6.0, 1.2, -3.0),
            key(0.0, 2.8, -lane, 5.0, 1.2, 0.0),
            key(3.2, 3.2, -lane, 2.0, 1.0, 1.5),
        ],
        false,
    )
}
