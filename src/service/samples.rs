//! The sample paints on the shelf of a new service.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::app::App;
use super::http::Problem;
use super::ids;
use super::work::{Workbench, call_off};
use crate::accuracy::Profile;
use crate::store::Visibility;
use crate::workshop::{SAMPLES, Sample};

/// The id of a sample: of what it is made of, so that another recipe is another paint.
fn id_of(sample: &Sample, profile: &Profile) -> String {
    ids::made_of(
        "p_",
        &("sample", sample.name, sample.recipe(), profile.flakes),
    )
}

/// Puts every sample paint that is not there yet into the catalogue, and takes out those of earlier recipes. Stops
/// where it is when the service goes down, and says whether it came to its end.
///
/// # Errors
///
/// [`Problem`] when the store fails or a sample cannot be made.
pub async fn load_samples(app: &App) -> Result<bool, Problem> {
    let profile = Arc::new(Profile::standard());
    let bench = Workbench::new(rayon::current_num_threads(), SAMPLES.len());
    let mut current = BTreeSet::new();
    for sample in &SAMPLES {
        let id = id_of(sample, &profile);
        if !app.has_paint(&id).await? {
            let (on, profile) = (app.clone(), Arc::clone(&profile));
            let build = bench.run_or_call_off(move || {
                sample.build(&profile, &|_| {
                    if on.is_stopping() {
                        call_off();
                    }
                })
            });
            let Ok(paint) = build.await? else {
                return Ok(false);
            };
            let paint = paint.map_err(Problem::internal)?;
            let written = app.written_out(paint).await?;
            app.keep_paint(&id, &written, None).await?;
        }
        current.insert(id);
    }
    forget_earlier(app, &current).await?;
    Ok(true)
}

/// Takes out samples that this version makes otherwise. Uploads of samples stay, and so do blends.
async fn forget_earlier(app: &App, current: &BTreeSet<String>) -> Result<(), Problem> {
    for visibility in [Visibility::Published, Visibility::Private] {
        let mut cursor = None;
        loop {
            let page = app
                .catalogue
                .paints(Some("sample"), visibility, cursor, 200)
                .await?;
            let earlier = page.paints.iter().filter(|paint| {
                paint.source == "sample"
                    && paint.measurement.is_none()
                    && !current.contains(&paint.id)
            });
            for paint in earlier {
                app.forget_paint(&paint.id).await?;
            }
            cursor = page.next;
            if cursor.is_none() {
                break;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::{About, glb};
    use crate::paint::{Chi, Limits, Reflectance, instrument_pairs};
    use crate::render::{Scene, Shape, render};
    use crate::service::{ServiceConfig, Workshop};
    use crate::workshop::sample_by_name;

    /// What `MODEL` stands for: bytes that were kept under it must not change under it.
    #[test]
    fn bytes_that_change_ask_for_another_model_number() {
        let sample = sample_by_name("bmw339").expect("a sample");
        let paint = sample.build(&Profile::draft(), &|_| ()).expect("builds");
        let flakes = paint.paint.flakes.as_ref().expect("flakes");
        let reflectance = Reflectance::new(&paint.paint);
        let read = instrument_pairs().map(|(wi, wo)| {
            let factor = reflectance.evaluate(wi, wo, Chi::Table);
            format!("{:.4}", crate::color::luminance(factor))
        });
        let light = [Shape::Sphere, Shape::Panel].map(|shape| {
            let mut scene = Scene::new(shape, [24, 24]);
            scene.samples_per_pixel = 16;
            let drawn = render(&paint.paint, &scene, &Limits::default(), &|_| ());
            let film = drawn.expect("a picture").film;
            let sum: f32 = film.pixels().iter().map(|pixel| pixel[1]).sum();
            format!("{:.3}", sum / (24.0 * 24.0))
        });
        let about = About {
            name: paint.name.clone(),
            provenance: paint.provenance.clone(),
            report: serde_json::Value::Null,
        };
        let file = glb(&paint.paint, &about).expect("a GLB");
        let length = u32::from_le_bytes(file[12..16].try_into().expect("four")) as usize;
        let document: serde_json::Value =
            serde_json::from_slice(&file[20..20 + length]).expect("JSON");
        let material = &document["materials"][0];
        let seen = [
            format!("model {}", ids::MODEL),
            format!("{} slices", flakes.slices()),
            format!(
                "{} clusters, {:.1} Lab",
                flakes.clusters(),
                flakes
                    .lower
                    .iter()
                    .map(|corner| f64::from(corner[0]))
                    .sum::<f64>()
                    / flakes.clusters() as f64
            ),
            format!("grain {:.1}", flakes.texture.grain_um),
            format!("instrument {}", read.join(" ")),
            format!("pictures {}", light.join(" ")),
            format!(
                "glTF {:.2}",
                material["pbrMetallicRoughness"]["roughnessFactor"]
                    .as_f64()
                    .expect("a number")
            ),
            format!(
                "ball {:.4} m",
                document["accessors"][0]["max"][0].as_f64().expect("m")
            ),
            format!("albedo {:.3}", paint.energy.albedo[0]),
        ];
        assert_eq!(
            seen, GOLDEN,
            "samples, pictures or GLBs are others now: count ids::MODEL up, and bless this"
        );
    }

    const GOLDEN: [&str; 9] = [
        "model 14",
        "169 slices",
        "2002 clusters, 91.7 Lab",
        "grain 15.9",
        "instrument 2.5016 1.4479 0.5679 0.1028 0.0167 0.0046",
        "pictures 0.297 0.493",
        "glTF 0.41",
        "ball 0.0098 m",
        "albedo 0.852",
    ];

    #[tokio::test]
    async fn samples_of_an_earlier_recipe_leave_and_uploads_stay() {
        let data = tempfile::tempdir().expect("a folder");
        let config = ServiceConfig::new(data.path().to_owned());
        let works = Arc::new(Workshop::new(Limits::default()));
        let app = App::open(config, works).await.expect("opens");
        let white = || {
            let sample = sample_by_name("white").expect("a sample");
            sample.build(&Profile::draft(), &|_| ()).expect("builds")
        };
        let kept = |kind: &str| ids::made_of("p_", &kind);
        let upload = app.blobs.put("upload".into()).await.expect("is kept").hash;
        for (kind, measurement) in [("now", None), ("before", None), ("upload", Some(upload))] {
            let written = app.written_out(white()).await.expect("is written");
            app.keep_paint(&kept(kind), &written, measurement)
                .await
                .expect("is kept");
        }
        let current = BTreeSet::from([kept("now")]);
        forget_earlier(&app, &current).await.expect("forgets");
        for (kind, there) in [("now", true), ("before", false), ("upload", true)] {
            assert_eq!(app.has_paint(&kept(kind)).await, Ok(there), "{kind}");
        }
    }
}
