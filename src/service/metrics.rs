//! What is counted, as Prometheus reads it. Every service has its own counts.

use std::time::Duration;

use axum::http::{Method, StatusCode};
use metrics::{Counter, Key, Label, Level, Metadata, Recorder, Unit};
use metrics_exporter_prometheus::{PrometheusBuilder, PrometheusHandle, PrometheusRecorder};

const METADATA: Metadata<'static> = Metadata::new("carpaint", Level::INFO, None);

/// Seconds between which request times are told apart.
const BUCKETS: [f64; 9] = [0.0005, 0.002, 0.01, 0.05, 0.2, 1.0, 5.0, 20.0, 100.0];

/// The counts of one service.
pub struct Metrics {
    recorder: PrometheusRecorder,
    handle: PrometheusHandle,
    /// Uploads that were fitted.
    pub paints_fitted: Counter,
    /// Correspondences that were found.
    pub blends_computed: Counter,
    /// Realisations that were computed and written, not taken from the cache.
    pub realisations_computed: Counter,
    /// Bundles of whole blends that were written, not taken from the cache.
    pub blend_bundles_computed: Counter,
    /// Pictures that were rendered, not taken from the cache.
    pub previews_rendered: Counter,
    /// Targets that a profile was searched for, not taken from memory.
    pub targets_searched: Counter,
}

impl std::fmt::Debug for Metrics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Metrics").finish_non_exhaustive()
    }
}

impl Metrics {
    /// All at zero.
    ///
    /// # Panics
    ///
    /// Never: the buckets are not empty.
    #[must_use]
    pub fn new() -> Self {
        let recorder = PrometheusBuilder::new()
            .set_buckets(&BUCKETS)
            .expect("the buckets are not empty")
            .build_recorder();
        let counter = |name: &'static str, what: &'static str| {
            recorder.describe_counter(name.into(), Some(Unit::Count), what.into());
            let counter = recorder.register_counter(&Key::from_static_name(name), &METADATA);
            counter.increment(0);
            counter
        };
        let paints_fitted = counter("carpaint_paints_fitted_total", "Uploads that were fitted");
        let blends_computed = counter(
            "carpaint_blends_computed_total",
            "Correspondences that were found",
        );
        let realisations_computed = counter(
            "carpaint_realisations_computed_total",
            "Realisations that were computed",
        );
        let blend_bundles_computed = counter(
            "carpaint_blend_bundles_computed_total",
            "Bundles of whole blends that were written",
        );
        let previews_rendered = counter(
            "carpaint_previews_rendered_total",
            "Pictures that were rendered",
        );
        let targets_searched = counter(
            "carpaint_targets_searched_total",
            "Targets that a profile was searched for",
        );
        recorder.describe_histogram(
            "carpaint_http_request_seconds".into(),
            Some(Unit::Seconds),
            "Time from a request's header to its answer's".into(),
        );
        let handle = recorder.handle();
        Self {
            recorder,
            handle,
            paints_fitted,
            blends_computed,
            realisations_computed,
            blend_bundles_computed,
            previews_rendered,
            targets_searched,
        }
    }

    /// Counts a request.
    pub fn request(&self, method: &Method, route: &str, status: StatusCode, time: Duration) {
        let method = match *method {
            Method::GET => "GET",
            Method::HEAD => "HEAD",
            Method::POST => "POST",
            Method::DELETE => "DELETE",
            Method::PATCH => "PATCH",
            _ => "other",
        };
        let labels = vec![
            Label::from_static_parts("method", method),
            Label::new("route", route.to_owned()),
            Label::new("status", status.as_str().to_owned()),
        ];
        let key = Key::from_parts("carpaint_http_request_seconds", labels);
        self.recorder
            .register_histogram(&key, &METADATA)
            .record(time.as_secs_f64());
    }

    /// Sorts request times into their buckets, so that those that nobody asks for do not pile up.
    pub fn tidy(&self) {
        self.handle.run_upkeep();
    }

    /// The counts in Prometheus' text format.
    #[must_use]
    pub fn text(&self) -> String {
        self.tidy();
        self.handle.render()
    }
}

impl Default for Metrics {
    fn default() -> Self {
        Self::new()
    }
}
