//! The tensor file: named arrays of numbers, as EPFL's material database stores its measurements.
//!
//! ```text
//! "tensor_file\0" · version u8 major, u8 minor · fields u32
//! per field: name length u16 · name · dimensions u16 · type u8 · offset u64 · shape u64 each
//! ```
//!
//! Little-endian, offsets from the start of the file. Every offset and product of shapes is checked against the
//! length; nothing is allocated before that. What the arrays mean is `rgl`'s business.

/// First bytes of every tensor file.
pub(super) const MAGIC: &[u8; 12] = b"tensor_file\0";

const MAX_FIELDS: u32 = 256;
const MAX_DIMENSIONS: u16 = 8;

/// Why bytes are no tensor file, or lack a field.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TensorError {
    /// The first bytes are others.
    #[error("the file does not begin with \"tensor_file\"")]
    Magic,
    /// Another major version.
    #[error("version {0} is not known, accepted is 1")]
    Version(u8),
    /// The list of fields ends early.
    #[error("the file ends within its list of fields, at field {0}")]
    Cut(u32),
    /// More fields than any such file has.
    #[error("{0} fields are announced, accepted are up to 256")]
    Fields(u32),
    /// A field of too many dimensions.
    #[error("field {name} has {dimensions} dimensions, accepted are up to 8")]
    Dimensions {
        /// Name of the field.
        name: String,
        /// Dimensions announced.
        dimensions: u16,
    },
    /// A type code that does not exist.
    #[error("field {name} has type {code}, accepted are 1 to 11")]
    Type {
        /// Name of the field.
        name: String,
        /// The code.
        code: u8,
    },
    /// A field that does not lie within the file.
    #[error(
        "field {name} of shape {shape:?} at offset {offset} does not fit the file of {bytes} bytes"
    )]
    Outside {
        /// Name of the field.
        name: String,
        /// Its shape.
        shape: Vec<u64>,
        /// Its offset.
        offset: u64,
        /// Length of the file.
        bytes: usize,
    },
    /// A field that is needed.
    #[error("field {0} is missing")]
    Missing(&'static str),
    /// A field of another type than it must have.
    #[error("field {name} has type {code}, accepted is {accepted}")]
    WrongType {
        /// Name of the field.
        name: &'static str,
        /// Its type.
        code: u8,
        /// What it must be.
        accepted: &'static str,
    },
}

/// One named array.
#[derive(Clone, Debug)]
pub(super) struct Field<'a> {
    name: String,
    code: u8,
    /// Extent along each dimension, the last one contiguous.
    pub shape: Vec<usize>,
    bytes: &'a [u8],
}

/// The fields of a tensor file, checked to lie within it.
#[derive(Clone, Debug)]
pub(super) struct Tensors<'a> {
    fields: Vec<Field<'a>>,
}

fn size_of_code(code: u8) -> Option<usize> {
    match code {
        1 | 2 => Some(1),
        3 | 4 | 9 => Some(2),
        5 | 6 | 10 => Some(4),
        7 | 8 | 11 => Some(8),
        _ => None,
    }
}

struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (head, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*head)
    }

    fn slice(&mut self, length: usize) -> Option<&'a [u8]> {
        let (head, rest) = self.0.split_at_checked(length)?;
        self.0 = rest;
        Some(head)
    }
}

impl<'a> Tensors<'a> {
    /// Reads the list of fields.
    pub fn read(bytes: &'a [u8]) -> Result<Self, TensorError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(TensorError::Magic)?;
        let mut cursor = Cursor(rest);
        let [major, _minor] = cursor.take::<2>().ok_or(TensorError::Cut(0))?;
        if major != 1 {
            return Err(TensorError::Version(major));
        }
        let count = u32::from_le_bytes(cursor.take().ok_or(TensorError::Cut(0))?);
        if count > MAX_FIELDS {
            return Err(TensorError::Fields(count));
        }
        let fields = (0..count)
            .map(|k| field(&mut cursor, bytes, k))
            .collect::<Result<_, _>>()?;
        Ok(Self { fields })
    }

    /// The field of a name.
    pub fn get(&self, name: &'static str) -> Result<&Field<'a>, TensorError> {
        self.fields
            .iter()
            .find(|f| f.name == name)
            .ok_or(TensorError::Missing(name))
    }

    /// The field of a name as `f32`.
    pub fn floats(&self, name: &'static str) -> Result<(Vec<f32>, &[usize]), TensorError> {
        let field = self.get(name)?;
        if field.code != 10 {
            return Err(TensorError::WrongType {
                name,
                code: field.code,
                accepted: "10 (float32)",
            });
        }
        let values = field
            .bytes
            .chunks_exact(4)
            .filter_map(|c| c.try_into().ok().map(f32::from_le_bytes))
            .collect();
        Ok((values, &field.shape))
    }

    /// The field of a name as bytes, `None` where it is missing or of another type.
    pub fn bytes(&self, name: &'static str) -> Option<&'a [u8]> {
        self.get(name).ok().filter(|f| f.code == 1).map(|f| f.bytes)
    }
}

fn field<'a>(
    cursor: &mut Cursor<'a>,
    file: &'a [u8],
    index: u32,
) -> Result<Field<'a>, TensorError> {
    let cut = TensorError::Cut(index);
    let Some(length) = cursor.take().map(u16::from_le_bytes) else {
        return Err(cut);
    };
    let Some(name) = cursor.slice(length.into()) else {
        return Err(cut);
    };
    let name: String = String::from_utf8_lossy(name).chars().take(80).collect();
    let Some(dimensions) = cursor.take().map(u16::from_le_bytes) else {
        return Err(cut);
    };
    if dimensions > MAX_DIMENSIONS {
        return Err(TensorError::Dimensions { name, dimensions });
    }
    let Some([code]) = cursor.take() else {
        return Err(cut);
    };
    let Some(size) = size_of_code(code) else {
        return Err(TensorError::Type { name, code });
    };
    let Some(offset) = cursor.take().map(u64::from_le_bytes) else {
        return Err(cut);
    };
    let mut shape = Vec::new();
    for _ in 0..dimensions {
        let Some(extent) = cursor.take().map(u64::from_le_bytes) else {
            return Err(cut);
        };
        shape.push(extent);
    }
    let place = || {
        let extents: Vec<usize> = shape
            .iter()
            .map(|&n| usize::try_from(n).ok())
            .collect::<Option<_>>()?;
        let length = extents
            .iter()
            .try_fold(size, |product, &n| product.checked_mul(n))?;
        let start = usize::try_from(offset).ok()?;
        let data = file.get(start..start.checked_add(length)?)?;
        Some((extents, data))
    };
    match place() {
        Some((extents, data)) => Ok(Field {
            name,
            code,
            shape: extents,
            bytes: data,
        }),
        None => Err(TensorError::Outside {
            name,
            shape,
            offset,
            bytes: file.len(),
        }),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Writes a tensor file of these `f32` fields and one byte field.
    pub(in crate::measurement) fn tensor_file(fields: &[(&str, &[u64], &[f32])]) -> Vec<u8> {
        let header: usize = fields
            .iter()
            .map(|(name, shape, _)| 2 + name.len() + 2 + 1 + 8 + 8 * shape.len())
            .sum();
        let mut file = MAGIC.to_vec();
        file.extend_from_slice(&[1, 0]);
        file.extend_from_slice(&u32::try_from(fields.len()).expect("few").to_le_bytes());
        let mut offset = file.len() + header;
        for (name, shape, values) in fields {
            file.extend_from_slice(&u16::try_from(name.len()).expect("short").to_le_bytes());
            file.extend_from_slice(name.as_bytes());
            file.extend_from_slice(&u16::try_from(shape.len()).expect("few").to_le_bytes());
            file.push(10);
            file.extend_from_slice(&(offset as u64).to_le_bytes());
            for extent in *shape {
                file.extend_from_slice(&extent.to_le_bytes());
            }
            offset += 4 * values.len();
        }
        for (_, _, values) in fields {
            for value in *values {
                file.extend_from_slice(&value.to_le_bytes());
            }
        }
        file
    }

    #[test]
    fn what_was_written_is_read_again() {
        let file = tensor_file(&[("a", &[2], &[1.0, -2.0]), ("b", &[1, 3], &[4.0, 5.0, 6.0])]);
        let tensors = Tensors::read(&file).expect("whole");
        assert_eq!(tensors.floats("b").expect("there").0, [4.0, 5.0, 6.0]);
        assert_eq!(tensors.floats("b").expect("there").1, [1, 3]);
        assert!(matches!(
            tensors.floats("c"),
            Err(TensorError::Missing("c"))
        ));
    }

    #[test]
    fn a_shape_whose_product_overflows_is_refused_by_name() {
        let mut file = tensor_file(&[("sigma", &[2, 2], &[0.0; 4])]);
        // Shape starts after magic, version, count, name length, name, dimensions, type and offset.
        let at = 12 + 2 + 4 + 2 + 5 + 2 + 1 + 8;
        file[at..at + 8].copy_from_slice(&(1_u64 << 63).to_le_bytes());
        let error = Tensors::read(&file).expect_err("too large");
        assert!(
            matches!(&error, TensorError::Outside { name, .. } if name == "sigma"),
            "{error}"
        );
    }

    #[test]
    fn every_cut_is_an_error() {
        let file = tensor_file(&[("a", &[2], &[1.0, -2.0]), ("b", &[1, 3], &[4.0, 5.0, 6.0])]);
        for length in 0..file.len() {
            assert!(Tensors::read(&file[..length]).is_err(), "cut at {length}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]
        #[test]
        fn scrambled_bytes_never_panic(scramble in prop::collection::vec(any::<(u16, u8)>(), 1..40)) {
            let mut file = tensor_file(&[("a", &[2], &[1.0, -2.0]), ("b", &[1, 3], &[4.0, 5.0, 6.0])]);
            for (at, byte) in scramble {
                let at = usize::from(at) % file.len();
                file[at] = byte;
            }
            if let Ok(tensors) = Tensors::read(&file) {
                let _ = tensors.floats("a");
                let _ = tensors.bytes("b");
            }
        }
    }
}
