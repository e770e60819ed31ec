//! What all handlers share: the store, the workshop, the workbench, the jobs, the counts.

use std::fs::{self, File};
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use moka::future::Cache;
use tokio::sync::{Mutex, RwLock, watch};

use super::ServiceConfig;
use super::environments::Environments;
use super::http::Problem;
use super::metrics::Metrics;
use super::shelf::Shelved;
use super::uploading::Uploading;
use super::work::{Jobs, Picks, Watchers, Workbench, Works};
use crate::store::{Blobs, Catalogue, FolderBlobs, ResultCache, SqliteCatalogue, StoreError};

/// A running service, shared by its handlers.
#[derive(Clone, Debug)]
pub struct App(Arc<Shared>);

/// What a service is made of.
pub struct Shared {
    /// Settings.
    pub config: ServiceConfig,
    /// What computes.
    pub works: Arc<dyn Works>,
    /// Uploads, paints and blends.
    pub blobs: Arc<dyn Blobs>,
    /// Records and jobs.
    pub catalogue: Arc<dyn Catalogue>,
    /// Realisations, pictures and correspondences that were computed before.
    pub results: ResultCache<Problem>,
    /// Where requests compute.
    pub bench: Workbench,
    /// What was picked for targets.
    pub picks: Picks,
    /// Jobs under way.
    pub jobs: Jobs,
    /// Who waits for pictures.
    pub watchers: Watchers,
    /// Counts.
    pub metrics: Metrics,
    /// Read while a blob is written and not yet named by a record, written while unnamed blobs are removed.
    pub removal: RwLock<()>,
    /// Held while colors of paints are read that were not noted.
    pub reading: Mutex<()>,
    /// Paints and blends as they were last read.
    pub shelf: Cache<String, Arc<Shelved>>,
    /// Environments as they were last read.
    pub environments: Environments,
    /// Uploads that nothing names yet.
    pub uploading: Uploading,
    ready: AtomicBool,
    stopping: watch::Sender<bool>,
    given_up: AtomicBool,
    /// Held open: the lock on the data folder.
    _lock: File,
}

impl Deref for App {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared")
            .field("config", &self.config)
            .finish_non_exhaustive()
    }
}

/// Makes the data folder this process's own.
fn lock(data: &Path) -> Result<File, StoreError> {
    let what = || format!("opening {}", data.display());
    fs::create_dir_all(data).map_err(StoreError::io(what()))?;
    let file = File::create(data.join("lock")).map_err(StoreError::io(what()))?;
    match file.try_lock() {
        Ok(()) => Ok(file),
        Err(fs::TryLockError::WouldBlock) => Err(StoreError::InUse(data.display().to_string())),
        Err(fs::TryLockError::Error(error)) => Err(StoreError::io(what())(error)),
    }
}

impl App {
    /// Opens the store under the configured folder.
    ///
    /// # Errors
    ///
    /// [`StoreError`] when the folder is in use, full, or not this program's.
    pub async fn open(config: ServiceConfig, works: Arc<dyn Works>) -> Result<Self, StoreError> {
        let lock = lock(&config.data)?;
        let blobs = FolderBlobs::open(&config.data)?;
        let catalogue = SqliteCatalogue::open(&config.data.join("catalogue.sqlite")).await?;
        let results = ResultCache::open(
            &config.data.join("results"),
            config.memory_bytes / 2,
            config.disk_bytes,
        )?;
        let shelf = Cache::builder()
            .max_capacity(config.memory_bytes / 4)
            .weigher(|_, shelved: &Arc<Shelved>| shelved.weight())
            .build();
        let environments = Environments::new(config.memory_bytes / 4);
        let processors = rayon::current_num_threads();
        Ok(Self(Arc::new(Shared {
            works,
            blobs: Arc::new(blobs),
            catalogue: Arc::new(catalogue),
            results,
            bench: Workbench::new(processors, config.most_waiting),
            picks: Picks::default(),
            jobs: Jobs::new(processors.div_ceil(2), config.most_jobs),
            watchers: Watchers::default(),
            metrics: Metrics::new(),
            removal: RwLock::new(()),
            reading: Mutex::new(()),
            shelf,
            environments,
            uploading: Uploading::default(),
            ready: AtomicBool::new(false),
            stopping: watch::Sender::new(false),
            given_up: AtomicBool::new(false),
            _lock: lock,
            config,
        })))
    }

    /// Says that everything is loaded.
    pub fn set_ready(&self) {
        self.ready.store(true, Ordering::SeqCst);
    }

    /// Whether everything is loaded.
    #[must_use]
    pub fn is_ready(&self) -> bool {
        self.ready.load(Ordering::SeqCst)
    }

    /// Asks everything under way to come to an end.
    pub fn stop(&self) {
        self.stopping.send_replace(true);
    }

    /// Whether the service is going down.
    #[must_use]
    pub fn is_stopping(&self) -> bool {
        *self.stopping.borrow()
    }

    /// Calls off what is still computed for callers: their time to wait is over.
    pub fn give_up(&self) {
        self.given_up.store(true, Ordering::SeqCst);
    }

    /// Whether nobody is waited for any more.
    #[must_use]
    pub fn has_given_up(&self) -> bool {
        self.given_up.load(Ordering::SeqCst)
    }

    /// Returns once the service goes down.
    pub async fn stopped(&self) {
        let _ = self
            .stopping
            .subscribe()
            .wait_for(|&stopping| stopping)
            .await;
    }
}
