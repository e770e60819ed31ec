//! What all handlers share: the store, the workshop, the workbench, the jobs, the counts.

use std::fs::{self, File};
use std::ops::Deref;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use bytes::Bytes;
use moka::future::Cache;
use serde::Serialize;
use tokio::sync::{RwLock, watch};

use super::http::{Keep, Kind, Problem};
use super::ids;
use super::metrics::Metrics;
use super::resources::documents;
use super::work::{Jobs, Thing, Watchers, Workbench, Works};
use crate::blend::Blend;
use crate::paint::PaintFile;
use crate::service::ServiceConfig;
use crate::store::{
    BlendRecord, BlobBytes, Blobs, CachedResult, Catalogue, FolderBlobs, Hash, PaintRecord,
    ResultCache, SqliteCatalogue, StoreError, Visibility,
};

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
    /// Jobs under way.
    pub jobs: Jobs,
    /// Who waits for pictures.
    pub watchers: Watchers,
    /// Counts.
    pub metrics: Metrics,
    /// Read while a blob is written and not yet named by a record, written while unnamed blobs are removed.
    pub removal: RwLock<()>,
    /// Paints and blends as they were last read.
    shelf: Cache<String, Arc<Shelved>>,
    ready: AtomicBool,
    stopping: watch::Sender<bool>,
    /// Held open: the lock on the data folder.
    _lock: File,
}

/// A paint or a blend, read and described.
#[derive(Debug)]
pub struct Shelved {
    /// Its address.
    pub id: String,
    /// Itself.
    pub thing: Thing,
    /// Names of its paints, in the order of weights.
    pub names: Vec<String>,
    /// What is told about it, as JSON.
    pub document: CachedResult,
    /// Blob of its file.
    pub file: Hash,
    /// Hash of its physical content.
    pub content: Hash,
    /// Whether lists show it.
    pub visibility: Visibility,
    /// Blob of its measurement, where there was one.
    pub measurement: Option<Hash>,
}

impl Shelved {
    /// How long files and pictures of it may be kept: what is private, by who asked for it.
    #[must_use]
    pub fn keep(&self) -> Keep {
        match self.visibility {
            Visibility::Published => Keep::ForEver,
            Visibility::Private => Keep::Own,
        }
    }
}

/// What else than its paints was asked of a blend, kept with its record.
#[derive(Clone, Debug, Serialize, serde::Deserialize)]
pub struct BlendOptions {
    /// How accurate.
    pub profile: crate::accuracy::Profile,
    /// Place, in the stored blend, of the paint asked for first, second, …
    pub places: Vec<usize>,
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
            .max_capacity(config.memory_bytes / 2)
            .weigher(|_, shelved: &Arc<Shelved>| shelved.weight())
            .build();
        let processors = rayon::current_num_threads();
        Ok(Self(Arc::new(Shared {
            works,
            blobs: Arc::new(blobs),
            catalogue: Arc::new(catalogue),
            results,
            bench: Workbench::new(processors, config.most_waiting),
            jobs: Jobs::new(processors.div_ceil(2), config.most_jobs),
            watchers: Watchers::default(),
            metrics: Metrics::new(),
            removal: RwLock::new(()),
            shelf,
            ready: AtomicBool::new(false),
            stopping: watch::Sender::new(false),
            _lock: lock,
            config,
        })))
    }

    /// The paint of this id.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownPaint`] when there is none.
    pub async fn paint(&self, id: &str) -> Result<Arc<Shelved>, Problem> {
        self.shelved(id, "p_", || self.read_paint(id))
            .await?
            .ok_or_else(|| unknown_paint(id))
    }

    /// The blend of this id.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownBlend`] when there is none.
    pub async fn blend(&self, id: &str) -> Result<Arc<Shelved>, Problem> {
        self.shelved(id, "b_", || self.read_blend(id))
            .await?
            .ok_or_else(|| {
                Problem::new(Kind::UnknownBlend, format!("There is no blend {id:?}."))
                    .accepting("the id of an answer to POST /v1/blends")
            })
    }

    /// From the shelf, or read once however many ask.
    async fn shelved<F>(
        &self,
        id: &str,
        prefix: &str,
        read: impl Fn() -> F,
    ) -> Result<Option<Arc<Shelved>>, Problem>
    where
        F: Future<Output = Result<Option<Shelved>, Problem>>,
    {
        if !ids::is(prefix, id) {
            return Ok(None);
        }
        if let Some(shelved) = self.shelf.get(id).await {
            return Ok(Some(shelved));
        }
        loop {
            let shelve = async { read().await.map_err(Some)?.map(Arc::new).ok_or(None) };
            let shelved = match self.shelf.try_get_with_by_ref(id, shelve).await {
                Ok(shelved) => shelved,
                Err(problem) => return (*problem).clone().map_or(Ok(None), Err),
            };
            // What was forgotten or changed while it was read does not stay on the shelf.
            let _reading = self.removal.read().await;
            let on_record = match &shelved.thing {
                Thing::Paint(_) => self.catalogue.paint(id).await?.map(|of| of.visibility),
                Thing::Blend(_) => self.catalogue.blend(id).await?.map(|_| shelved.visibility),
            };
            if on_record == Some(shelved.visibility) {
                return Ok(Some(shelved));
            }
            self.shelf.invalidate(id).await;
            if on_record.is_none() {
                return Ok(None);
            }
        }
    }

    async fn read_paint(&self, id: &str) -> Result<Option<Shelved>, Problem> {
        let (record, bytes) = {
            // Held while the blob is fetched, not while a place to compute is waited for.
            let _reading = self.removal.read().await;
            let Some(record) = self.catalogue.paint(id).await? else {
                return Ok(None);
            };
            let bytes = self.stored(record.paint).await?;
            (record, bytes)
        };
        let (limits, works) = (self.config.limits, Arc::clone(&self.works));
        let shelve = move || -> Result<Shelved, Problem> {
            let file = PaintFile::from_bytes(&bytes, &limits).map_err(Problem::internal)?;
            let names = vec![file.name.clone()];
            let thing = Thing::Paint(Box::new(file));
            let links = documents::of_paint(&record);
            let document = documents::described(&record.id, works.describe(&thing), links);
            let PaintRecord {
                id,
                paint: file,
                measurement,
                content,
                visibility,
                ..
            } = record;
            Ok(Shelved {
                id,
                thing,
                names,
                document,
                file,
                content,
                visibility,
                measurement,
            })
        };
        self.bench.run(shelve).await?.map(Some)
    }

    async fn read_blend(&self, id: &str) -> Result<Option<Shelved>, Problem> {
        let Some(BlendRecord {
            id,
            paints,
            options,
            blend: file,
        }) = self.catalogue.blend(id).await?
        else {
            return Ok(None);
        };
        let options: BlendOptions = serde_json::from_str(&options).map_err(Problem::internal)?;
        let bytes = self.stored(file).await?;
        let (limits, works) = (self.config.limits, Arc::clone(&self.works));
        let shelve = move || -> Result<Shelved, Problem> {
            let blend = Blend::from_bytes(&bytes, &limits)
                .map_err(Problem::internal)?
                .in_order(&options.places);
            let names = blend
                .ingredients()
                .map(|(name, _)| name.to_owned())
                .collect();
            let thing = Thing::Blend(Box::new(blend));
            let links = documents::of_blend(&id, &paints, &options);
            let document = documents::described(&id, works.describe(&thing), links);
            Ok(Shelved {
                id,
                thing,
                names,
                document,
                file,
                content: file,
                visibility: Visibility::default(),
                measurement: None,
            })
        };
        self.bench.run(shelve).await?.map(Some)
    }

    /// A blob that a record names.
    async fn stored(&self, blob: Hash) -> Result<Bytes, Problem> {
        let bytes = self.blobs.read(blob).await?;
        bytes.ok_or_else(|| Problem::internal(format!("blob {blob} is on record but not there")))
    }

    /// Whether a paint has this id.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn has_paint(&self, id: &str) -> Result<bool, Problem> {
        Ok(self.catalogue.paint(id).await?.is_some())
    }

    /// Removes blobs that nothing names: what was uploaded in the moment before a crash.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn sweep(&self) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        for blob in self.blobs.all().await? {
            self.forget_unnamed(blob).await?;
        }
        Ok(())
    }

    /// Keeps a paint under an id. Nothing happens where the id is taken.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn keep_paint(
        &self,
        id: &str,
        file: PaintFile,
        measurement: Option<Hash>,
    ) -> Result<(), Problem> {
        let _writing = self.removal.read().await;
        let hashed = tokio::task::spawn_blocking(move || {
            (file.to_bytes(), Hash::from(file.paint.content_hash()), file)
        });
        let (bytes, content, file) = hashed.await.map_err(Problem::internal)?;
        let paint = self.blobs.put(bytes.into()).await?.hash;
        let record = PaintRecord {
            id: id.to_owned(),
            name: file.name,
            source: file.provenance.source,
            measurement,
            paint,
            content,
            visibility: Visibility::default(),
        };
        self.catalogue.add_paint(&record).await?;
        Ok(())
    }

    /// A blob that the record of a paint names, to be streamed.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownPaint`] when the paint was deleted a moment ago.
    pub async fn stream_of(&self, id: &str, blob: Hash) -> Result<BlobBytes, Problem> {
        // An open blob can be read to its end, whatever becomes of its name.
        let _reading = self.removal.read().await;
        match self.blobs.stream(blob).await? {
            Some(bytes) => Ok(bytes),
            None if self.catalogue.paint(id).await?.is_none() => Err(unknown_paint(id)),
            None => Err(Problem::internal(format!("a blob of {id} is not there"))),
        }
    }

    /// Forgets a paint and every blob that nothing else names.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownPaint`] when there is none.
    pub async fn forget_paint(&self, id: &str) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        let gone = self
            .catalogue
            .remove_paint(id)
            .await?
            .ok_or_else(|| unknown_paint(id))?;
        self.shelf.invalidate(id).await;
        for blob in gone.measurement.into_iter().chain([gone.paint]) {
            self.forget_unnamed(blob).await?;
        }
        Ok(())
    }

    /// Publishes a paint or makes it private.
    ///
    /// # Errors
    ///
    /// [`Kind::UnknownPaint`] when there is none.
    pub async fn show_paint(&self, id: &str, visibility: Visibility) -> Result<(), Problem> {
        // Nobody reads the record before and shelves it after.
        let _changing = self.removal.write().await;
        if !self.catalogue.show_paint(id, visibility).await? {
            return Err(unknown_paint(id));
        }
        self.shelf.invalidate(id).await;
        Ok(())
    }

    /// Forgets an upload that came to nothing.
    ///
    /// # Errors
    ///
    /// [`Problem`] when the store fails.
    pub async fn forget_upload(&self, upload: Hash) -> Result<(), Problem> {
        let _removing = self.removal.write().await;
        self.forget_unnamed(upload).await
    }

    async fn forget_unnamed(&self, blob: Hash) -> Result<(), Problem> {
        if !self.catalogue.names_blob(blob).await? {
            self.blobs.remove(blob).await?;
        }
        Ok(())
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

    /// Returns once the service goes down.
    pub async fn stopped(&self) {
        let _ = self
            .stopping
            .subscribe()
            .wait_for(|&stopping| stopping)
            .await;
    }
}

fn unknown_paint(id: &str) -> Problem {
    Problem::new(Kind::UnknownPaint, format!("There is no paint {id:?}."))
        .accepting("an id that GET /v1/paints lists")
}

impl Shelved {
    /// Bytes in memory, about.
    fn weight(&self) -> u32 {
        let clusters = match &self.thing {
            Thing::Paint(file) => file
                .paint
                .flakes
                .as_ref()
                .map_or(0, crate::paint::Flakes::clusters),
            Thing::Blend(blend) => blend.report().clusters * blend.len(),
        };
        // A box is 24 bytes and a probability 8.
        u32::try_from(clusters * 32 + self.document.bytes.len() + (16 << 10)).unwrap_or(u32::MAX)
    }
}
