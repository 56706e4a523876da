//! Bytes that choose.

/// Choices made by the bytes of an input. At the end every choice is the first one, so that every
/// input means something and a prefix means nearly the same.
#[derive(Clone, Debug)]
pub(crate) struct Bytes<'a> {
    rest: &'a [u8],
    /// The last float, which the next may repeat or be next to.
    last: f32,
}

/// Numbers on which arithmetic is hard.
const HARD: [f32; 16] = [
    0.0,
    -0.0,
    1.0,
    -1.0,
    f32::MIN_POSITIVE,
    -f32::MIN_POSITIVE,
    f32::from_bits(1),
    f32::EPSILON,
    f32::MAX,
    f32::MIN,
    f32::INFINITY,
    f32::NEG_INFINITY,
    f32::NAN,
    1e30,
    1e-30,
    16_777_216.0,
];

impl<'a> Bytes<'a> {
    pub(crate) const fn new(rest: &'a [u8]) -> Self {
        Self { rest, last: 0.0 }
    }

    pub(crate) const fn is_empty(&self) -> bool {
        self.rest.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        self.rest.split_off_first().copied().unwrap_or(0)
    }

    /// A number below `count`, which is 1 to 256.
    pub(crate) fn below(&mut self, count: usize) -> usize {
        usize::from(self.byte()) % count.max(1)
    }

    fn signed(&mut self) -> f32 {
        f32::from(self.byte().cast_signed())
    }

    fn short(&mut self) -> f32 {
        f32::from(i16::from_le_bytes([self.byte(), self.byte()]))
    }

    pub(crate) fn word(&mut self) -> u32 {
        u32::from_le_bytes([0; 4].map(|_: u8| self.byte()))
    }

    /// A float of any bits, but often one that meets others: a small integer, a fraction of a
    /// power of two, a hard one, or one next to the last.
    pub(crate) fn float(&mut self) -> f32 {
        let tag = self.byte();
        let high = usize::from(tag >> 3);
        self.last = match tag & 7 {
            0 => self.signed(),
            1 => self.short() / 256.0,
            2 => HARD[high % HARD.len()],
            3 => self.last,
            4 => {
                // The bits of floats of one sign are in their order.
                let step = i32::from(tag >> 3) - 16;
                f32::from_bits(self.last.to_bits().wrapping_add_signed(step))
            }
            5 => self.signed() * self.signed().exp2(),
            6 => -self.last,
            _ => f32::from_bits(self.word()),
        };
        self.last
    }
}
