//! What is told about paints and blends.

use bytes::Bytes;
use serde::Serialize;
use serde_json::{Map, Value, json};
use utoipa::ToSchema;

use super::visibility::Visibility;
use crate::accuracy::ResultError;
use crate::service::work::{BlendOptions, TargetDocument};
use crate::store::{CachedResult, Hash, PaintRecord};

/// A paint: everything known about it.
#[derive(Debug, Serialize, ToSchema)]
pub struct PaintDocument {
    /// Address: `p_` and 32 hexadecimal digits.
    #[schema(pattern = "^p_[0-9a-f]{32}$")]
    pub id: String,
    /// Name.
    pub name: String,
    /// BLAKE3 of the physical content: equal for equal paints of different names.
    pub hash: String,
    /// Where it comes from.
    #[schema(value_type = Object)]
    pub provenance: Value,
    /// Coat, diffuse albedo, lobes, color table.
    #[schema(value_type = Object)]
    pub parameters: Value,
    /// Flake statistics: angles, clusters, grain and lifetime; null for a solid color.
    #[schema(value_type = Option<Object>)]
    pub flakes: Value,
    /// Lab at the six instrument geometries.
    #[schema(value_type = Object)]
    pub readings: Value,
    /// How far the fit is from its measurement, with the floor beside it; null where nothing was fitted.
    #[schema(value_type = Option<Object>)]
    pub residuals: Value,
    /// How far its flakes are from the pixels they were made of, Lab, with the terms of it and how each is known.
    #[schema(value_type = ResultError)]
    pub error: Value,
    /// How far the paint is from the multi-angle readings that came with its measurement; null where none did.
    #[schema(value_type = Option<Object>)]
    pub multi_angle: Value,
    /// What had to be clamped, of a realised paint.
    #[schema(value_type = Vec<Object>)]
    pub clamps: Value,
    /// Energy certificate: directional albedo at six incidences.
    #[schema(value_type = Object)]
    pub energy: Value,
    /// What the user should know.
    pub warnings: Vec<String>,
    /// Whether lists show it.
    pub visibility: Visibility,
    /// In the answer to a request with a target: what was picked for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<TargetDocument>,
    /// Addresses of what can be made of it.
    #[schema(value_type = Object)]
    pub links: Value,
}

/// A blend: its paints and how they correspond.
#[derive(Debug, Serialize, ToSchema)]
pub struct BlendDocument {
    /// Address: `b_` and 32 hexadecimal digits.
    #[schema(pattern = "^b_[0-9a-f]{32}$")]
    pub id: String,
    /// Names and content hashes of the paints, in the order of weights.
    #[schema(value_type = Vec<Object>)]
    pub paints: Value,
    /// How the correspondence was found.
    #[schema(value_type = Object)]
    pub settings: Value,
    /// How good it is: slices, clusters, cost, gap to the dual bound.
    #[schema(value_type = Object)]
    pub correspondence: Value,
    /// How far its flakes are from the reference, Lab, with the terms of it and how each is known.
    #[schema(value_type = ResultError)]
    pub error: Value,
    /// Common angles and the paints' textures; null when no paint has flakes.
    #[schema(value_type = Option<Object>)]
    pub flakes: Value,
    /// What the caller should know: knobs that could not be turned any more, slices that were mixed, reduced, smoothed.
    pub notes: Vec<String>,
    /// What was asked for.
    #[schema(value_type = Object)]
    pub request: Value,
    /// In the answer to a request with a target: what was picked for it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target: Option<TargetDocument>,
    /// Addresses of what can be made of it.
    #[schema(value_type = Object)]
    pub links: Value,
}

/// A paint in a list.
#[derive(Debug, Serialize, ToSchema)]
pub struct PaintSummary {
    /// Address.
    #[schema(pattern = "^p_[0-9a-f]{32}$")]
    pub id: String,
    /// Name.
    pub name: String,
    /// Kind of source: `package`, `rgl`, `mpi-2005`, `merl`, `csv`, `cxf`, `sample`, `blend`.
    pub source: String,
    /// Whether lists show it.
    pub visibility: Visibility,
    /// BLAKE3 of the physical content.
    pub hash: String,
    /// Where it is.
    #[schema(format = "uri-reference")]
    pub href: String,
    /// Of paints near a color: CIEDE2000 between the two at the angle asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0)]
    pub delta_e: Option<f64>,
    /// Of paints near a color: L, a, b of the paint at the angle asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Vec<f64>>, min_items = 3, max_items = 3)]
    pub lab: Option<[f64; 3]>,
}

impl From<PaintRecord> for PaintSummary {
    fn from(record: PaintRecord) -> Self {
        Self {
            href: format!("/v1/paints/{}", record.id),
            id: record.id,
            name: record.name,
            source: record.source,
            visibility: record.visibility.into(),
            hash: record.content.to_string(),
            delta_e: None,
            lab: None,
        }
    }
}

/// A page of paints.
#[derive(Debug, Serialize, ToSchema)]
pub struct PaintList {
    /// The paints, in the order they came, or those nearest to a color first.
    pub paints: Vec<PaintSummary>,
    /// Cursor of the next page; null after the last.
    pub next: Option<String>,
}

/// The document of a description: with its id, and what the service adds.
pub fn described(id: &str, description: Value, extra: Value) -> CachedResult {
    let mut document = match description {
        Value::Object(fields) => fields,
        other => Map::from_iter([("description".to_owned(), other)]),
    };
    document.insert("id".to_owned(), json!(id));
    if let Value::Object(extra) = extra {
        document.extend(extra);
    }
    let bytes = Bytes::from(Value::Object(document).to_string());
    CachedResult {
        hash: Hash::of(&bytes),
        bytes,
    }
}

/// Addresses of what can be made of a paint.
pub fn of_paint(record: &PaintRecord) -> Value {
    let base = format!("/v1/paints/{}", record.id);
    let measurement = record.measurement.map(|_| format!("{base}/measurement"));
    json!({
        "visibility": Visibility::from(record.visibility),
        "links": {
            "self": base,
            "paint": format!("{base}/paint"),
            "measurement": measurement,
            "preview": format!("{base}/preview.png"),
            "realisation": format!("{base}/realisation.zip"),
            "glb": format!("{base}/realisation.glb"),
            "readings": format!("{base}/readings"),
        }
    })
}

/// What was asked for, and addresses of what can be made of it.
pub fn of_blend(id: &str, paints: &[String], options: &BlendOptions, notes: &[String]) -> Value {
    let base = format!("/v1/blends/{id}");
    let weights =
        vec![(1.0 / f64::from(u32::try_from(paints.len()).unwrap_or(1))).to_string(); paints.len()]
            .join(",");
    json!({
        "notes": notes,
        "request": { "paints": paints, "profile": options.profile.name(), "knobs": options.profile },
        "links": {
            "self": base,
            "paints": paints.iter().map(|paint| format!("/v1/paints/{paint}")).collect::<Vec<_>>(),
            "preview": format!("{base}/preview.png?weights={weights}"),
            "bundle": format!("{base}/bundle.zip"),
            "realisation": format!("{base}/realisation.zip?weights={weights}"),
            "glb": format!("{base}/realisation.glb?weights={weights}"),
        }
    })
}
