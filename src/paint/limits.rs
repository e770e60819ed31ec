//! Limits on everything untrusted, handed to every parser and renderer.

/// How much of anything is accepted. The default suits a service that strangers upload to.
///
/// Of everything but time: what computes has no clock, it is called off from outside, by who waits for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Bytes of an upload, and of what it unpacks to.
    pub bytes: u64,
    /// Bytes of a bare table or tensor, which is held in memory as a whole.
    pub table_bytes: u64,
    /// Pixels of one picture.
    pub pixels: u64,
    /// Pixels of one flake slice; every core holds one at a time.
    pub slice_pixels: u64,
    /// Entries of an archive.
    pub entries: usize,
    /// Angles of one axis of a measured grid; a blend of several paints has so many times the union of theirs.
    pub angles: usize,
    /// Lobes of a paint.
    pub lobes: usize,
    /// Paints in one blend.
    pub paints: usize,
    /// Clusters in one slice of a stored paint.
    pub clusters: usize,
    /// Samples per pixel of a preview.
    pub samples: u32,
    /// Direction pairs of one evaluation.
    pub pairs: usize,
}

impl Limits {
    /// Angles of one axis of a paint that was made of others: a blend's common grid is the union of its paints'.
    #[must_use]
    pub const fn common_angles(&self) -> usize {
        self.angles.saturating_mul(self.paints)
    }
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            bytes: 4 << 30,
            table_bytes: 512 << 20,
            pixels: 64 << 20,
            slice_pixels: 4 << 20,
            entries: 20_000,
            angles: 181,
            lobes: 8,
            paints: 5,
            clusters: 4096,
            samples: 4096,
            pairs: 4_000_000,
        }
    }
}
