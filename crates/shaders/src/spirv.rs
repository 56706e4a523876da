//! What is changed in the translator's SPIR-V.

use std::collections::HashSet;

const HEADER: usize = 5;
const OP_DECORATE: u16 = 71;
const OP_TYPE_ARRAY: u16 = 28;
const OP_TYPE_POINTER: u16 = 32;
const OP_CONSTANT_NULL: u16 = 46;
const OP_EXT_INST: u16 = 12;
const OP_VARIABLE: u16 = 59;
const FUNCTION_STORAGE: u32 = 7;
const NO_CONTRACTION: u32 = 42;
/// GLSL.std.450's fused multiply-add.
const FMA: u32 = 50;

/// Floating-point arithmetic that could be fused or rearranged: FNegate, FAdd, FSub, FMul, FDiv,
/// FRem, FMod, and products of vectors and matrices.
const ARITHMETIC: [u16; 14] =
    [127, 129, 131, 133, 136, 140, 141, 142, 143, 144, 145, 146, 147, 148];

/// An instruction: where it begins, its opcode and its words, the first of which is opcode and
/// count.
struct Instruction<'a> {
    at: usize,
    opcode: u16,
    words: &'a [u32],
}

fn instructions(words: &[u32]) -> impl Iterator<Item = Instruction<'_>> {
    let mut at = HEADER;
    std::iter::from_fn(move || {
        let first = *words.get(at)?;
        let count = (first >> 16) as usize;
        let instruction = words.get(at..at + count.max(1))?;
        let found = Instruction { at, opcode: (first & 0xffff) as u16, words: instruction };
        at += count.max(1);
        Some(found)
    })
}

/// Marks arithmetic as exact if asked to, and leaves out the zeros that the translator puts into
/// every array of a function: a traversal stack would be cleared for each ray.
pub(crate) fn finish(words: Vec<u32>, exact: bool) -> Vec<u32> {
    let mut arrays = HashSet::new();
    let mut array_pointers = HashSet::new();
    let mut nulls = HashSet::new();
    let mut marks = Vec::new();
    // Decorations come before types; one that is there anyway, or else the first type, says where.
    let mut place = None;
    for Instruction { at, opcode, words } in instructions(&words) {
        match (opcode, words) {
            (OP_DECORATE, _) => place = Some(at),
            (OP_TYPE_ARRAY, &[_, result, ..]) => {
                arrays.insert(result);
            }
            (OP_TYPE_POINTER, &[_, result, FUNCTION_STORAGE, to]) if arrays.contains(&to) => {
                array_pointers.insert(result);
            }
            (OP_CONSTANT_NULL, &[_, _, result]) => {
                nulls.insert(result);
            }
            (OP_EXT_INST, &[_, _, result, _, FMA, ..]) => marks.push(result),
            (opcode, &[_, _, result, ..]) if ARITHMETIC.contains(&opcode) => marks.push(result),
            _ => {}
        }
        // OpTypeVoid to OpTypeForwardPointer.
        if place.is_none() && (19..=39).contains(&opcode) {
            place = Some(at);
        }
    }
    let mut finished = words[..HEADER.min(words.len())].to_vec();
    for Instruction { at, opcode, words } in instructions(&words) {
        if exact && Some(at) == place {
            for &mark in &marks {
                finished.extend([3 << 16 | u32::from(OP_DECORATE), mark, NO_CONTRACTION]);
            }
        }
        match (opcode, words) {
            (OP_VARIABLE, &[_, kind, result, storage, initial])
                if array_pointers.contains(&kind) && nulls.contains(&initial) =>
            {
                finished.extend([4 << 16 | u32::from(OP_VARIABLE), kind, result, storage]);
            }
            _ => finished.extend(words),
        }
    }
    finished
}
