//! Why a document of `CxF3` is refused.

use super::document::NAMESPACE;

/// How one of several paints is asked for.
const CHOICE: &str =
    "accepted is the name or the Id of one of them, as --name, or as name in a query";

/// Why a document holds no readings of a paint.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CxfError {
    /// No well-formed XML.
    #[error("the document is damaged near byte {position}: {reason}")]
    Xml {
        /// Where, about.
        position: u64,
        /// What is wrong.
        reason: String,
    },
    /// A document type declaration, which could define entities.
    #[error("the document declares a document type, accepted is a document without <!DOCTYPE")]
    DocumentType,
    /// An entity that XML does not know by itself.
    #[error(
        "the document uses the entity &{name};, accepted are lt, gt, amp, apos, quot and characters by number"
    )]
    Entity {
        /// Its name.
        name: String,
    },
    /// Elements too deep inside each other.
    #[error("elements stand more than {accepted} deep inside each other, accepted are {accepted}")]
    Depth {
        /// The limit.
        accepted: usize,
    },
    /// Too many elements.
    #[error("the document has more than {accepted} elements, accepted are {accepted}")]
    Elements {
        /// The limit.
        accepted: usize,
    },
    /// Too many colors.
    #[error(
        "the objects of the document have {found} colors, accepted are {accepted} of all objects"
    )]
    Values {
        /// How many there are.
        found: usize,
        /// The limit.
        accepted: usize,
    },
    /// A declaration of another encoding.
    #[error("the document declares the encoding {found}, accepted is UTF-8")]
    Encoding {
        /// The encoding.
        found: String,
    },
    /// Two specifications that cannot be told apart.
    #[error("several ColorSpecifications have the Id {id:?}, accepted is one of each Id")]
    Specification {
        /// Their Id.
        id: String,
    },
    /// Another kind of document.
    #[error(
        "the root is <{found}>, accepted is one CxF of the namespace {}",
        NAMESPACE
    )]
    Root {
        /// Name of the root.
        found: String,
    },
    /// No object.
    #[error("the document holds no Object, accepted is one or more in Resources/ObjectCollection")]
    NoObject,
    /// No object with a reading.
    #[error("no object holds a reading of a multi-angle instrument; {object}: {reason}")]
    NoReading {
        /// The first object.
        object: String,
        /// Why its first value is none.
        reason: String,
    },
    /// The object that was asked for has no reading.
    #[error("{object} was asked for and holds no reading of a multi-angle instrument: {reason}")]
    Unread {
        /// The object.
        object: String,
        /// Why its first value is none.
        reason: String,
    },
    /// More than one paint, and none was asked for.
    #[error("the document holds {count} paints, {names}; {CHOICE}")]
    Several {
        /// How many.
        count: usize,
        /// What the first of them are called.
        names: String,
    },
    /// No paint of several is what was asked for.
    #[error(
        "no paint of the document has the name or Id {wanted:?}, it holds {count}, {names}; {CHOICE}"
    )]
    NotFound {
        /// What was asked for.
        wanted: String,
        /// How many there are.
        count: usize,
        /// What the first of them are called.
        names: String,
    },
    /// Several paints are what was asked for.
    #[error("{count} paints of the document have the name or Id {wanted:?}, {names}; {CHOICE}")]
    Ambiguous {
        /// What was asked for.
        wanted: String,
        /// How many have it.
        count: usize,
        /// What the first of them are called.
        names: String,
    },
    /// Too many readings.
    #[error("{object} holds {found} readings, accepted are {accepted}")]
    Rows {
        /// The paint.
        object: String,
        /// How many there are.
        found: usize,
        /// The limit.
        accepted: usize,
    },
}
