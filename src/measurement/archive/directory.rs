//! The end of a zip archive, where its directory stands: what must be known before the directory is believed.
//!
//! Source: PKWARE's APPNOTE 6.3.10, 4.3.12 (a file), 4.3.14 and 4.3.15 (the large end, zip64) and 4.3.16 (the end).

use std::collections::BTreeSet;
use std::io::{self, Read, Seek, SeekFrom};

/// The record at the end, or the large one where there is one.
const END: &[u8] = b"PK\x05\x06";
const LARGE_END: &[u8] = b"PK\x06\x06";
const LARGE_LOCATOR: &[u8] = b"PK\x06\x07";
const FILE: &[u8] = b"PK\x01\x02";

/// Bytes of a directory that a name is looked for in.
const LONGEST: u64 = 16 << 20;

/// What the end of an archive says about its directory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Directory {
    /// How many files it announces; 0 where there is no end at all.
    pub entries: u64,
    /// Where it begins, if it stands where it should: right before its end.
    start: u64,
    /// Its length, bytes.
    length: u64,
}

impl Directory {
    /// Reads the end of an archive of so many bytes.
    pub(super) fn announced(archive: &mut (impl Read + Seek), whole: u64) -> io::Result<Self> {
        let from = whole.saturating_sub(22 + 65_535);
        let tail = bytes_at(archive, from, 22 + 65_535)?;
        let ends = tail.windows(22).enumerate();
        let ends = ends.filter(|(_, record)| record.starts_with(END));
        let mut most = Self::default();
        // A comment may look like an end: whichever a reader takes, it announces no more than the largest of them.
        for (at, end) in ends {
            let place = from + at as u64;
            let small = Self::before(place, number(end, 10, 2), number(end, 12, 4));
            let locator = at.checked_sub(20).map(|from| &tail[from..at]);
            let locator = locator.filter(|record| record.starts_with(LARGE_LOCATOR));
            let large = locator.map(|locator| Self::large(archive, number(locator, 8, 8)));
            for found in [Some(small), large.transpose()?.flatten()] {
                most = found
                    .filter(|found| found.entries >= most.entries)
                    .unwrap_or(most);
            }
        }
        Ok(most)
    }

    fn before(place: u64, entries: u64, length: u64) -> Self {
        Self {
            entries,
            start: place.saturating_sub(length),
            length,
        }
    }

    fn large(archive: &mut (impl Read + Seek), place: u64) -> io::Result<Option<Self>> {
        let end = bytes_at(archive, place, 56)?;
        let whole = end.starts_with(LARGE_END) && end.len() == 56;
        Ok(whole.then(|| Self::before(place, number(&end, 32, 8), number(&end, 40, 8))))
    }

    /// The first name that stands in it a second time.
    pub(super) fn repeated(&self, archive: &mut (impl Read + Seek)) -> io::Result<Option<String>> {
        // Its length is a claim. What lies beyond is not worth the memory: the name is only for the message.
        let records = bytes_at(archive, self.start, self.length.min(LONGEST))?;
        let (mut rest, mut names) = (&records[..], BTreeSet::new());
        while rest.starts_with(FILE) && rest.len() >= 46 {
            #[allow(clippy::cast_possible_truncation)] // two bytes
            let [name, extra, comment] = [28, 30, 32].map(|at| number(rest, at, 2) as usize);
            let Some(own) = rest.get(46..46 + name) else {
                break;
            };
            if !names.insert(own) {
                return Ok(Some(String::from_utf8_lossy(own).into_owned()));
            }
            rest = rest.get(46 + name + extra + comment..).unwrap_or_default();
        }
        Ok(None)
    }
}

fn bytes_at(archive: &mut (impl Read + Seek), from: u64, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    archive.seek(SeekFrom::Start(from))?;
    archive.take(most).read_to_end(&mut bytes)?;
    archive.seek(SeekFrom::Start(0))?;
    Ok(bytes)
}

/// The little-endian number of so many bytes there; 0 beyond the end.
fn number(record: &[u8], at: usize, bytes: usize) -> u64 {
    let bytes = record.get(at..at + bytes).unwrap_or_default();
    bytes
        .iter()
        .rev()
        .fold(0, |sum, &byte| sum << 8 | u64::from(byte))
}
