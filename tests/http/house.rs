//! A service on a port of its own, with works that are quick, countable, and can be told to be slow or to break.

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use carpaint::accuracy::Profile;
use carpaint::blend::{Blend, BlendSettings, Ingredient, RealisationWeights};
use carpaint::paint::{CarPaint, ColorTable, Lobe, PaintFile, Provenance, certify};
use carpaint::service::{
    App, Asked, Estimate, Fault, Format, Gloss, IngestOrder, MadeFile, Picked, PictureFormat,
    Progress, Readings, ServiceConfig, Target, Thing, View, Works, Workshop, WorkshopError, open,
    serve,
};
use carpaint::workshop::{Environment, EstimatedError, Inside, sample_by_name};
use serde_json::{Value, json};
use tokio::net::TcpListener;
use tokio::sync::oneshot;
use tokio::task::JoinHandle;

use crate::client::{Answer, ask};

/// Works that do what the upload says: `silver …` and such become a paint; `slow`, `panic` and `broken` do as told.
#[derive(Debug)]
pub struct Pretend;

fn refuse(fault: Fault, message: impl Into<String>) -> WorkshopError {
    WorkshopError {
        fault,
        field: None,
        inside: Inside::default(),
        message: message.into(),
    }
}

impl Works for Pretend {
    fn ingest(
        &self,
        upload: &Path,
        order: &IngestOrder,
        progress: Progress<'_>,
        ended: &dyn Fn(&'static str),
    ) -> Result<PaintFile, WorkshopError> {
        let bytes =
            std::fs::read(upload).map_err(|error| refuse(Fault::Internal, error.to_string()))?;
        let words = String::from_utf8_lossy(&bytes);
        if words.starts_with("not") {
            return Err(refuse(
                Fault::Input,
                "the upload: this is no measurement".to_owned(),
            ));
        }
        assert!(!words.starts_with("panic"), "told to");
        if words.starts_with("slow") {
            let begun = Instant::now();
            while begun.elapsed() < Duration::from_secs(4) {
                progress(begun.elapsed().as_secs_f32() / 4.0);
                std::thread::sleep(Duration::from_millis(5));
            }
        }
        ended("fit");
        let seed = f64::from(blake3::hash(&bytes).as_bytes()[0]) / 256.0;
        let lobes = vec![Lobe {
            weight: [0.1; 3],
            alpha: 0.1 + seed,
            f0: 0.5,
        }];
        let paint = CarPaint {
            coat: None,
            diffuse: [seed, 0.2, 0.3],
            lobes,
            color_table: ColorTable::white(),
            flakes: None,
        };
        Ok(PaintFile {
            name: order.name.clone().unwrap_or_else(|| "unnamed".to_owned()),
            provenance: Provenance {
                source: "package".to_owned(),
                ..Provenance::default()
            },
            energy: certify(&paint),
            paint,
            clustering: None,
            residuals: None,
            readings: None,
            warnings: Vec::new(),
        })
    }

    fn blend(
        &self,
        paints: &[&PaintFile],
        _: &Profile,
        progress: Progress<'_>,
    ) -> Result<Blend, WorkshopError> {
        std::thread::sleep(Duration::from_millis(100));
        let ingredients: Vec<Ingredient<'_>> = paints
            .iter()
            .map(|file| Ingredient {
                name: &file.name,
                paint: &file.paint,
            })
            .collect();
        Blend::new(&ingredients, &BlendSettings::default(), progress)
            .map_err(|e| refuse(Fault::Usage, e.to_string()))
    }

    fn realise(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        format: Format,
        _: &Profile,
    ) -> Result<MadeFile, WorkshopError> {
        std::thread::sleep(Duration::from_millis(50));
        let diffuse = match thing {
            Thing::Paint(file) => file.paint.diffuse,
            Thing::Blend(blend) => {
                let weights = weights.expect("a blend has weights");
                assert!(weights.flake_saturation != 666.0, "told to");
                blend
                    .realise(weights)
                    .map_err(|e| refuse(Fault::Usage, e.to_string()))?
                    .paint
                    .diffuse
            }
        };
        Ok(MadeFile {
            bytes: format!("{format:?} {diffuse:?}").into_bytes(),
            accuracy: "flakes-lab=0.25".to_owned(),
            report: json!({}),
            stages: vec![("encode", Duration::from_millis(50))],
        })
    }

    fn bundle(&self, blend: &Thing, profile: &Profile) -> Result<MadeFile, WorkshopError> {
        carpaint::service::Workshop::new(carpaint::paint::Limits::default()).bundle(blend, profile)
    }

    fn preview(
        &self,
        thing: &Thing,
        weights: Option<&RealisationWeights>,
        view: &View,
        _: Option<&Environment>,
        format: PictureFormat,
        progress: Progress<'_>,
    ) -> Result<MadeFile, WorkshopError> {
        let paint = self
            .realise(thing, weights, Format::Json, &Profile::default())?
            .bytes;
        // A tall picture takes its time.
        let begun = Instant::now();
        while view.size[1] == 4000 && begun.elapsed() < Duration::from_secs(4) {
            progress(0.5);
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(MadeFile {
            bytes: [format!("{format:?} {view:?} ").into_bytes(), paint].concat(),
            accuracy: "sampling-mean-de2000=0.5".to_owned(),
            report: json!({ "clamps": [], "plan": "whatever" }),
            stages: vec![("draw", begun.elapsed())],
        })
    }

    fn readings(&self, paint: &Thing, angles: Option<&[f64]>) -> Result<Readings, WorkshopError> {
        carpaint::service::Workshop::new(carpaint::paint::Limits::default()).readings(paint, angles)
    }

    fn readings_document(
        &self,
        paint: &Thing,
        angles: Option<&[f64]>,
    ) -> Result<String, WorkshopError> {
        let works = carpaint::service::Workshop::new(carpaint::paint::Limits::default());
        works.readings_document(paint, angles)
    }

    fn gloss(&self, paint: &Thing) -> Result<Gloss, WorkshopError> {
        carpaint::service::Workshop::new(carpaint::paint::Limits::default()).gloss(paint)
    }

    fn estimate(&self, _: &Asked<'_>, profile: &Profile) -> Result<Estimate, WorkshopError> {
        Ok(Estimate {
            profile: profile.name(),
            knobs: *profile,
            seconds: 0.5,
            stages: Vec::new(),
            bytes: 1000,
            error: EstimatedError {
                value: Some(0.25),
                unit: "Lab",
                unknown: None,
                at_least: None,
            },
        })
    }

    fn pick(&self, asked: &Asked<'_>, target: &Target) -> Result<Picked, WorkshopError> {
        let draft = target.max_error.is_none_or(|most| most > 1.0);
        let profile = if draft {
            Profile::draft()
        } else {
            Profile::reference()
        };
        Ok(Picked {
            target: *target,
            met: true,
            estimate: self.estimate(asked, &profile)?,
            tried: 2,
            searched: 0.0,
        })
    }

    fn notes(&self, _: &Blend, _: &Profile) -> Vec<String> {
        Vec::new()
    }

    fn describe(&self, thing: &Thing) -> Value {
        match thing {
            Thing::Paint(file) => {
                json!({ "name": file.name, "hash": file.paint.content_hash().to_hex().to_string() })
            }
            Thing::Blend(blend) => {
                json!({ "paints": blend.ingredients().map(|(name, _)| name).collect::<Vec<_>>() })
            }
        }
    }
}

/// A running service.
pub struct House {
    pub address: SocketAddr,
    stop: Option<oneshot::Sender<()>>,
    served: JoinHandle<()>,
}

/// The file of a sample of few clusters.
pub fn sample_file(name: &str) -> Vec<u8> {
    let sample = sample_by_name(name).expect("a sample");
    let paint = sample.build(&Profile::draft(), &|_| ()).expect("builds");
    paint.to_bytes().expect("finite")
}

impl House {
    pub async fn open(data: &Path) -> Self {
        Self::with(ServiceConfig::new(data.to_owned())).await
    }

    /// With the real workshop behind it.
    pub async fn real(data: &Path) -> Self {
        let config = ServiceConfig::new(data.to_owned());
        let works = Arc::new(Workshop::new(config.limits));
        Self::of(config, works).await
    }

    pub async fn with(config: ServiceConfig) -> Self {
        Self::of(config, Arc::new(Pretend)).await
    }

    async fn of(config: ServiceConfig, works: Arc<dyn Works>) -> Self {
        let app: App = open(config, works).await.expect("opens");
        app.set_ready();
        let listener = TcpListener::bind("127.0.0.1:0").await.expect("a port");
        let address = listener.local_addr().expect("an address");
        let (stop, stopped) = oneshot::channel();
        let served = tokio::spawn(serve(app, listener, async {
            let _ = stopped.await;
        }));
        Self {
            address,
            stop: Some(stop),
            served,
        }
    }

    /// Ends the service as SIGTERM does.
    pub async fn close(mut self) {
        if let Some(stop) = self.stop.take() {
            let _ = stop.send(());
        }
        self.served.await.expect("ends");
    }

    pub async fn ask(
        &self,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
        body: &[u8],
    ) -> Answer {
        ask(self.address, method, path, headers, body).await
    }

    pub async fn get(&self, path: &str) -> Answer {
        self.ask("GET", path, &[], b"").await
    }

    /// Uploads something and gives its id.
    pub async fn paint(&self, words: &str) -> String {
        let answer = self
            .ask(
                "POST",
                "/v1/paints?name=some",
                &[("Prefer", "wait=60")],
                words.as_bytes(),
            )
            .await;
        assert!([200, 201].contains(&answer.status), "{answer:?}");
        answer.json()["id"].as_str().expect("an id").to_owned()
    }

    /// Uploads a sample as a file and gives its id; for a house with the real workshop.
    pub async fn sample(&self, name: &str) -> String {
        let headers = [("Prefer", "wait=300")];
        let answer = self
            .ask("POST", "/v1/paints", &headers, &sample_file(name))
            .await;
        assert_eq!(answer.status, 201, "{}", answer.text());
        answer.json()["id"].as_str().expect("an id").to_owned()
    }

    /// Uploads something and does not wait for its job.
    pub async fn submit(&self, words: &[u8]) -> Answer {
        let headers = [("Prefer", "respond-async")];
        self.ask("POST", "/v1/paints", &headers, words).await
    }

    /// Asks for a job until it is as wanted, and gives it; panics with its last state after a minute.
    pub async fn until(&self, job: &str, wanted: impl Fn(&Value) -> bool) -> Value {
        let begun = Instant::now();
        loop {
            let state = self.get(job).await.json();
            if wanted(&state) {
                return state;
            }
            assert!(begun.elapsed() < Duration::from_mins(1), "{state}");
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
    }

    /// Blends paints and gives the blend's id.
    pub async fn blend(&self, paints: &[&str]) -> String {
        let body = json!({ "paints": paints }).to_string();
        let answer = self.post_json("/v1/blends", &body).await;
        assert!([200, 201].contains(&answer.status), "{answer:?}");
        answer.json()["id"].as_str().expect("an id").to_owned()
    }

    pub async fn post_json(&self, path: &str, body: &str) -> Answer {
        let headers = [("Content-Type", "application/json"), ("Prefer", "wait=60")];
        self.ask("POST", path, &headers, body.as_bytes()).await
    }

    pub async fn count(&self, name: &str) -> f64 {
        let text = self.get("/metrics").await.text();
        let line = text
            .lines()
            .find(|line| line.starts_with(&format!("{name} ")));
        line.and_then(|line| line.split(' ').nth(1))
            .and_then(|n| n.parse().ok())
            .unwrap_or_else(|| panic!("{name}: {text}"))
    }
}
