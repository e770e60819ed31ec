//! Whether a paint is published: lists show it, or only those who know its address find it.

use axum::extract::State;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::documents::PaintDocument;
use crate::service::app::App;
use crate::service::http::{Address, Answer, Json, NoQuery, PaintProblems, Problem};
use crate::service::work::runner;
use crate::store;

/// Whether lists show a paint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Visibility {
    /// They do.
    #[default]
    Published,
    /// Only where private paints are asked for.
    Private,
}

impl From<store::Visibility> for Visibility {
    fn from(stored: store::Visibility) -> Self {
        match stored {
            store::Visibility::Published => Self::Published,
            store::Visibility::Private => Self::Private,
        }
    }
}

impl From<Visibility> for store::Visibility {
    fn from(asked: Visibility) -> Self {
        match asked {
            Visibility::Published => Self::Published,
            Visibility::Private => Self::Private,
        }
    }
}

/// What changes of a paint.
#[derive(Debug, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PaintChange {
    /// Whether lists show it.
    visibility: Visibility,
}

/// Publish a paint, or take it out of lists.
#[utoipa::path(
    patch, operation_id = "change_paint", path = "/v1/paints/{id}", tag = "paints", params(("id" = String, Path, description = "Paint")),
    request_body = PaintChange,
    responses(
        (status = 200, description = "The paint as it is now", body = PaintDocument),
        PaintProblems,
    )
)]
pub async fn change(
    State(app): State<App>,
    Address(id): Address<String>,
    _: NoQuery,
    Json(change): Json<PaintChange>,
) -> Result<Answer, Problem> {
    let (on, shown) = (app.clone(), id.clone());
    let visibility = change.visibility.into();
    runner::to_its_end(async move { on.show_paint(&shown, visibility).await }).await?;
    Ok(app.paint(&id).await?.told())
}
