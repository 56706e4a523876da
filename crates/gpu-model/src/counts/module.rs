//! What a module declares: types, constants, bindings.

use super::{CountError, Place};
use rspirv::{
    dr::{Instruction, Module, Operand},
    spirv::{Decoration, Op, StorageClass},
};
use std::collections::{HashMap, HashSet};

/// Depth of nested types that is followed.
const DEEPEST: u32 = 32;

/// A constant that decides branches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Value {
    Bool(bool),
    Int(u32),
}

pub(super) struct Declared<'a> {
    pub(super) module: &'a Module,
    types: HashMap<u32, &'a Instruction>,
    pub(super) constants: HashMap<u32, Value>,
    /// Of ids that are constants of any kind.
    pub(super) is_constant: HashSet<u32>,
    places: HashMap<u32, Place>,
    /// Numbers of global variables, which pointers lead to.
    pub(super) globals: HashMap<u32, u32>,
    /// Ids of imported instruction sets.
    pub(super) glsl: Vec<u32>,
}

pub(super) fn id(operand: Option<&Operand>) -> u32 {
    match operand {
        Some(Operand::IdRef(id)) => *id,
        _ => 0,
    }
}

fn literal(operand: Option<&Operand>) -> u32 {
    match operand {
        Some(Operand::LiteralBit32(word)) => *word,
        _ => 0,
    }
}

impl<'a> Declared<'a> {
    pub(super) fn of(module: &'a Module) -> Self {
        let mut made = Self {
            module,
            types: HashMap::new(),
            constants: HashMap::new(),
            is_constant: HashSet::new(),
            places: HashMap::new(),
            globals: HashMap::new(),
            glsl: module.ext_inst_imports.iter().filter_map(|i| i.result_id).collect(),
        };
        for one in &module.annotations {
            if one.class.opcode == Op::Decorate {
                let place = made
                    .places
                    .entry(id(one.operands.first()))
                    .or_insert(Place { group: 0, binding: 0 });
                match one.operands.get(1) {
                    Some(Operand::Decoration(Decoration::DescriptorSet)) => {
                        place.group = literal(one.operands.get(2));
                    }
                    Some(Operand::Decoration(Decoration::Binding)) => {
                        place.binding = literal(one.operands.get(2));
                    }
                    _ => {}
                }
            }
        }
        for one in &module.types_global_values {
            let Some(result) = one.result_id else { continue };
            let value = match one.class.opcode {
                Op::Variable => {
                    made.globals.insert(result, one.result_type.unwrap_or_default());
                    continue;
                }
                Op::ConstantTrue => Some(Value::Bool(true)),
                Op::ConstantFalse => Some(Value::Bool(false)),
                Op::Constant => match one.operands.first() {
                    Some(Operand::LiteralBit32(word)) if made.is_int(one.result_type) => {
                        Some(Value::Int(*word))
                    }
                    _ => None,
                },
                Op::ConstantNull => match made.opcode(one.result_type) {
                    Some(Op::TypeBool) => Some(Value::Bool(false)),
                    Some(Op::TypeInt) => Some(Value::Int(0)),
                    _ => None,
                },
                Op::ConstantComposite | Op::SpecConstant | Op::Undef => None,
                _ => {
                    made.types.insert(result, one);
                    continue;
                }
            };
            made.is_constant.insert(result);
            if let Some(value) = value {
                made.constants.insert(result, value);
            }
        }
        made
    }

    fn is_int(&self, ty: Option<u32>) -> bool {
        self.opcode(ty) == Some(Op::TypeInt)
    }

    fn opcode(&self, ty: Option<u32>) -> Option<Op> {
        Some(self.types.get(&ty?)?.class.opcode)
    }

    /// Components of a value: 1 for a scalar.
    pub(super) fn components(&self, ty: u32) -> u64 {
        let Some(one) = self.types.get(&ty) else { return 1 };
        match one.class.opcode {
            Op::TypeVector => u64::from(literal(one.operands.get(1))),
            Op::TypeMatrix => self.rows(ty) * u64::from(literal(one.operands.get(1))),
            _ => 1,
        }
    }

    /// Rows of a matrix; 1 of anything else.
    pub(super) fn rows(&self, ty: u32) -> u64 {
        let matrix = self.types.get(&ty).filter(|one| one.class.opcode == Op::TypeMatrix);
        let column = matrix.and_then(|one| self.types.get(&id(one.operands.first())));
        column.map_or(1, |column| u64::from(literal(column.operands.get(1))))
    }

    /// Bytes of a value.
    pub(super) fn bytes(&self, ty: u32) -> u64 {
        self.bytes_within(ty, DEEPEST)
    }

    /// Types nest as deep as a shader's text does; beyond the limit nothing is counted.
    fn bytes_within(&self, ty: u32, depth: u32) -> u64 {
        let Some(one) = self.types.get(&ty).filter(|_| depth > 0) else { return 0 };
        let first = id(one.operands.first());
        match one.class.opcode {
            Op::TypeBool => 4,
            Op::TypeInt | Op::TypeFloat => u64::from(literal(one.operands.first()) / 8),
            Op::TypeVector | Op::TypeMatrix => {
                let n = u64::from(literal(one.operands.get(1)));
                n.saturating_mul(self.bytes_within(first, depth - 1))
            }
            Op::TypeArray => {
                let n = match self.constants.get(&id(one.operands.get(1))) {
                    Some(Value::Int(n)) => u64::from(*n),
                    _ => 1,
                };
                n.saturating_mul(self.bytes_within(first, depth - 1))
            }
            Op::TypeStruct => one.operands.iter().fold(0_u64, |sum, member| {
                sum.saturating_add(self.bytes_within(id(Some(member)), depth - 1))
            }),
            _ => 0,
        }
    }

    /// What a type of pointer points to, and where that lies.
    pub(super) fn pointee(&self, pointer: u32) -> Option<(StorageClass, u32)> {
        let one = self.types.get(&pointer)?;
        match (one.class.opcode, one.operands.first()) {
            (Op::TypePointer, Some(Operand::StorageClass(class))) => {
                Some((*class, id(one.operands.get(1))))
            }
            _ => None,
        }
    }

    /// The place of a global variable.
    pub(super) fn place(&self, variable: u32) -> Place {
        self.places.get(&variable).copied().unwrap_or(Place { group: 0, binding: 0 })
    }

    /// The function of an entry point.
    pub(super) fn entry(&self, name: &str) -> Result<u32, CountError> {
        let mut known = Vec::new();
        for one in &self.module.entry_points {
            if let [_, Operand::IdRef(function), Operand::LiteralString(its), ..] =
                one.operands.as_slice()
            {
                if its == name {
                    return Ok(*function);
                }
                known.push(its.as_str());
            }
        }
        Err(CountError::NoEntry { wanted: name.to_owned(), known: known.join(", ") })
    }
}
