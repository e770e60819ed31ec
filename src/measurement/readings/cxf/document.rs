//! An XML document as a tree of the elements of one namespace, bounded in every direction.
//!
//! Elements of other namespaces are left out with all that is in them. Declarations of a document type are refused, so
//! that no entity is there to be expanded; the five that XML knows by itself and characters by number are read.

use quick_xml::XmlVersion;
use quick_xml::escape::resolve_predefined_entity;
use quick_xml::events::{BytesStart, Event};
use quick_xml::name::{Namespace, ResolveResult};
use quick_xml::reader::NsReader;

use super::CxfError;
use crate::measurement::readings::told;

/// Namespace of `CxF3`.
pub(super) const NAMESPACE: &str = "http://colorexchangeformat.com/CxF3-core";
/// Elements inside each other; `CxF3` itself nests ten.
const DEPTH: usize = 64;
/// Elements of a document, and bytes of one tag.
const ELEMENTS: usize = 200_000;
const TAG_BYTES: usize = 64 << 10;
/// Attributes that are read; no other is kept.
const ATTRIBUTES: [&str; 8] = [
    "Id",
    "Name",
    "ObjectType",
    "ColorSpecification",
    "Notation",
    "StartWL",
    "Increment",
    "WL",
];
/// Encodings whose text is UTF-8.
const ENCODINGS: [&str; 3] = ["UTF-8", "UTF8", "US-ASCII"];

/// An element: its name without prefix, what it says and what is in it.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Element {
    pub name: String,
    attributes: Vec<(&'static str, String)>,
    pub text: String,
    pub children: Vec<Element>,
}

impl Element {
    pub fn attribute(&self, name: &str) -> Option<&str> {
        let mut attributes = self.attributes.iter();
        attributes
            .find(|(own, _)| *own == name)
            .map(|(_, value)| value.trim())
    }

    pub fn child(&self, name: &str) -> Option<&Self> {
        self.children.iter().find(|child| child.name == name)
    }

    /// The element at a path of names.
    pub fn at(&self, path: &[&str]) -> Option<&Self> {
        path.iter()
            .try_fold(self, |element, name| element.child(name))
    }

    /// Text of a child, unless it is empty.
    pub fn said(&self, name: &str) -> Option<&str> {
        let text = self.child(name)?.text.trim();
        (!text.is_empty()).then_some(text)
    }

    pub fn all<'a>(&'a self, name: &'a str) -> impl Iterator<Item = &'a Self> {
        self.children.iter().filter(move |child| child.name == name)
    }
}

/// Reads a document to its end; its root is `CxF3`'s.
pub(super) fn read_document(text: &str) -> Result<Element, CxfError> {
    let mut reader = NsReader::from_str(text);
    // Elements that are begun and not ended, the root first; of those not in the namespace only how many.
    let (mut open, mut foreign) = (Vec::<Element>::new(), 0_usize);
    let (mut root, mut elements) = (None, 0_usize);
    loop {
        let position = reader.buffer_position();
        let wrong = |reason: &dyn std::fmt::Display| CxfError::Xml {
            position,
            reason: reason.to_string(),
        };
        let (space, event) = reader.read_resolved_event().map_err(|e| wrong(&e))?;
        let ours = space == ResolveResult::Bound(Namespace(NAMESPACE));
        let empty = matches!(event, Event::Empty(_));
        match event {
            Event::Start(tag) | Event::Empty(tag) => {
                elements += 1;
                if elements > ELEMENTS {
                    return Err(CxfError::Elements { accepted: ELEMENTS });
                }
                if open.len() + foreign >= DEPTH {
                    return Err(CxfError::Depth { accepted: DEPTH });
                }
                if open.is_empty()
                    && (!ours || tag.local_name().into_inner() != "CxF" || root.is_some())
                {
                    return Err(CxfError::Root {
                        found: told(tag.name().into_inner()),
                    });
                }
                if foreign > 0 || !ours {
                    foreign += usize::from(!empty);
                } else {
                    open.push(element(&tag).map_err(|e| wrong(&e))?);
                    if empty {
                        close(&mut open, &mut root);
                    }
                }
            }
            Event::End(_) if foreign > 0 => foreign -= 1,
            Event::End(_) => close(&mut open, &mut root),
            Event::Text(piece) => {
                let text = piece.xml10_content();
                if open.is_empty() && !text.trim().is_empty() {
                    return Err(wrong(&outside(text.trim())));
                }
                write(&mut open, foreign, &text);
            }
            Event::CData(piece) if open.is_empty() => {
                return Err(wrong(&outside(&piece.xml10_content())));
            }
            Event::CData(piece) => write(&mut open, foreign, &piece.xml10_content()),
            Event::GeneralRef(entity) => {
                if open.is_empty() {
                    return Err(wrong(&outside(&format!("&{};", entity.into_inner()))));
                }
                let character = entity.resolve_char_ref().map_err(|e| wrong(&e))?;
                let name = entity.into_inner();
                match (character, resolve_predefined_entity(&name)) {
                    (Some(c), _) => write(&mut open, foreign, c.encode_utf8(&mut [0; 4])),
                    (None, Some(text)) => write(&mut open, foreign, text),
                    (None, None) => return Err(CxfError::Entity { name: told(&name) }),
                }
            }
            Event::DocType(_) => return Err(CxfError::DocumentType),
            Event::Decl(declaration) => {
                if let Some(encoding) = declaration.encoding() {
                    let encoding = encoding.map_err(|e| wrong(&e))?;
                    let mut ours = ENCODINGS.iter();
                    if !ours.any(|own| own.eq_ignore_ascii_case(&encoding)) {
                        let found = told(&encoding);
                        return Err(CxfError::Encoding { found });
                    }
                }
            }
            Event::Comment(_) | Event::PI(_) => {}
            Event::Eof => break,
        }
    }
    match root {
        Some(root) if open.is_empty() => Ok(root),
        _ => Err(CxfError::Xml {
            position: text.len() as u64,
            reason: "the document ends before its root element does".to_owned(),
        }),
    }
}

fn element(tag: &BytesStart) -> Result<Element, String> {
    if tag.len() > TAG_BYTES {
        return Err(format!(
            "a tag of {} bytes, accepted are {TAG_BYTES}",
            tag.len()
        ));
    }
    let mut attributes = Vec::new();
    // Which attributes stand twice is looked for among those that are kept: of all it takes the square of their number.
    for attribute in tag.attributes().with_checks(false) {
        let attribute = attribute.map_err(|e| e.to_string())?;
        let own = attribute.key.into_inner();
        let Some(key) = ATTRIBUTES.into_iter().find(|key| *key == own) else {
            continue;
        };
        if attributes.iter().any(|(other, _)| *other == key) {
            return Err(format!(
                "the attribute {key} stands twice in a tag, accepted is once"
            ));
        }
        let value = attribute
            .normalized_value(XmlVersion::Implicit1_0)
            .map_err(|e| e.to_string())?;
        attributes.push((key, value.into_owned()));
    }
    Ok(Element {
        name: tag.local_name().into_inner().to_owned(),
        attributes,
        ..Element::default()
    })
}

/// Why text cannot stand before or after the root.
fn outside(text: &str) -> String {
    format!(
        "the text {:?} stands outside the root element, accepted is nothing there but space and comments",
        told(text)
    )
}

/// Ends the element begun last.
fn close(open: &mut Vec<Element>, root: &mut Option<Element>) {
    let Some(ended) = open.pop() else { return };
    match open.last_mut() {
        Some(parent) => parent.children.push(ended),
        None => *root = Some(ended),
    }
}

fn write(open: &mut [Element], foreign: usize, text: &str) {
    if foreign == 0
        && let Some(element) = open.last_mut()
    {
        element.text.push_str(text);
    }
}
