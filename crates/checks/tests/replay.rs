//! Every fuzz target on its seeds, and on mutations of them: what a fuzzer does, without coverage
//! to guide it, in seconds. `NIWAKI_MUTATIONS=100` makes a hundred times as many, others each time.

use fastrand::Rng;
use niwaki_checks::fuzz::{self, Target};

/// Changes a few bytes, cuts, repeats, or puts a part of another seed in.
fn mutate(input: &mut Vec<u8>, other: &[u8], rng: &mut Rng) {
    let place = |len: usize, rng: &mut Rng| rng.usize(..=len);
    match rng.u8(..8) {
        0 => input.truncate(place(input.len(), rng)),
        1 => {
            let (from, to) = (place(input.len(), rng), place(input.len(), rng));
            let copied = input[from.min(to)..from.max(to)].to_vec();
            let at = place(input.len(), rng);
            input.splice(at..at, copied);
        }
        2 => {
            let (from, to) = (place(other.len(), rng), place(other.len(), rng));
            let at = place(input.len(), rng);
            let end = place(input.len(), rng).max(at);
            input.splice(at..end, other[from.min(to)..from.max(to)].iter().copied());
        }
        3 => {
            let at = place(input.len(), rng);
            input.splice(at..at, std::iter::repeat_with(|| rng.u8(..)).take(4));
        }
        _ => {
            for _ in 0..rng.usize(1..4) {
                if let Some(byte) = (!input.is_empty()).then(|| rng.usize(..input.len())) {
                    input[byte] =
                        if rng.bool() { rng.u8(..) } else { input[byte] ^ 1 << rng.u8(..8) };
                }
            }
        }
    }
    input.truncate(1 << 12);
}

fn replay(target: Target, mutations: usize) {
    let seeds = target.seeds();
    let check = |input: &[u8]| {
        // Said by the panic message alone if it fails.
        let result = std::panic::catch_unwind(|| target.check(input));
        assert!(result.is_ok(), "{} fails for {input:?}", target.name);
    };
    seeds.iter().for_each(|seed| check(seed));
    // The usual ones are the same in every run.
    let factor = std::env::var("NIWAKI_MUTATIONS").ok().and_then(|text| text.parse::<usize>().ok());
    let seed = if factor.is_some() { u64::from(std::process::id()) } else { 7 };
    let mut rng = Rng::with_seed(seed);
    for _ in 0..mutations * factor.unwrap_or(1) {
        let mut input = seeds[rng.usize(..seeds.len())].clone();
        for _ in 0..rng.usize(1..5) {
            mutate(&mut input, &seeds[rng.usize(..seeds.len())], &mut rng);
        }
        check(&input);
    }
}

#[test]
fn obj() {
    replay(fuzz::OBJ, 2000);
}

#[test]
fn gltf() {
    replay(fuzz::GLTF, 2000);
}

#[test]
fn tree_file() {
    replay(fuzz::TREE_FILE, 2000);
}

#[test]
fn forged_tree() {
    replay(fuzz::FORGED_TREE, 5000);
}

#[test]
fn ray_file() {
    replay(fuzz::RAY_FILE, 20_000);
}

#[test]
fn builders() {
    replay(fuzz::BUILDERS, 300);
}

#[test]
fn kernels() {
    replay(fuzz::KERNELS, 1000);
}

#[test]
fn batches() {
    replay(fuzz::BATCHES, 500);
}

#[test]
fn targets_have_names_of_their_own() {
    let mut names = fuzz::ALL.map(|target| target.name);
    names.sort_unstable();
    assert!(names.windows(2).all(|pair| pair[0] != pair[1]), "{names:?}");
    assert!(fuzz::ALL.iter().all(|t| Target::by_name(t.name).is_some()));
}
