//! Colors of all paints at the angles of the six-angle instruments, noted beside the catalogue so that lists can be
//! ordered by them.
//!
//! They are noted when a paint is kept. What has none yet, a paint of an earlier version, is read when somebody asks.

use std::sync::Arc;

use futures::StreamExt;
use futures::stream;

use super::works::{Thing, Works};
use crate::paint::PaintFile;
use crate::service::app::App;
use crate::service::http::Problem;
use crate::service::ids;
use crate::store::{Hash, NotedPaint, Visibility};

/// Numbers of one paint: L, a, b at each of the six angles.
const NUMBERS: usize = 18;

/// A paint, by its colors.
#[derive(Clone, Debug, PartialEq)]
pub struct Colored {
    /// Address.
    pub id: String,
    /// L, a, b under D65 for the 2° observer, light at 45°, at each of [`crate::paint::ASPECULAR_DEG`].
    pub labs: [[f64; 3]; 6],
}

/// What the numbers are noted as: another model reads other colors.
fn kind() -> String {
    format!("readings {}", ids::MODEL)
}

/// Reads a paint at the six angles.
///
/// # Errors
///
/// [`Problem`] for a paint that cannot be read.
pub fn read(works: &dyn Works, paint: &Thing) -> Result<Vec<f64>, Problem> {
    let readings = works.readings(paint, None).map_err(Problem::internal)?;
    Ok(readings
        .rows
        .iter()
        .flat_map(|[_, lab @ ..]| *lab)
        .collect())
}

/// Notes what was read of a paint's blob.
///
/// # Errors
///
/// [`Problem`] when the store fails.
pub async fn note(app: &App, paint: Hash, numbers: &[f64]) -> Result<(), Problem> {
    Ok(app.catalogue.note(paint, &kind(), numbers).await?)
}

/// The colors of all paints of this visibility whose name or source contains `q`. A paint whose file does not read back
/// is left out, and the log says so.
///
/// # Errors
///
/// [`Problem`] when the store fails.
pub async fn of_paints(
    app: &App,
    q: Option<&str>,
    visibility: Visibility,
) -> Result<Vec<Colored>, Problem> {
    let kind = kind();
    let noted = || app.catalogue.noted(q, visibility, &kind);
    let mut all = noted().await?;
    if all.iter().any(|paint| paint.numbers.is_none()) {
        // Who asks at the same time waits, and then finds them read.
        let _one_at_a_time = app.reading.lock().await;
        let missing = noted().await?.into_iter().filter(|p| p.numbers.is_none());
        let at_once = rayon::current_num_threads();
        let read = stream::iter(missing).map(|paint| read_and_note(app, paint));
        let mut read = read.buffer_unordered(at_once);
        while let Some(done) = read.next().await {
            done?;
        }
        all = noted().await?;
    }
    Ok(all.into_iter().filter_map(colored).collect())
}

fn colored(paint: NotedPaint) -> Option<Colored> {
    let numbers: [f64; NUMBERS] = paint.numbers?.try_into().ok()?;
    let labs = std::array::from_fn(|k| [numbers[3 * k], numbers[3 * k + 1], numbers[3 * k + 2]]);
    Some(Colored { id: paint.id, labs })
}

async fn read_and_note(app: &App, paint: NotedPaint) -> Result<(), Problem> {
    let Some(bytes) = app.blobs.read(paint.paint).await? else {
        // Deleted a moment ago.
        return Ok(());
    };
    let (works, limits) = (Arc::clone(&app.works), app.config.limits);
    let read = app.bench.run(move || {
        let file = PaintFile::from_bytes(&bytes, &limits).map_err(Problem::internal)?;
        read(&*works, &Thing::Paint(Box::new(file)))
    });
    if let Ok(numbers) = read.await? {
        return note(app, paint.paint, &numbers).await;
    }
    tracing::error!(paint = paint.id, "a paint on record cannot be read");
    // Noted too, so that it is not tried at every question.
    note(app, paint.paint, &[]).await
}
