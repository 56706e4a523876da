//! Functions: what can be reached, the loops of their control flow, and calls.

use super::{
    CountError, Counted, LoopCounts, MOST_LOOPS,
    cost::Values,
    module::{Declared, Value, id},
};
use rspirv::{
    dr::{Block, Function, Instruction, Operand, load_words},
    spirv::Op,
};
use std::collections::{HashMap, HashSet};

pub(super) fn count(words: &[u32], entry: &str) -> Result<Counted, CountError> {
    let module = load_words(words).map_err(|error| CountError::NotSpirv(error.to_string()))?;
    let declared = Declared::of(&module);
    let entry = declared.entry(entry)?;
    let by_id: HashMap<u32, &Function> = module
        .functions
        .iter()
        .filter_map(|function| Some((function.def.as_ref()?.result_id?, function)))
        .collect();
    // Callees first, without recursion of ours.
    let mut done: HashMap<u32, Counted> = HashMap::new();
    let mut open = HashSet::new();
    let mut stack = vec![entry];
    while let Some(&at) = stack.last() {
        if done.contains_key(&at) {
            stack.pop();
            continue;
        }
        let Some(function) = by_id.get(&at) else {
            return Err(CountError::NotSpirv(format!("function {at} is not there")));
        };
        let flow = Flow::of(&declared, function)?;
        let missing: Vec<u32> =
            flow.callees().filter(|callee| !done.contains_key(callee)).collect();
        if missing.is_empty() {
            let counted = flow.counted(&done)?;
            done.insert(at, counted);
            open.remove(&at);
            stack.pop();
        } else {
            open.insert(at);
            if let Some(&again) = missing.iter().find(|callee| open.contains(callee)) {
                return Err(CountError::Recursion(again));
            }
            stack.extend(missing);
        }
    }
    Ok(done.remove(&entry).unwrap_or_default())
}

/// The control flow of a function.
struct Flow<'a> {
    declared: &'a Declared<'a>,
    function: &'a Function,
    blocks: HashMap<u32, &'a Block>,
    /// In the order of the module, which has blocks after those that dominate them.
    reached: Vec<u32>,
    /// Where blocks lead that can be reached.
    next: HashMap<u32, Vec<u32>>,
    /// Headers of the loops, outer ones first, and the blocks of each.
    loops: Vec<(u32, HashSet<u32>)>,
}

impl<'a> Flow<'a> {
    fn of(declared: &'a Declared<'a>, function: &'a Function) -> Result<Self, CountError> {
        let blocks: HashMap<u32, &Block> = function
            .blocks
            .iter()
            .filter_map(|block| Some((block.label.as_ref()?.result_id?, block)))
            .collect();
        let mut flow = Self {
            declared,
            function,
            blocks,
            reached: vec![],
            next: HashMap::new(),
            loops: vec![],
        };
        flow.reach()?;
        flow.find_loops();
        Ok(flow)
    }

    fn callees(&self) -> impl Iterator<Item = u32> {
        self.reached
            .iter()
            .flat_map(|label| &self.blocks[label].instructions)
            .filter(|one| one.class.opcode == Op::FunctionCall)
            .map(|one| id(one.operands.first()))
    }

    /// Follows branches from the first block, but not those that constants exclude. What is known of
    /// variables depends on what can be reached, so both are found in turns: fewer blocks can only
    /// make more known.
    fn reach(&mut self) -> Result<(), CountError> {
        let mut known = self.declared.constants.clone();
        loop {
            let before = self.reached.len();
            self.reach_once(&known)?;
            let more = self.known(&known);
            if more.len() == known.len() && self.reached.len() == before {
                return Ok(());
            }
            known = more;
        }
    }

    fn reach_once(&mut self, known: &HashMap<u32, Value>) -> Result<(), CountError> {
        self.next.clear();
        let first = self.function.blocks.first().and_then(|block| block.label.as_ref()?.result_id);
        let mut stack: Vec<u32> = first.into_iter().collect();
        while let Some(label) = stack.pop() {
            if self.next.contains_key(&label) {
                continue;
            }
            let block = self.blocks.get(&label).ok_or_else(|| {
                CountError::NotSpirv(format!("a branch leads to block {label}, which is not there"))
            })?;
            let next = targets(block.instructions.last(), known);
            stack.extend(&next);
            self.next.insert(label, next);
        }
        let labels =
            self.function.blocks.iter().filter_map(|block| block.label.as_ref()?.result_id);
        self.reached = labels.filter(|label| self.next.contains_key(label)).collect();
        Ok(())
    }

    /// Values that are constant as far as blocks can be reached: results of logic on constants, and
    /// loads of variables into which everything stores the same.
    fn known(&self, before: &HashMap<u32, Value>) -> HashMap<u32, Value> {
        let mut known = before.clone();
        // What a variable holds: nothing yet, one value, or several.
        let mut held: HashMap<u32, Option<Value>> = HashMap::new();
        let mut escaped: HashSet<u32> = HashSet::new();
        let all = || self.reached.iter().flat_map(|label| &self.blocks[label].instructions);
        for one in all() {
            let operand = |i: usize| id(one.operands.get(i));
            match one.class.opcode {
                Op::Variable => {
                    let initial = known.get(&operand(1)).copied();
                    held.insert(one.result_id.unwrap_or_default(), initial);
                    if initial.is_none() {
                        escaped.insert(one.result_id.unwrap_or_default());
                    }
                }
                Op::Store => {
                    let value = known.get(&operand(1)).copied();
                    if held.get(&operand(0)).is_none_or(|old| value.is_none() || *old != value) {
                        escaped.insert(operand(0));
                    }
                }
                Op::Load => {}
                // Whatever else takes a pointer may store.
                _ => escaped.extend(one.operands.iter().filter_map(|operand| match operand {
                    Operand::IdRef(id) if held.contains_key(id) => Some(*id),
                    _ => None,
                })),
            }
        }
        for one in all() {
            let Some(result) = one.result_id else { continue };
            let value = |i: usize| known.get(&id(one.operands.get(i))).copied();
            let pair = (value(0), value(1));
            use Value::{Bool, Int};
            let made = match (one.class.opcode, pair) {
                (Op::Load, _) => {
                    let from = id(one.operands.first());
                    held.get(&from).copied().flatten().filter(|_| !escaped.contains(&from))
                }
                (Op::LogicalNot, (Some(Bool(a)), _)) => Some(Bool(!a)),
                (Op::LogicalAnd, (Some(Bool(false)), _) | (_, Some(Bool(false)))) => {
                    Some(Bool(false))
                }
                (Op::LogicalOr, (Some(Bool(true)), _) | (_, Some(Bool(true)))) => Some(Bool(true)),
                (Op::LogicalAnd, (Some(Bool(a)), Some(Bool(b)))) => Some(Bool(a && b)),
                (Op::LogicalOr, (Some(Bool(a)), Some(Bool(b)))) => Some(Bool(a || b)),
                (Op::LogicalEqual | Op::IEqual, (Some(a), Some(b))) => Some(Bool(a == b)),
                (Op::LogicalNotEqual | Op::INotEqual, (Some(a), Some(b))) => Some(Bool(a != b)),
                (Op::UGreaterThan, (Some(Int(a)), Some(Int(b)))) => Some(Bool(a > b)),
                (Op::ULessThan, (Some(Int(a)), Some(Int(b)))) => Some(Bool(a < b)),
                _ => None,
            };
            if let Some(made) = made {
                known.insert(result, made);
            }
        }
        known
    }

    /// Natural loops: of a header, the blocks from which the way leads back to it.
    fn find_loops(&mut self) {
        let mut before: HashMap<u32, Vec<u32>> = HashMap::new();
        for (&from, next) in &self.next {
            for &to in next {
                before.entry(to).or_default().push(from);
            }
        }
        for &header in &self.reached {
            let merge = self.blocks[&header]
                .instructions
                .iter()
                .find(|one| one.class.opcode == Op::LoopMerge);
            let Some(merge) = merge else { continue };
            let after = id(merge.operands.first());
            // Structured control flow goes back to a header only from its continue construct. A loop
            // without a way back never turns twice.
            let ahead = self.ahead(header, after);
            let back = before.get(&header).into_iter().flatten();
            let mut stack: Vec<u32> = back.filter(|from| ahead.contains(from)).copied().collect();
            if stack.is_empty() {
                continue;
            }
            let mut body = HashSet::from([header]);
            while let Some(label) = stack.pop() {
                if body.insert(label) {
                    let from = before.get(&label).into_iter().flatten();
                    stack.extend(from.filter(|from| ahead.contains(from) && !body.contains(from)));
                }
            }
            self.loops.push((header, body));
        }
        // The order of the module has outer headers first, as they dominate inner ones.
    }

    /// Blocks that a header leads to without crossing its merge block.
    fn ahead(&self, header: u32, merge: u32) -> HashSet<u32> {
        let mut ahead = HashSet::new();
        let mut stack = vec![header];
        while let Some(label) = stack.pop() {
            if label != merge && ahead.insert(label) {
                stack.extend(self.next.get(&label).into_iter().flatten());
            }
        }
        ahead
    }

    /// The function's loops, with those of its callees, which all are in `done`.
    fn counted(&self, done: &HashMap<u32, Counted>) -> Result<Counted, CountError> {
        let mut counted = Counted { loops: vec![LoopCounts::default()] };
        // The innermost loop of a block is the last that has it.
        let innermost = |label: u32, below: usize| {
            self.loops[..below].iter().rposition(|(_, body)| body.contains(&label))
        };
        for (i, (header, _)) in self.loops.iter().enumerate() {
            let parent = innermost(*header, i).map_or(0, |outer| outer + 1);
            counted.loops.push(LoopCounts { parent: Some(parent), ..LoopCounts::default() });
        }
        let mut values =
            Values { declared: self.declared, types: HashMap::new(), roots: HashMap::new() };
        for parameter in &self.function.parameters {
            values.note(parameter);
        }
        for &label in &self.reached {
            let place = innermost(label, self.loops.len()).map_or(0, |i| i + 1);
            let block = self.blocks[&label];
            let is_decided = self.next[&label].len() < 2;
            for one in &block.instructions {
                values.note(one);
                if one.class.opcode == Op::BranchConditional && is_decided {
                    continue;
                }
                values.charge(one, &mut counted.loops[place])?;
                if one.class.opcode == Op::FunctionCall
                    && let Some(callee) = done.get(&id(one.operands.first()))
                {
                    graft(&mut counted, place, callee)?;
                }
            }
        }
        Ok(counted)
    }
}

/// Adds a callee where it is called.
fn graft(counted: &mut Counted, place: usize, callee: &Counted) -> Result<(), CountError> {
    if counted.loops.len() + callee.loops.len() > MOST_LOOPS {
        return Err(CountError::TooLarge);
    }
    let Some((outside, loops)) = callee.loops.split_first() else { return Ok(()) };
    counted.loops[place].add(outside);
    // The callee's loop 1 becomes the first of those that are added.
    let shift = counted.loops.len() - 1;
    for one in loops {
        let parent = match one.parent {
            None | Some(0) => place,
            Some(parent) => parent + shift,
        };
        counted.loops.push(LoopCounts { parent: Some(parent), ..one.clone() });
    }
    Ok(())
}

/// Where a terminator leads, as far as constants leave it open; each block once.
fn targets(terminator: Option<&Instruction>, known: &HashMap<u32, Value>) -> Vec<u32> {
    let Some(one) = terminator else { return Vec::new() };
    let operand = |i: usize| id(one.operands.get(i));
    let mut found = match one.class.opcode {
        Op::Branch => vec![operand(0)],
        Op::BranchConditional => match known.get(&operand(0)) {
            Some(Value::Bool(true)) => vec![operand(1)],
            Some(Value::Bool(false)) => vec![operand(2)],
            _ => vec![operand(1), operand(2)],
        },
        Op::Switch => {
            let (default, cases) = (operand(1), one.operands.get(2..).unwrap_or_default());
            let cases: Vec<(&Operand, u32)> =
                cases.chunks_exact(2).map(|pair| (&pair[0], id(pair.get(1)))).collect();
            match known.get(&operand(0)) {
                Some(Value::Int(x)) => {
                    let case = cases
                        .iter()
                        .find(|(literal, _)| matches!(literal, Operand::LiteralBit32(y) if y == x));
                    vec![case.map_or(default, |&(_, label)| label)]
                }
                _ => [default].into_iter().chain(cases.iter().map(|&(_, label)| label)).collect(),
            }
        }
        _ => Vec::new(),
    };
    found.sort_unstable();
    found.dedup();
    found
}
