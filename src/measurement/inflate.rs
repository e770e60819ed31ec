//! Inflating zlib streams of known length, as the blocks of an EXR picture are (RFC 1950, RFC 1951).
//!
//! The caller knows how many bytes must come out, so the output is a slice and nothing ever grows. Slices of flakes
//! are mostly literals of seven or eight bits: one table look-up per literal, tables kept between streams. A stream
//! that is cut, holds a code that does not exist, reaches back before its beginning, makes more or fewer bytes than
//! wanted, or fails its checksum is refused. No preset dictionaries: EXR has none.

/// Bits that the first table of literals and lengths looks at.
const LITERAL_BITS: u32 = 11;
/// Bits that the first table of distances looks at.
const DISTANCE_BITS: u32 = 8;
/// Longest code of RFC 1951.
const MAX_BITS: usize = 15;

// Entries: bits 0-7 the code's length, 8-15 extra bits, 16-27 literal, base or start of a second table, 28-31 the kind.
const LITERAL: u32 = 0x8000_0000;
const SECOND: u32 = 0x4000_0000;
const END: u32 = 0x2000_0000;
const INVALID: u32 = 0x1000_0000;
const SPECIAL: u32 = SECOND | END | INVALID;

/// Why a stream cannot be inflated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum InflateError {
    /// The two bytes in front are not zlib's.
    #[error("it does not begin as a zlib stream")]
    Header,
    /// The stream ends early.
    #[error("the zlib stream is cut short")]
    Cut,
    /// A block type, code or distance that does not exist.
    #[error("the zlib stream is damaged: {0}")]
    Damaged(&'static str),
    /// Another number of bytes than wanted.
    #[error("the zlib stream does not hold the {wanted} bytes of its block")]
    Length {
        /// Bytes that should come out.
        wanted: usize,
    },
    /// The bytes that came out are not those that went in.
    #[error("the zlib stream fails its checksum")]
    Checksum,
}

/// Tables that are kept from stream to stream.
#[derive(Debug)]
pub struct Inflater {
    literals: Vec<u32>,
    distances: Vec<u32>,
    fixed: bool,
}

impl Default for Inflater {
    fn default() -> Self {
        Self { literals: Vec::with_capacity(4096), distances: Vec::with_capacity(1024), fixed: false }
    }
}

/// Bits of the stream, least significant first.
struct Bits<'a> {
    input: &'a [u8],
    position: usize,
    buffer: u64,
    count: u32,
    /// Zero bits that were added behind the end.
    invented: u32,
}

impl Bits<'_> {
    /// Makes at least 56 bits available, zeros behind the end of the input.
    #[inline]
    fn refill(&mut self) {
        if let Some(word) = self.input.get(self.position..).and_then(|rest| rest.first_chunk::<8>()) {
            self.buffer |= u64::from_le_bytes(*word) << self.count;
            self.position += ((63 - self.count) >> 3) as usize;
            self.count |= 56;
        } else {
            while self.count <= 56 {
                match self.input.get(self.position) {
                    Some(&byte) => self.buffer |= u64::from(byte) << self.count,
                    None => self.invented += 8,
                }
                self.position = (self.position + 1).min(self.input.len());
                self.count += 8;
            }
        }
    }

    #[inline]
    fn drop(&mut self, bits: u32) {
        self.buffer >>= bits;
        self.count -= bits;
    }

    #[inline]
    fn take(&mut self, bits: u32) -> u32 {
        #[allow(clippy::cast_possible_truncation)] // at most 16 bits are asked for
        let value = (self.buffer & ((1 << bits) - 1)) as u32;
        self.drop(bits);
        value
    }

    /// Whether bits were used that the input does not have.
    fn overdrawn(&self) -> bool {
        self.invented > self.count
    }

    /// Gives whole unused bytes back, so that bytes can be read from `position`.
    fn align(&mut self) -> Result<(), InflateError> {
        self.drop(self.count % 8);
        if self.overdrawn() {
            return Err(InflateError::Cut);
        }
        self.position -= ((self.count - self.invented) / 8) as usize;
        (self.buffer, self.count, self.invented) = (0, 0, 0);
        Ok(())
    }

    fn bytes<const N: usize>(&mut self) -> Result<[u8; N], InflateError> {
        let bytes = self.input.get(self.position..).and_then(|rest| rest.first_chunk::<N>());
        self.position += N;
        bytes.copied().ok_or(InflateError::Cut)
    }
}

impl Inflater {
    /// Inflates a zlib stream that holds exactly `output.len()` bytes.
    ///
    /// # Errors
    ///
    /// [`InflateError`] for a stream that is cut, damaged, or of another length.
    pub fn inflate(&mut self, input: &[u8], output: &mut [u8]) -> Result<(), InflateError> {
        let header = input.first_chunk::<2>().ok_or(InflateError::Cut)?;
        if header[0] & 15 != 8 || u16::from_be_bytes(*header) % 31 != 0 || header[1] & 0x20 != 0 {
            return Err(InflateError::Header);
        }
        let mut bits = Bits { input, position: 2, buffer: 0, count: 0, invented: 0 };
        let mut written = 0;
        loop {
            bits.refill();
            let last = bits.take(1) == 1;
            match bits.take(2) {
                0 => written = stored(&mut bits, output, written)?,
                1 => {
                    self.fixed_tables();
                    written = self.block(&mut bits, output, written)?;
                }
                2 => {
                    self.read_tables(&mut bits)?;
                    written = self.block(&mut bits, output, written)?;
                }
                _ => return Err(InflateError::Damaged("a block of no known type")),
            }
            if last {
                break;
            }
        }
        if written != output.len() {
            return Err(InflateError::Length { wanted: output.len() });
        }
        bits.align()?;
        if u32::from_be_bytes(bits.bytes::<4>()?) != adler32(output) {
            return Err(InflateError::Checksum);
        }
        Ok(())
    }

    fn fixed_tables(&mut self) {
        if self.fixed {
            return;
        }
        let lengths: Vec<u8> = (0..288_u16)
            .map(|s| match s {
                0..=143 => 8,
                144..=255 => 9,
                256..=279 => 7,
                _ => 8,
            })
            .collect();
        // The fixed codes are complete: building them cannot fail.
        let built = build(&lengths, LITERAL_BITS, literal_entry, &mut self.literals)
            .and_then(|()| build(&[5; 32], DISTANCE_BITS, distance_entry, &mut self.distances));
        self.fixed = built.is_ok();
    }

    fn read_tables(&mut self, bits: &mut Bits) -> Result<(), InflateError> {
        const ORDER: [usize; 19] = [16, 17, 18, 0, 8, 7, 9, 6, 10, 5, 11, 4, 12, 3, 13, 2, 14, 1, 15];
        self.fixed = false;
        let (literals, distances) = (bits.take(5) as usize + 257, bits.take(5) as usize + 1);
        let codes = bits.take(4) as usize + 4;
        let mut lengths = [0_u8; 19];
        for &symbol in &ORDER[..codes] {
            bits.refill();
            #[allow(clippy::cast_possible_truncation)] // three bits
            let length = bits.take(3) as u8;
            lengths[symbol] = length;
        }
        build(&lengths, 7, |symbol| LITERAL | symbol << 16, &mut self.distances)?;
        let mut all = [0_u8; 288 + 32];
        let wanted = literals + distances;
        let mut known = 0;
        while known < wanted {
            bits.refill();
            let entry = self.distances[(bits.buffer & 127) as usize];
            if entry & SPECIAL != 0 {
                return Err(InflateError::Damaged("a code length that does not exist"));
            }
            bits.drop(entry & 255);
            #[allow(clippy::cast_possible_truncation)] // 0 to 18
            let (value, repeat) = match (entry >> 16) & 255 {
                16 if known == 0 => return Err(InflateError::Damaged("a repeat of nothing")),
                16 => (all[known - 1], 3 + bits.take(2) as usize),
                17 => (0, 3 + bits.take(3) as usize),
                18 => (0, 11 + bits.take(7) as usize),
                length => (length as u8, 1),
            };
            let Some(run) = all[..wanted].get_mut(known..known + repeat) else {
                return Err(InflateError::Damaged("more code lengths than codes"));
            };
            run.fill(value);
            known += repeat;
            if bits.overdrawn() {
                return Err(InflateError::Cut);
            }
        }
        build(&all[..literals], LITERAL_BITS, literal_entry, &mut self.literals)?;
        build(&all[literals..wanted], DISTANCE_BITS, distance_entry, &mut self.distances)
    }

    fn block(&self, bits: &mut Bits, output: &mut [u8], mut written: usize) -> Result<usize, InflateError> {
        const MASK: u64 = (1 << LITERAL_BITS) - 1;
        let wanted = output.len();
        let (literals, distances) = (&self.literals[..], &self.distances[..]);
        let (Some(first), Some(nearest)) = (literals.first_chunk::<2048>(), distances.first_chunk::<256>()) else {
            return Err(InflateError::Damaged("a block without codes"));
        };
        loop {
            bits.refill();
            let mut entry = first[(bits.buffer & MASK) as usize];
            // 56 bits are there: after four literals of at most 11 there are still enough to look up a fifth.
            let mut run = 0;
            while entry & LITERAL != 0 {
                bits.drop(entry & 255);
                let Some(place) = output.get_mut(written) else { return Err(InflateError::Length { wanted }) };
                *place = (entry >> 16) as u8;
                written += 1;
                run += 1;
                if run == 4 {
                    run = 0;
                    bits.refill();
                }
                entry = first[(bits.buffer & MASK) as usize];
            }
            if run > 0 {
                bits.refill();
            }
            if entry & SECOND != 0 {
                bits.drop(LITERAL_BITS);
                let rest = bits.buffer & ((1 << ((entry >> 8) & 255)) - 1);
                entry = literals[first.len() + ((entry >> 16) & 0xfff) as usize + rest as usize];
            }
            bits.drop(entry & 255);
            if entry & LITERAL != 0 {
                let Some(place) = output.get_mut(written) else { return Err(InflateError::Length { wanted }) };
                *place = (entry >> 16) as u8;
                written += 1;
                continue;
            }
            if entry & (END | INVALID) != 0 {
                if bits.overdrawn() {
                    return Err(InflateError::Cut);
                }
                if entry & END != 0 {
                    return Ok(written);
                }
                return Err(InflateError::Damaged("a code that does not exist"));
            }
            let length = ((entry >> 16) & 0xfff) as usize + bits.take((entry >> 8) & 255) as usize;
            let mut entry = nearest[(bits.buffer & 255) as usize];
            if entry & SECOND != 0 {
                bits.drop(DISTANCE_BITS);
                let rest = bits.buffer & ((1 << ((entry >> 8) & 255)) - 1);
                entry = distances[nearest.len() + ((entry >> 16) & 0xfff) as usize + rest as usize];
            }
            if entry & SPECIAL != 0 {
                return Err(InflateError::Damaged("a distance that does not exist"));
            }
            bits.drop(entry & 255);
            let symbol = (entry >> 16) & 31;
            let extra = (symbol >> 1).saturating_sub(1);
            let base = if symbol < 4 { symbol + 1 } else { ((2 | (symbol & 1)) << extra) + 1 };
            let distance = (base + bits.take(extra)) as usize;
            if bits.overdrawn() {
                return Err(InflateError::Cut);
            }
            written = repeat(output, written, length, distance)?;
        }
    }
}

/// Copies `length` bytes from `distance` back; a distance below the length repeats.
#[inline]
fn repeat(output: &mut [u8], at: usize, length: usize, distance: usize) -> Result<usize, InflateError> {
    let Some(from) = at.checked_sub(distance) else {
        return Err(InflateError::Damaged("a distance back before the beginning"));
    };
    let end = at + length;
    if end > output.len() {
        return Err(InflateError::Length { wanted: output.len() });
    }
    if distance >= 8 && end + 8 <= output.len() {
        let (mut source, mut target) = (from, at);
        while target < end {
            let mut word = [0; 8];
            word.copy_from_slice(&output[source..source + 8]);
            output[target..target + 8].copy_from_slice(&word);
            (source, target) = (source + 8, target + 8);
        }
    } else {
        for k in 0..length {
            output[at + k] = output[from + k];
        }
    }
    Ok(end)
}

fn stored(bits: &mut Bits, output: &mut [u8], written: usize) -> Result<usize, InflateError> {
    bits.align()?;
    let [a, b, c, d] = bits.bytes()?;
    let length = u16::from_le_bytes([a, b]);
    if length != !u16::from_le_bytes([c, d]) {
        return Err(InflateError::Damaged("a stored block of contradictory length"));
    }
    let length = usize::from(length);
    let source = bits.input.get(bits.position..bits.position + length).ok_or(InflateError::Cut)?;
    let wanted = output.len();
    let target = output.get_mut(written..written + length).ok_or(InflateError::Length { wanted })?;
    target.copy_from_slice(source);
    bits.position += length;
    Ok(written + length)
}

fn literal_entry(symbol: u32) -> u32 {
    match symbol {
        0..=255 => LITERAL | symbol << 16,
        256 => END,
        257..=264 => (symbol - 254) << 16,
        265..=284 => {
            let extra = (symbol - 261) >> 2;
            let base = ((4 + ((symbol - 265) & 3)) << extra) + 3;
            base << 16 | extra << 8
        }
        285 => 258 << 16,
        _ => INVALID,
    }
}

fn distance_entry(symbol: u32) -> u32 {
    if symbol < 30 { symbol << 16 } else { INVALID }
}

/// Fills a table for canonical codes of these lengths: `first` bits at once, longer codes by a second table.
fn build(lengths: &[u8], first: u32, entry_of: impl Fn(u32) -> u32, table: &mut Vec<u32>) -> Result<(), InflateError> {
    let mut count = [0_usize; MAX_BITS + 1];
    for &length in lengths {
        count[usize::from(length)] += 1;
    }
    count[0] = 0;
    let (mut next, mut code, mut space) = ([0_u32; MAX_BITS + 1], 0_u32, 1_i64);
    for length in 1..=MAX_BITS {
        #[allow(clippy::cast_possible_truncation)] // at most 288 symbols
        let before = count[length - 1] as u32;
        code = (code + before) << 1;
        next[length] = code;
        #[allow(clippy::cast_possible_wrap)] // at most 288 symbols
        let used = count[length] as i64;
        space = (space << 1) - used;
        if space < 0 {
            return Err(InflateError::Damaged("more codes than there is room for"));
        }
    }
    table.clear();
    table.resize(1 << first, INVALID);
    #[allow(clippy::cast_possible_truncation)] // below 16
    let longest = (1..=MAX_BITS).rev().find(|l| count[*l] > 0).unwrap_or(0) as u32;
    for (symbol, &length) in (0_u32..).zip(lengths) {
        let length = u32::from(length);
        if length == 0 {
            continue;
        }
        let code = next[length as usize];
        next[length as usize] += 1;
        let reversed = (code.reverse_bits() >> (32 - length)) as usize;
        if length <= first {
            let entry = entry_of(symbol) | length;
            let mut slot = reversed;
            while slot < 1 << first {
                table[slot] = entry;
                slot += 1 << length;
            }
        } else {
            let prefix = reversed & ((1 << first) - 1);
            let second = longest - first;
            if table[prefix] & SECOND == 0 {
                #[allow(clippy::cast_possible_truncation)] // below 4096, the next line sees to it
                let start = (table.len() - (1 << first)) as u32;
                // At most 144 prefixes lead to two longer codes, of four bits more: 2304 entries.
                if start > 0xfff {
                    return Err(InflateError::Damaged("codes that are too many"));
                }
                table.resize(table.len() + (1 << second), INVALID);
                table[prefix] = SECOND | start << 16 | second << 8 | first;
            }
            let start = (1 << first) + ((table[prefix] >> 16) & 0xfff) as usize;
            let entry = entry_of(symbol) | (length - first);
            let mut slot = reversed >> first;
            while slot < 1 << second {
                table[start + slot] = entry;
                slot += 1 << (length - first);
            }
        }
    }
    Ok(())
}

/// Adler-32 of RFC 1950, a block at a time so that it vectorises.
fn adler32(bytes: &[u8]) -> u32 {
    const PRIME: u32 = 65521;
    const LANES: usize = 32;
    let (mut a, mut b) = (1_u32, 0_u32);
    // 5552 bytes are the most that cannot overflow; 5536 is the multiple of 32 below.
    for chunk in bytes.chunks(5536) {
        let blocks = chunk.chunks_exact(LANES);
        let rest = blocks.remainder();
        for block in blocks {
            let (mut plain, mut weighted) = (0_u32, 0_u32);
            for (k, &byte) in (0_u32..).zip(block) {
                plain += u32::from(byte);
                weighted += (32 - k) * u32::from(byte);
            }
            b += 32 * a + weighted;
            a += plain;
        }
        for &byte in rest {
            a += u32::from(byte);
            b += a;
        }
        a %= PRIME;
        b %= PRIME;
    }
    b << 16 | a
}
