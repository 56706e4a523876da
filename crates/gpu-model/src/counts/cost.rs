//! What an instruction costs.

use super::{
    BufferAccess, CountError, InstructionMix, LoopCounts,
    module::{Declared, id},
};
use rspirv::{
    dr::{Instruction, Operand},
    spirv::{GlslStd450Op, Op, StorageClass},
};
use std::collections::HashMap;

/// Bytes of the widest load.
const WIDEST: u64 = 16;

/// Values of a function: their types and, for pointers, what they lead to.
pub(super) struct Values<'a> {
    pub(super) declared: &'a Declared<'a>,
    pub(super) types: HashMap<u32, u32>,
    /// The variable that a pointer leads into, and whether an index on the way is known at run time
    /// only.
    pub(super) roots: HashMap<u32, (u32, bool)>,
}

impl Values<'_> {
    fn ty(&self, value: u32) -> u32 {
        self.types.get(&value).or_else(|| self.declared.globals.get(&value)).copied().unwrap_or(0)
    }

    /// Remembers a result.
    pub(super) fn note(&mut self, one: &Instruction) {
        let (Some(result), Some(ty)) = (one.result_id, one.result_type) else { return };
        self.types.insert(result, ty);
        match one.class.opcode {
            Op::Variable | Op::FunctionParameter => {
                self.roots.insert(result, (result, false));
            }
            Op::AccessChain | Op::InBoundsAccessChain => {
                let base = id(one.operands.first());
                let (root, was_dynamic) = self.roots.get(&base).copied().unwrap_or((base, false));
                let indices = &one.operands[1.min(one.operands.len())..];
                let is_known =
                    |index: &Operand| self.declared.is_constant.contains(&id(Some(index)));
                let is_dynamic = was_dynamic || !indices.iter().all(is_known);
                self.roots.insert(result, (root, is_dynamic));
            }
            _ => {}
        }
    }

    /// Adds what an instruction costs. Calls cost nothing by themselves.
    pub(super) fn charge(&self, one: &Instruction, to: &mut LoopCounts) -> Result<(), CountError> {
        let own = one.result_type.map_or(1, |ty| self.declared.components(ty));
        let of_operand = || {
            let ty = self.ty(id(one.operands.first()));
            self.declared.components(ty)
        };
        let opcode = one.class.opcode;
        let compute = match opcode {
            Op::Load => {
                let bytes = one.result_type.map_or(0, |ty| self.declared.bytes(ty));
                self.access(id(one.operands.first()), bytes, false, to);
                0
            }
            Op::Store => {
                let pointer = id(one.operands.first());
                let pointee = self.declared.pointee(self.ty(pointer));
                let bytes = pointee.map_or(0, |(_, ty)| self.declared.bytes(ty));
                self.access(pointer, bytes, true, to);
                0
            }
            Op::CopyMemory => {
                let pair = [id(one.operands.get(1)), id(one.operands.first())];
                for (pointer, is_store) in pair.into_iter().zip([false, true]) {
                    let pointee = self.declared.pointee(self.ty(pointer));
                    let bytes = pointee.map_or(0, |(_, ty)| self.declared.bytes(ty));
                    self.access(pointer, bytes, is_store, to);
                }
                0
            }
            Op::ControlBarrier => {
                to.own.barriers += 1;
                0
            }
            // Names and moves of values; structure.
            Op::Nop
            | Op::Undef
            | Op::Variable
            | Op::Label
            | Op::Phi
            | Op::Line
            | Op::NoLine
            | Op::LoopMerge
            | Op::SelectionMerge
            | Op::Branch
            | Op::Return
            | Op::ReturnValue
            | Op::Unreachable
            | Op::Kill
            | Op::FunctionCall
            | Op::FunctionParameter
            | Op::MemoryBarrier
            | Op::AccessChain
            | Op::InBoundsAccessChain
            | Op::CompositeExtract
            | Op::CompositeConstruct
            | Op::CompositeInsert
            | Op::VectorShuffle
            | Op::CopyObject
            | Op::CopyLogical
            | Op::Bitcast
            | Op::Transpose
            | Op::SampledImage => 0,
            Op::BranchConditional | Op::Switch | Op::ArrayLength => 1,
            Op::Dot => of_operand(),
            // The larger operand is the matrix.
            Op::MatrixTimesVector | Op::MatrixTimesScalar => of_operand(),
            Op::VectorTimesMatrix => self.declared.components(self.ty(id(one.operands.get(1)))),
            Op::MatrixTimesMatrix => {
                // Each component of the result is a dot product along the columns of the left.
                let left = self.ty(id(one.operands.first()));
                own * (self.declared.components(left) / self.declared.rows(left).max(1))
            }
            Op::Any | Op::All => of_operand().saturating_sub(1).max(1),
            Op::IAddCarry | Op::ISubBorrow | Op::UMulExtended | Op::SMulExtended => {
                2 * of_operand()
            }
            Op::ExtInst => self.extended(one, own),
            _ => {
                let name = one.class.opname;
                if name.starts_with("Atomic") {
                    let pointer = if opcode == Op::AtomicStore {
                        id(one.operands.first())
                    } else {
                        id(one.operands.iter().find(|o| matches!(o, Operand::IdRef(_))))
                    };
                    match self.declared.pointee(self.ty(pointer)).map(|(class, _)| class) {
                        Some(StorageClass::Workgroup) => to.own.workgroup += 1,
                        _ => to.own.others += 1,
                    }
                    0
                } else if name.starts_with("ImageQuery") || name == "Image" {
                    0
                } else if name.starts_with("Image") {
                    to.own.others += 1;
                    0
                } else if name.contains("RayQuery") || name.contains("TraceRay") {
                    return Err(CountError::Opaque(format!("Op{name}")));
                } else {
                    own
                }
            }
        };
        to.own.compute = to.own.compute.saturating_add(compute);
        Ok(())
    }

    fn access(&self, pointer: u32, bytes: u64, is_store: bool, to: &mut LoopCounts) {
        let pieces = bytes.div_ceil(WIDEST).max(1);
        let Some((class, _)) = self.declared.pointee(self.ty(pointer)) else { return };
        let (root, is_dynamic) = self.roots.get(&pointer).copied().unwrap_or((pointer, false));
        let InstructionMix { loads, load_bytes, stores, store_bytes, .. } = &mut to.own;
        match class {
            StorageClass::StorageBuffer | StorageClass::PhysicalStorageBuffer => {
                let buffer = to.buffers.entry(self.declared.place(root)).or_default();
                let BufferAccess { loads: l, load_bytes: b, stores: s } = buffer;
                if is_store {
                    *stores += pieces;
                    *store_bytes += bytes;
                    *s += pieces;
                } else {
                    *loads += pieces;
                    *load_bytes += bytes;
                    *l += pieces;
                    *b += bytes;
                }
            }
            StorageClass::Uniform | StorageClass::PushConstant | StorageClass::UniformConstant => {
                to.own.uniform_loads += pieces;
            }
            StorageClass::Workgroup => to.own.workgroup += pieces,
            StorageClass::Function | StorageClass::Private if is_dynamic => {
                to.own.local += pieces;
            }
            _ => {}
        }
    }

    /// GLSL.std.450: what GPUs have an instruction for is one a component; the rest is what it
    /// takes of those.
    fn extended(&self, one: &Instruction, own: u64) -> u64 {
        let set = id(one.operands.first());
        let Some(Operand::LiteralExtInstInteger(number)) = one.operands.get(1) else { return own };
        let Some(op) =
            GlslStd450Op::from_u32(*number).filter(|_| self.declared.glsl.contains(&set))
        else {
            return own;
        };
        let argument = self.declared.components(self.ty(id(one.operands.get(2))));
        match op {
            GlslStd450Op::FClamp
            | GlslStd450Op::UClamp
            | GlslStd450Op::SClamp
            | GlslStd450Op::NClamp
            | GlslStd450Op::FMix
            | GlslStd450Op::Exp
            | GlslStd450Op::Log
            | GlslStd450Op::Ldexp
            | GlslStd450Op::Tan => 2 * own,
            GlslStd450Op::Pow | GlslStd450Op::FSign | GlslStd450Op::SSign => 3 * own,
            GlslStd450Op::SmoothStep => 7 * own,
            GlslStd450Op::Cross => 6,
            // A dot product and a root; and products with its reciprocal.
            GlslStd450Op::Length => argument + 1,
            GlslStd450Op::Distance => 2 * argument + 1,
            GlslStd450Op::Normalize => 2 * argument + 1,
            GlslStd450Op::Reflect => 2 * argument + 1,
            GlslStd450Op::FaceForward => 2 * argument,
            GlslStd450Op::Refract => 3 * argument + 5,
            _ => own,
        }
    }
}
