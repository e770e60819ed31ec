//! The sample paints on the shelf of a new service.

use super::app::App;
use super::ids;
use super::problem::Problem;
use super::workbench::Workbench;
use crate::accuracy::Profile;
use crate::workshop::SAMPLES;

/// Puts every sample paint that is not there yet into the catalogue, under an id that never changes.
///
/// # Errors
///
/// [`Problem`] when the store fails or a sample cannot be made.
pub async fn load_samples(app: &App) -> Result<(), Problem> {
    let bench = Workbench::new(rayon::current_num_threads(), SAMPLES.len());
    for sample in &SAMPLES {
        let id = ids::made_of("p_", &("sample", sample.name));
        if app.has_paint(&id).await? {
            continue;
        }
        let paint = bench
            .run(move || sample.build(&Profile::standard(), &|_| ()))
            .await?;
        app.keep_paint(&id, paint.map_err(Problem::internal)?, None)
            .await?;
    }
    Ok(())
}
